"""Simulated autopilots that speak MAVLink as the real ones do, for tests: a PX4 and an ArduCopter.

They behave as measured and as recorded (``tests/data``); where a real one does something else, they are wrong.
``python -m tests.simulators px4`` flies one in a process of its own.
"""

from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import Autopilot
from tests.simulators.faults import BadLink, Faults
from tests.simulators.ports import MemoryPort, Port, TcpPort, UdpPort
from tests.simulators.px4 import Px4
from tests.simulators.runner import flying

__all__ = ["ArduPilot", "Autopilot", "BadLink", "Faults", "MemoryPort", "Port", "Px4", "TcpPort", "UdpPort", "flying"]
