"""Simulated autopilots for tests, a PX4 and an ArduCopter, which use MAVLink as the real ones do.

They behave as real ones were measured and recorded (``tests/data``). Any difference to a real one is a defect.
``python -m tests.simulators px4`` runs one in a process of its own.
"""

from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import Autopilot
from tests.simulators.faults import BadLink, Faults
from tests.simulators.ports import MemoryPort, Port, TcpPort, UdpPort
from tests.simulators.px4 import Px4
from tests.simulators.runner import flying

__all__ = ["ArduPilot", "Autopilot", "BadLink", "Faults", "MemoryPort", "Port", "Px4", "TcpPort", "UdpPort", "flying"]
