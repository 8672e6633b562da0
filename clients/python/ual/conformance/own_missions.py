"""Checks of missions that the autopilot flies by itself.

What it has is left alone: only where it has no mission one is uploaded, flown, and removed again.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, CheckFailedError, Flight, position, require
from ual.errors import InvalidArgumentError, NotSupportedError, TaskAbortedError, WrongStateError
from ual.missions.items import Item, Jump, Speed, TakeOff, Waypoint
from ual.missions.plan import StoredMission
from ual.types import AltitudeReference, GeoPoint, State, TaskKind, TaskStatus, Telemetry

_HEIGHT_M = 10.0
_WAYPOINT_AHEAD_M = 8.0
_FAR_WAYPOINT_M = 20.0
_HOLD_S = 5.0
_GPS_POSITION_S = 10.0
"""PX4 counts a place within 10 m (NAV_ACC_RAD) as reached. While it holds there it flies on to it."""
_DEGREE_M = 111_195.0


@check()
def reads_the_autopilots_mission(flight: Flight) -> None:
    """The mission is read; one that is none is refused, names its item, and changes nothing."""
    kept, mission = _kept(flight), flight.uav.mission
    flight.refuses(InvalidArgumentError, lambda: mission.upload([]), "a mission without items")
    faulty: list[Item] = [TakeOff(_HEIGHT_M), Speed(-1.0, number="7")]
    for ask, what in ((mission.plan, "the plan of"), (mission.upload, "uploading")):
        error = flight.refuses(InvalidArgumentError, lambda ask=ask: ask(faulty), f"{what} a speed below 0")  # type: ignore[misc]
        require("item 7" in error.message, f"the refusal does not name the item: {error.message}")
    nowhere: list[Item] = [TakeOff(_HEIGHT_M), Jump(9, 1)]
    flight.refuses(InvalidArgumentError, lambda: mission.upload(nowhere), "a jump to no item")
    flight.refuses(InvalidArgumentError, lambda: mission.start(0), "a start with item 0")
    require(mission.download() == kept, "a refused upload has changed the mission")
    watched = mission.watch()
    progress = next(watched)
    require(progress.item is None or progress.item >= 1, f"items are counted from 1: {progress}")


@check(State.LANDED_DISARMED)
def keeps_an_uploaded_mission(flight: Flight) -> None:
    """A mission is kept as it was uploaded, is not flown while disarmed, and is removed."""
    mission = flight.uav.mission
    with _alone(flight):
        take_off, waypoint = TakeOff(_HEIGHT_M), _ahead(flight, _WAYPOINT_AHEAD_M, _HEIGHT_M)
        kept = mission.upload([take_off, waypoint])
        first, *rest = kept.items
        # PX4 needs a place for a take-off, and gets that of the UAV.
        is_kept = isinstance(first, TakeOff) and first.altitude_m == take_off.altitude_m and rest == [waypoint]
        require(is_kept, f"{take_off}, {waypoint} were read back as {kept.items}")
        require(mission.download() == kept and bool(kept.digest), f"it is not kept: {mission.download()}")
        flight.refuses(WrongStateError, mission.start, "a start while disarmed")
        flight.refuses(WrongStateError, mission.pause, "a pause of no mission")
        flight.refuses(WrongStateError, lambda: mission.jump_to(1), "a jump in no mission")
        mission.clear()
        require(mission.download() == StoredMission(()), "it is not removed")


@check(State.FLYING_AUTO, moves="8 m to the north, with a pause, and back")
def flies_a_mission_of_the_autopilot(flight: Flight) -> None:
    """The autopilot flies the mission as a task, which pauses, goes on and ends; UAL holds the position then."""
    mission, uav = flight.uav.mission, flight.uav
    with _alone(flight):
        begun = flight.position()
        mission.upload([_ahead(flight, _WAYPOINT_AHEAD_M, hold_s=_HOLD_S), _ahead(flight, 0.0, hold_s=_HOLD_S)])
        info = mission.start()
        task = uav.task(info.id)
        require(info.kind is TaskKind.MISSION, f"the task is {info.kind.name}")
        with flight.recording() as recorded:
            flight.wait(lambda sample: (position(sample) - begun).norm() >= 1.0, "its way")
            flight.refuses_during(task, [(mission.clear, "removing a mission that is flown")])
            mission.pause()
            flight.wait(lambda sample: sample.task is not None and sample.task.is_paused, "the pause")
            flight.wait(flight.is_slow, "rest")
            mission.resume()
            require(task.wait().status is TaskStatus.SUCCEEDED, "it did not succeed")
            states = {sample.state for sample in recorded()}
        require(states <= {State.FLYING_AUTO}, f"amid the mission it was {states}")
        off_m = (flight.position() - begun).horizontal_norm()
        require(off_m <= 2.0 + 2.0 * flight.tolerances.position_m, f"it ended {off_m:.1f} m from where it began")
        require(uav.state() is State.FLYING_AUTO, f"after the mission it is {uav.state().name}")


@check(State.FLYING_AUTO, moves="20 m to the north at most, and back")
def a_mission_of_the_autopilot_is_aborted(flight: Flight) -> None:
    """An abort ends the mission: the task says so, and UAL holds the position."""
    with _alone(flight):
        begun = flight.position()
        flight.uav.mission.upload([_ahead(flight, _FAR_WAYPOINT_M), _ahead(flight, 0.0)])
        task = flight.uav.task(flight.uav.mission.start().id)
        flight.wait(lambda sample: (position(sample) - begun).norm() >= 1.0, "its way")
        flight.uav.abort()
        flight.refuses(TaskAbortedError, task.wait, "waiting for the aborted mission")
        flight.wait(lambda sample: sample.state is State.FLYING_AUTO and flight.is_slow(sample), "rest")
        flight.require_stays("after the abort")


@contextlib.contextmanager
def _alone(flight: Flight) -> Iterator[None]:
    """Requires that the autopilot has no mission, and leaves none behind."""
    if _kept(flight).items:
        raise CannotRunError("the autopilot has a mission, which is left alone: remove it (ual mission clear)")
    _here(flight)
    try:
        yield
    finally:
        if flight.uav.mission.progress().task_id:
            flight.uav.abort()
        flight.uav.mission.clear()


def _here(flight: Flight) -> GeoPoint:
    """Returns where it is. A bridge may tell that later than its state."""
    try:
        here = flight.wait(_is_placed, "its place on Earth", _GPS_POSITION_S).position_geo
    except CheckFailedError as error:
        raise CannotRunError("it is not known where on Earth the UAV is") from error
    assert here is not None
    return here


def _is_placed(sample: Telemetry) -> bool:
    return sample.position_geo is not None and sample.position_geo.altitude_amsl_m is not None


def _ahead(flight: Flight, north_m: float, height_m: float | None = None, hold_s: float = 0.0) -> Waypoint:
    """A waypoint to the north of where it is; at its height, or at one above home."""
    here = _here(flight)
    latitude_deg = round(here.latitude_deg + north_m / _DEGREE_M, 7)
    longitude_deg = round(here.longitude_deg, 7)
    if height_m is not None:
        return Waypoint(latitude_deg, longitude_deg, height_m)
    assert here.altitude_amsl_m is not None
    altitude_m = math.floor(here.altitude_amsl_m * 100.0 + 0.5) / 100.0
    return Waypoint(latitude_deg, longitude_deg, altitude_m, AltitudeReference.AMSL, hold_s)


def _kept(flight: Flight) -> StoredMission:
    try:
        return flight.uav.mission.download()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None


ON_GROUND = (reads_the_autopilots_mission, keeps_an_uploaded_mission)
IN_FLIGHT = (flies_a_mission_of_the_autopilot, a_mission_of_the_autopilot_is_aborted)
