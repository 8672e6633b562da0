"""Flights with each backend, close to where setpoints cost most: above the ground, and among holes of a fence."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from typing import NamedTuple

from tests.patient_checks import wait_until_ready
from tests.simulators import ArduPilot, Autopilot, MemoryPort, Px4
from tests.simulators.airsim import Vehicle
from tests.simulators.airsim_server import AirsimServer
from tests.simulators.lockstep import LockstepBackend
from tests.simulators.lockstep_crazyflie import LockstepCrazyflie
from tests.simulators.lockstep_dji import LockstepPsdk
from tests.simulators.lockstep_mavros import LockstepMavros
from tests.waiting import until, until_state
from ual.errors import NotSupportedError
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.settings import GeofenceSettings, VehicleSettings

OPTIONS = BackendOptions("uav_1", settings={"pose_rate_hz": 50.0})
"""As often as a daemon asks by default: the work of each second is counted."""
CONCAVE = ((-1.5, -1.5), (40.0, -1.5), (40.0, 30.0), (1.5, 30.0), (1.5, 1.5), (-1.5, 1.5))
"""A configured fence, which cannot have holes: a corner of it points inwards, 2 m from where the UAV flies."""


class TestPosition(NamedTuple):
    """Position of the flight, and its bounds."""

    height_m: float
    settings: VehicleSettings
    has_holes: bool = False
    """Whether the autopilot's own fence has holes around it."""


CORNER = TestPosition(0.8, VehicleSettings(geofence=GeofenceSettings(polygon=CONCAVE)))


def free() -> TestPosition:
    """Returns a place with room on all sides."""
    return TestPosition(8.0, VehicleSettings())


def narrow(name: str) -> TestPosition:
    """Returns the narrowest place for a backend: low, and between holes where its autopilot's fence can have some."""
    return CORNER._replace(has_holes=name.startswith("mavlink"))


def _zones() -> list[tuple[bool, list[tuple[float, float]], float | None]]:
    def ring(x: float, y: float, radius_m: float, sides: int = 16) -> list[tuple[float, float]]:
        angles = [2.0 * math.pi * side / sides for side in range(sides)]
        return [(x + radius_m * math.cos(angle), y + radius_m * math.sin(angle)) for angle in angles]

    holes = [(False, ring(x, y, 1.5), None) for x, y in ((5.0, 0.0), (0.0, 5.0), (-5.0, 0.0), (0.0, -5.0))]
    return [(True, ring(0.0, 0.0, 40.0), None), *holes, (False, [(8.0, 8.0)], 4.0)]


def _autopilot(kind: type[Px4 | ArduPilot], has_holes: bool) -> tuple[Autopilot, MemoryPort]:
    port = MemoryPort()
    autopilot = Px4(port, is_terse=True) if kind is Px4 else ArduPilot(port)
    if has_holes:
        autopilot.parameters.update({"GF_ACTION": 2.0} if kind is Px4 else {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 4.0})
        autopilot.set_fence(*_zones())
    return autopilot, port


@contextmanager
def _mavlink(kind: type[Px4 | ArduPilot], place: TestPosition) -> Iterator[Backend]:
    autopilot, port = _autopilot(kind, place.has_holes)
    yield LockstepBackend(OPTIONS, autopilot, port)


@contextmanager
def _mavros(place: TestPosition) -> Iterator[Backend]:
    yield LockstepMavros(OPTIONS, *_autopilot(Px4, place.has_holes), ros=2)


@contextmanager
def _simple(kind: Callable[[BackendOptions], Backend], _: TestPosition) -> Iterator[Backend]:
    yield kind(BackendOptions("uav_1"))


@contextmanager
def _airsim(_: TestPosition) -> Iterator[Backend]:
    from ual_daemon.backends.registry import make

    with AirsimServer([Vehicle("Drone1")], clock_speed=6.0) as server:
        yield make("airsim", BackendOptions("uav_1", server.url, {"rate_hz": 25.0}))


@contextmanager
def _light(_: TestPosition) -> Iterator[Backend]:
    from ual_daemon.backends.light import LightBackend

    yield LightBackend(BackendOptions("uav_1", settings={"speed_factor": 6.0}))


BACKENDS: dict[str, Callable[[TestPosition], AbstractContextManager[Backend]]] = {
    "light": _light,
    "mavlink-px4": partial(_mavlink, Px4),
    "mavlink-ardupilot": partial(_mavlink, ArduPilot),
    "mavros": _mavros,
    "crazyflie": partial(_simple, LockstepCrazyflie),
    "airsim": _airsim,
    "dji": partial(_simple, LockstepPsdk),
}
"""Factory of each backend."""


@contextmanager
def flying(name: str, place: TestPosition) -> Iterator[UAL]:
    """A UAV in the air at a place."""
    with ExitStack() as stack:
        backend = stack.enter_context(BACKENDS[name](place))
        uav = UAL(backend, settings=place.settings, allow_arming=True)
        stack.callback(uav.vehicle.close)  # at once, in the air
        wait_until_ready(uav)
        if place.has_holes:
            until(lambda: bool((backend.snapshot().autopilot_fence or _NO_ZONES).zones), "its fence")
        until(lambda: _is_home_known(backend), "its home")
        _arm(uav)
        uav.take_off(place.height_m)
        yield uav


class _NoZones(NamedTuple):
    zones: tuple[object, ...] = ()


_NO_ZONES = _NoZones()


def _is_home_known(backend: Backend) -> bool:
    snapshot = backend.snapshot()
    is_placed = snapshot.earth.home_altitude_amsl_m is not None and snapshot.earth.projection is not None
    return is_placed or backend.info().autopilot != "ArduPilot"


def _arm(uav: UAL) -> None:
    until_state(uav, State.LANDED_DISARMED, State.LANDED_ARMED)
    if uav.state() is State.LANDED_DISARMED:
        try:
            uav.simulation.pilot_arm()
        except NotSupportedError:
            uav.arm()
    until_state(uav, State.LANDED_ARMED)
