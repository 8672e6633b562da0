"""The MAVLink backend and a simulated autopilot on one clock: faster than real time, and slower on a busy computer.

All of the backend except its sockets is real. Its thread steps the autopilot instead of waiting for a link, so
that neither can be late: the flight does not depend on the speed of the computer.
"""

from __future__ import annotations

from collections.abc import Mapping

from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import STEP_S, Autopilot
from tests.simulators.pace import Pace
from tests.simulators.ports import MemoryPort
from tests.simulators.px4 import Px4
from tests.simulators.simulation import PilotSimulation
from ual.interface import Simulation
from ual_daemon.backends.base import BackendOptions, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.mavlink.backend import MavlinkBackend
from ual_daemon.backends.mavlink.links import Address, LinkConnection
from ual_daemon.backends.mavlink.links.base import Chunk, MavlinkLink

SPEED = 6.0
POSE_RATE_HZ = 25.0
"""Half of what a daemon asks for by default: nearly half of the processor time of a flight goes with it."""
ADDRESS = ("127.0.0.1", 14580)
_BEGIN_UTC_S = 1.8e9
_BATCH = 64
"""Datagrams that are received at once."""


class LockstepBackend(MavlinkBackend):
    """Flies a simulated autopilot with the single link `port`, and offers its safety pilot."""

    looks_each_step = False
    """Whether it looks for messages after each step of the autopilot, and not only as often as poses come."""

    def __init__(self, options: BackendOptions, autopilot: Autopilot, port: MemoryPort, speed: float = SPEED) -> None:
        settings = {"pose_rate_hz": POSE_RATE_HZ, **options.settings}
        super().__init__(BackendOptions(options.ns, "udpout://127.0.0.1:1", settings))  # nothing is sent there
        self.autopilot = autopilot
        # In fast time the autopilot would disarm before a caller takes off.
        for name in ("COM_DISARM_PRFLT", "DISARM_DELAY"):
            if name in autopilot.parameters:
                autopilot.parameters[name] = 60.0
        self.clock = _Clock(autopilot)
        self._port = port
        self._speed = speed

    def open(self, on_update: UpdateCallback) -> None:
        turn_s = STEP_S if self.looks_each_step else max(STEP_S, 1.0 / self._settings.pose_rate_hz)
        self.connection = _Connection(self.autopilot, self._port, turn_s, self._speed)
        self._start(self.connection, on_update)

    def simulation(self) -> Simulation:
        return PilotSimulation(self.autopilot)


class LockstepPx4(LockstepBackend):
    """With a PX4."""

    def __init__(self, options: BackendOptions) -> None:
        port = MemoryPort()
        super().__init__(options, Px4(port, is_terse=True), port)


class LockstepArduPilot(LockstepBackend):
    """With an ArduCopter."""

    def __init__(self, options: BackendOptions) -> None:
        port = MemoryPort()
        super().__init__(options, ArduPilot(port), port)


class _Clock(MonotonicClock):
    """The autopilot's time."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot

    def now_s(self) -> float:
        return self._autopilot.elapsed_s

    def utc_s(self) -> float:
        return _BEGIN_UTC_S + self._autopilot.elapsed_s


class _Connection(LinkConnection):
    """Advances the autopilot's time by `turn_s` instead of waiting, at most `speed` times as fast as real time."""

    def __init__(self, autopilot: Autopilot, port: MemoryPort, turn_s: float, speed: float) -> None:
        super().__init__(MemoryLink(port), "a simulated autopilot")
        self._autopilot = autopilot
        self._port = port
        self._turn_s = turn_s
        self._pace = Pace(turn_s, speed)
        self.pause_s = 0.0
        """Seconds for which the daemon does not run, once; messages of the meantime wait."""

    def receive(self, timeout_s: float, now_s: float) -> list[Chunk]:
        self._pace.wait()
        if len(self._port.sent) < _BATCH:  # else more waits already, as on a UDP link
            pause_s, self.pause_s = self.pause_s, 0.0
            self._autopilot.run(pause_s + self._turn_s)
        return [(self._port.sent.popleft()[1], ADDRESS) for _ in range(min(_BATCH, len(self._port.sent)))]

    def discard(self, now_s: float) -> None:
        self._port.sent.clear()


class MemoryLink(MavlinkLink):
    """The link to the autopilot, in memory."""

    is_stream = False

    def __init__(self, port: MemoryPort) -> None:
        self._port = port

    def open(self) -> None:
        """It is always open."""

    def close(self) -> None:
        """It is never closed."""

    def descriptors(self) -> Mapping[int, int]:
        return {}

    def receive(self, now_s: float) -> list[Chunk]:
        return []

    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        self._port.arriving.append(data)
        return True

    @property
    def peer(self) -> Address | None:
        return ADDRESS
