"""The MAVROS backend, the small rosbridge, a MAVROS and a simulated autopilot on one clock. All but sockets is real."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from typing_extensions import override

from tests.simulators.ardupilot import ArduPilot
from tests.simulators.autopilot import STEP_S, Autopilot
from tests.simulators.lockstep import POSE_RATE_HZ
from tests.simulators.mavros import BEGIN_UTC_S, Mavros
from tests.simulators.memory_transport import MemoryTransport
from tests.simulators.pace import Pace
from tests.simulators.ports import MemoryPort
from tests.simulators.px4 import Px4
from tests.simulators.rosbridge import Bridge
from tests.simulators.simulation import PilotSimulation
from ual.interface import Simulation
from ual.types import State
from ual_daemon.backends.base import BackendOptions, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.mavros.backend import MavrosBackend
from ual_daemon.backends.rosbridge import BridgeUrl, RosbridgeLink
from ual_daemon.backends.rosbridge.websocket import BridgeTransport
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.state import estimate

SPEED = 6.0


class LockstepMavros(MavrosBackend):
    """Flies an autopilot with the single link `port` through a MAVROS, and offers its safety pilot."""

    def __init__(
        self, options: BackendOptions, autopilot: Autopilot, port: MemoryPort, ros: int = 1, speed: float = SPEED
    ) -> None:
        settings = {"pose_rate_hz": POSE_RATE_HZ, **options.settings}
        super().__init__(BackendOptions(options.ns, "rosbridge://127.0.0.1:9", settings))
        self.autopilot = autopilot
        # In fast time the autopilot would disarm before a caller takes off.
        for name in ("COM_DISARM_PRFLT", "DISARM_DELAY"):
            if name in autopilot.parameters:
                autopilot.parameters[name] = 60.0
        self.node = Mavros(autopilot, port, ros=ros, has_gps_status=ros == 2)
        self.bridge = Bridge(ros, [self.node])
        self.bridge.groups = self.node.groups
        self.is_bridge_gone = False
        self.is_socket_full = False
        """Whether the bridge reads nothing, so that what is perishable does not leave."""
        self.is_stalled = False
        """Whether the bridge answers nothing: what it has to say waits."""
        self.history: list[tuple[float, State]] = []
        """Each change of the state that the data show by themselves, with its time: no slow test can miss one."""
        self.clock = _Clock(autopilot)
        self._pace = Pace(STEP_S, speed)

    @override
    def open(self, on_update: UpdateCallback) -> None:
        def update(snapshot: Snapshot) -> None:
            state = estimate(snapshot, self.freshness).state
            if not self.history or self.history[-1][1] is not state:
                self.history.append((snapshot.time_s, state))
            on_update(snapshot)

        super().open(update)

    @override
    def _make_link(self) -> RosbridgeLink:
        return RosbridgeLink(self.url, self.clock, self._step, self._dial, self._woke)

    def _dial(self, url: BridgeUrl, on_wait: Callable[[], None]) -> BridgeTransport:
        while self.is_bridge_gone:
            self.advance()
            on_wait()
        return _MavrosTransport(self)

    @override
    def simulation(self) -> Simulation:
        return PilotSimulation(self.autopilot)

    def advance(self) -> None:
        """Advances all by a step, at most so many times as fast as real time."""
        self._pace.wait()
        self.bridge.step(self.autopilot.elapsed_s + STEP_S)


class LockstepMavrosPx4(LockstepMavros):
    """With a PX4, and ROS 2."""

    def __init__(self, options: BackendOptions) -> None:
        port = MemoryPort()
        super().__init__(options, Px4(port, is_terse=True), port, ros=2)


class LockstepMavrosArduPilot(LockstepMavros):
    """With an ArduCopter, and ROS 1."""

    def __init__(self, options: BackendOptions) -> None:
        port = MemoryPort()
        super().__init__(options, ArduPilot(port), port, ros=1)


class _Clock(MonotonicClock):
    """The autopilot's time."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot

    @override
    def now_s(self) -> float:
        return self._autopilot.elapsed_s

    @override
    def utc_s(self) -> float:
        return BEGIN_UTC_S + self._autopilot.elapsed_s


class _MavrosTransport(MemoryTransport):
    """A connection to a bridge that may be gone."""

    def __init__(self, backend: LockstepMavros) -> None:
        lock = backend.autopilot.lock
        super().__init__(backend.bridge, backend.advance, lock, lambda: backend.is_socket_full)
        self._backend = backend

    @override
    def receive(self, timeout_s: float) -> Sequence[str | bytes]:
        self._require_bridge()
        if not self._backend.is_stalled:
            return super().receive(timeout_s)
        if timeout_s:
            self._backend.advance()
        return ()

    @override
    def send(self, text: bytes, *, is_perishable: bool = False) -> bool:
        self._require_bridge()
        return super().send(text, is_perishable=is_perishable)

    def _require_bridge(self) -> None:
        if self._backend.is_bridge_gone:
            raise ConnectionResetError("the bridge is gone")
