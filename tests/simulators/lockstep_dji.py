"""The DJI backend and a simulated aircraft on one clock: faster than real time, and slower on a busy computer.

All of the backend except the WebSocket is real. Its thread steps the aircraft instead of waiting for the bridge.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from typing_extensions import override

from tests.simulators.dji import STEP_S, Aircraft, Front, OsdkSdkNode, OsdkVehicleNode, Psdk
from tests.simulators.dji_node import OneThreadBridge
from tests.simulators.memory_transport import MemoryTransport
from tests.simulators.pace import Pace
from tests.simulators.rosbridge import Bridge
from ual.interface import Simulation
from ual.simulation import SimulationPart
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.dji.backend import DjiBackend
from ual_daemon.backends.rosbridge import RosbridgeLink
from ual_daemon.backends.rosbridge.url import BridgeUrl
from ual_daemon.backends.rosbridge.websocket import BridgeTransport

SPEED = 6.0
_BEGIN_UTC_S = 1.8e9


class _Clock(MonotonicClock):
    """The bridge's time."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge

    @override
    def now_s(self) -> float:
        return self._bridge.now_s

    @override
    def utc_s(self) -> float:
        return _BEGIN_UTC_S + self._bridge.now_s


class LockstepDji(DjiBackend):
    """Flies a simulated aircraft behind a wrapper, and offers its pilot."""

    ros = 2
    front: Callable[[Aircraft], Front] = Psdk
    bridge_kind: type[Bridge] = Bridge

    def __init__(self, options: BackendOptions, speed: float = SPEED) -> None:
        self.aircraft = Aircraft()
        kind = type(self)
        self.bridge = kind.bridge_kind(kind.ros, [kind.front(self.aircraft)])
        self.lock = threading.RLock()
        self.is_socket_full = False
        """Whether the bridge reads nothing, so that what is perishable does not leave."""
        self.on_step: Callable[[], object] = lambda: None
        """Is called before each step: what it does is done at an exact time of the aircraft."""
        self._pace = Pace(STEP_S, speed)
        super().__init__(BackendOptions(options.ns, "rosbridge://127.0.0.1:1", options.settings))

    @override
    def _make_link(self) -> RosbridgeLink:
        self.clock = _Clock(self.bridge)
        return RosbridgeLink(self._url, self.clock, self._step, self._connect, self._woke)

    def _connect(self, _: BridgeUrl, __: Callable[[], None]) -> BridgeTransport:
        return MemoryTransport(self.bridge, self._advance, self.lock, lambda: self.is_socket_full)

    def _advance(self) -> None:
        """Advances all by a step, at most so many times as fast as real time."""
        self._pace.wait()
        with self.lock:
            self.on_step()
            self.bridge.step(self.bridge.now_s + STEP_S)

    @override
    def utc_s(self) -> float:
        return self.clock.utc_s()

    @override
    def simulation(self) -> Simulation:
        return DjiPilot(self.aircraft, self.lock)


class LockstepPsdk(LockstepDji):
    """With psdk_ros2."""


class LockstepOsdk(LockstepDji):
    """With the older node of dji_osdk_ros."""

    ros = 1
    front = OsdkSdkNode


class LockstepOsdkVehicle(LockstepDji):
    """With the newer node of dji_osdk_ros."""

    ros = 1
    front = OsdkVehicleNode
    bridge_kind = OneThreadBridge


class DjiPilot(Simulation):
    """The safety pilot. The other members of a simulation are not supported."""

    def __init__(self, aircraft: Aircraft, lock: threading.RLock) -> None:
        self._aircraft = aircraft
        self._lock = lock

    @override
    def parts(self) -> frozenset[SimulationPart]:
        return frozenset((SimulationPart.PILOT,))

    @override
    def pilot_arm(self) -> None:
        with self._lock:
            self._aircraft.device, self._aircraft.sticks, self._aircraft.has_motors = 0, (0.0, 0.0, 0.0), True

    @override
    def pilot_disarm(self) -> None:
        with self._lock:
            assert self._aircraft.body.is_on_ground
            self._aircraft.has_motors = False

    @override
    def pilot_take_over(self) -> None:
        with self._lock:
            self._aircraft.pilot_takes_over()

    @override
    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        with self._lock:
            self._aircraft.sticks = (forward * 2.0, -left * 2.0, -up * 2.0)
