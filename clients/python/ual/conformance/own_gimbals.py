"""Checks of the gimbals. Each is turned, and moved to its neutral angles at the end."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight, require
from ual.errors import InvalidArgumentError, NotSupportedError, UnknownFrameError
from ual.geometry import PointStamped, Vector3
from ual.gimbals import GimbalAbility, GimbalActivity, GimbalInfo, GimbalStatus
from ual.interface import Gimbal

TURN_S = 15.0
"""Seconds that a gimbal may take to look elsewhere."""
ANGLE_TOLERANCE_RAD = 0.05
REPORT_S = 3.0
"""Seconds that a gimbal may take to report its attitude."""


@check()
def lists_the_gimbals(flight: Flight) -> None:
    """The gimbals are numbered from 0 on. One that is not there, and what one cannot do, is refused."""
    listed = _all(flight)
    require([each.number for each in listed] == list(range(len(listed))), f"the numbers are no places: {listed}")
    frames = {frame.frame_id for frame in flight.uav.frames()}
    require({each.frame_id for each in listed} <= frames, f"their frames are not listed: {listed}")
    for info, gimbal in _found(flight, GimbalAbility.HORIZON):
        if GimbalAbility.ROLL not in info.abilities:
            flight.refuses(NotSupportedError, partial(gimbal.set_angles, 0.0, 0.0, 0.1), "a roll")
        flight.refuses(InvalidArgumentError, partial(gimbal.set_angles, math.nan), "a pitch that is no number")
    absent = flight.uav.gimbals[len(listed)]
    error = flight.refuses(InvalidArgumentError, absent.status, "the status of a gimbal that is not there")
    require(str(len(listed)) in error.message, f"the refusal does not name the gimbal: {error.message}")


@check()
def turns_a_gimbal(flight: Flight) -> None:
    """A gimbal looks where it was ordered to, its frame with it. What is beyond its limits is refused."""
    for info, gimbal in _connected(flight, GimbalAbility.HORIZON, GimbalAbility.PITCH):
        pitch_rad = 0.3 if info.pitch is None else info.pitch.nearest(0.3)
        gimbal.set_angles(pitch_rad)
        _comes(flight, gimbal, partial(_is_at, pitch_rad), f"a pitch of {pitch_rad:.2f} rad")
        view = flight.uav.transform(f"{flight.uav.ns}/base_link", info.frame_id).rotation.rotate(Vector3(1.0))
        require(view.z < 0.0 or pitch_rad <= 0.0, f"its frame looks along {view} of the body")
        if info.pitch is not None and info.pitch.most_rad < math.pi - 0.2:
            beyond_rad = info.pitch.most_rad + 0.1
            order = partial(gimbal.set_angles, beyond_rad)
            error = flight.refuses(InvalidArgumentError, order, "a pitch beyond its limit")
            require("pitch_rad" in error.message, f"the refusal does not name the limit: {error.message}")
        _rests(flight, info, gimbal)


@check()
def points_a_gimbal(flight: Flight) -> None:
    """A gimbal that points at a position says so, and how far it looks beside it."""
    for info, gimbal in _connected(flight, GimbalAbility.HORIZON, GimbalAbility.PITCH, GimbalAbility.YAW):
        nowhere = partial(gimbal.point_at, PointStamped(Vector3(1.0), "nowhere"))
        flight.refuses(UnknownFrameError, nowhere, "a point in no frame")
        ahead = PointStamped(Vector3(5.0, 1.0, -1.0), f"{flight.uav.ns}/base_link")
        gimbal.point_at(ahead)
        _comes(flight, gimbal, _is_on_target, "a look at what it points at")
        status = gimbal.status()
        require(status.target == ahead, f"it says that it points at {status.target}, and not {ahead}")
        _rests(flight, info, gimbal)


def _rests(flight: Flight, info: GimbalInfo, gimbal: Gimbal) -> None:
    if GimbalAbility.NEUTRAL in info.abilities:
        gimbal.move_to_neutral()
        _comes(flight, gimbal, lambda it: it.activity is GimbalActivity.NEUTRAL, "the neutral angles")


def _is_at(pitch_rad: float, status: GimbalStatus) -> bool:
    return status.angles is not None and abs(status.angles.pitch_rad - pitch_rad) < ANGLE_TOLERANCE_RAD


def _is_on_target(status: GimbalStatus) -> bool:
    return status.off_target_rad is not None and status.off_target_rad < ANGLE_TOLERANCE_RAD


def _comes(flight: Flight, gimbal: Gimbal, is_so: Callable[[GimbalStatus], bool], what: str) -> None:
    flight.wait(lambda _: is_so(gimbal.status()), what, TURN_S)


def _all(flight: Flight) -> list[GimbalInfo]:
    try:
        return flight.uav.gimbals.get_all()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None


def _found(flight: Flight, *abilities: GimbalAbility) -> list[tuple[GimbalInfo, Gimbal]]:
    return [
        (each, flight.uav.gimbals[each.number])
        for each in _all(flight)
        if each.abilities.issuperset(abilities) and each.is_connected
    ]


def _connected(flight: Flight, *abilities: GimbalAbility) -> list[tuple[GimbalInfo, Gimbal]]:
    """Returns those that can do something, and tell where they look."""
    found = _found(flight, *abilities)
    if not found:
        raise CannotRunError(f"no gimbal offers {', '.join(each.name.lower() for each in abilities)}")
    telling = [(info, gimbal) for info, gimbal in found if not info.note or _tells(flight, gimbal)]
    if not telling:
        raise CannotRunError(f"gimbal {found[0][0].number} does not tell where it looks: {found[0][0].note}")
    return telling


def _tells(flight: Flight, gimbal: Gimbal) -> bool:
    """Returns whether a gimbal with a note says where it looks."""
    end_s = flight.now_s() + REPORT_S

    def tells() -> bool:
        return gimbal.status().angles is not None

    flight.wait(
        lambda sample: tells() or sample.stamp_s >= end_s, "where it looks, or the time for it", REPORT_S + 10.0
    )
    return tells()


ON_GROUND = (lists_the_gimbals, turns_a_gimbal, points_a_gimbal)
