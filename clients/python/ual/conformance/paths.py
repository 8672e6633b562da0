"""Checks of how a waypoint or path is flown: how fast, and where the nose points."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from ual.conformance.check import check
from ual.conformance.flight import Flight, position, require, yaw_rad
from ual.geometry import Pose, Vector3, wrap_angle
from ual.types import Capability, PathHeading, State, Telemetry

_POSITION = (Capability.POSITION,)
_FLYING = State.FLYING_AUTO
_SLOW_SPEED_M_S = 0.5
_LEG_M = 2.5
_LEGS_COUNT = 4
_SAMPLE_S = 0.5
_SPEED_OVER_S = 1.0


@check(_FLYING, capabilities=_POSITION, moves="2.5 m aside, slowly, and back")
def keeps_below_a_speed(flight: Flight) -> None:
    """A waypoint, a path and a leg are flown no faster than their speed limits."""
    uav, away, back = flight.uav, flight.goal(_LEG_M, 0.0), flight.start
    plan = uav.dry_run.go_to_waypoint(away, max_speed_m_s=_SLOW_SPEED_M_S)
    require(plan.duration_s is not None and plan.length_m is not None, "the plan has no length or no duration")
    assert plan.duration_s is not None
    assert plan.length_m is not None
    least_s = plan.length_m / _SLOW_SPEED_M_S
    require(plan.duration_s >= least_s, f"{plan.duration_s:.1f} s planned, but it takes at least {least_s:.1f} s")
    with flight.recording() as recorded:
        uav.go_to_waypoint(away, max_speed_m_s=_SLOW_SPEED_M_S)
        uav.follow_path([back], max_speed_m_s=_SLOW_SPEED_M_S)
        uav.follow_path([away, back], leg_speeds_m_s=[_SLOW_SPEED_M_S, _SLOW_SPEED_M_S])
        samples = recorded()
    fastest_m_s, allowed_m_s = _fastest_m_s(samples), _SLOW_SPEED_M_S + flight.tolerances.speed_m_s
    require(fastest_m_s <= allowed_m_s, f"it flew {fastest_m_s:.2f} m/s, the limit was {_SLOW_SPEED_M_S:g}")
    took_s, least_s = samples[-1].stamp_s - samples[0].stamp_s, _LEGS_COUNT * _LEG_M / _SLOW_SPEED_M_S
    require(took_s >= least_s - _SAMPLE_S, f"it took {took_s:.1f} s, but must take at least {least_s:.1f} s")
    flight.require_at(back, "at the end")


def _fastest_m_s(samples: Sequence[Telemetry]) -> float:
    """Returns the highest mean speed over a second, by the positions.

    An estimate of the velocity may be wrong for some seconds, and by more than the limit that is checked. PX4's was off
    by 0.4 to 0.8 m/s in its simulator (docs/reference/backends/mavros.md).
    """
    fastest_m_s, begins = 0.0, iter(samples)
    begin = next(begins)
    for end in samples:
        while end.stamp_s - begin.stamp_s >= _SPEED_OVER_S:
            distance_m = (position(end) - position(begin)).norm()
            fastest_m_s = max(fastest_m_s, distance_m / (end.stamp_s - begin.stamp_s))
            begin = next(begins)
    return fastest_m_s


@check(_FLYING, capabilities=_POSITION, moves="along two sides of a square of 2.5 m, turning")
def points_along_a_path(flight: Flight) -> None:
    """The nose points along each leg, whatever the headings of the waypoints are."""
    start, corner, end = flight.start, flight.goal(_LEG_M, 0.0), flight.goal(_LEG_M, _LEG_M)
    with flight.recording() as recorded:
        flight.uav.follow_path([corner, end], heading=PathHeading.ALONG_PATH, max_speed_m_s=_SLOW_SPEED_M_S)
        samples = recorded()
    for begin, goal in ((start, corner), (corner, end)):
        along_rad = _towards(begin.position, goal.position)
        _require_heading(flight, _between(samples, begin, goal), partial(_same, along_rad), "along the path")
    p = end.position
    flight.require_at(Pose.at(p.x, p.y, p.z, _towards(corner.position, p)), "at the end of the path")


@check(_FLYING, capabilities=_POSITION, moves="2.5 m aside, turning")
def points_at_a_point_of_interest(flight: Flight) -> None:
    """The nose points at a point beside the path all the time."""
    start, goal = flight.start, flight.goal(0.0, _LEG_M)
    interest = flight.goal(4.0, _LEG_M / 2).position
    p, s = goal.position, start.position
    flight.uav.go_to_waypoint(Pose.at(s.x, s.y, s.z, _towards(s, interest)))  # a turn may take longer than the leg
    with flight.recording() as recorded:
        flight.uav.follow_path(
            [Pose.at(p.x, p.y, p.z)],
            max_speed_m_s=_SLOW_SPEED_M_S,
            heading=PathHeading.POINT_OF_INTEREST,
            point_of_interest=interest,
        )
        samples = recorded()
    _require_heading(flight, _between(samples, start, goal), lambda place: _towards(place, interest), "at the point")
    flight.require_at(Pose.at(p.x, p.y, p.z, _towards(p, interest)), "at the end of the path")


@check(_FLYING, capabilities=_POSITION, moves="2.5 m aside")
def keeps_a_fixed_heading(flight: Flight) -> None:
    """A path with a fixed heading keeps the present heading, whatever the headings of the waypoints are."""
    goal = flight.goal(0.0, -_LEG_M, 0.0, math.pi / 2)
    before_rad = yaw_rad(flight.uav.telemetry())
    with flight.recording() as recorded:
        flight.uav.follow_path([goal], heading=PathHeading.FIXED)
        turned_rad = max(abs(wrap_angle(yaw_rad(sample) - before_rad)) for sample in recorded())
    require(turned_rad <= flight.tolerances.heading_rad, f"it turned by {math.degrees(turned_rad):.0f}°")


def _between(samples: Iterable[Telemetry], begin: Pose, goal: Pose) -> list[Telemetry]:
    """Returns the samples from 0.5 to 0.8 of a leg: by then it has turned, but not yet for the next leg."""
    leg = goal.position - begin.position
    length_m = leg.norm()
    found = []
    for sample in samples:
        offset = position(sample) - begin.position
        along_m = offset.dot(leg) / length_m
        aside_m = (offset - leg * (along_m / length_m)).norm()
        if 0.5 * length_m <= along_m <= 0.8 * length_m and aside_m <= 0.3 * length_m:
            found.append(sample)
    return found


def _require_heading(flight: Flight, samples: list[Telemetry], wanted: Callable[[Vector3], float], what: str) -> None:
    require(bool(samples), "there is no sample on the leg")
    off_rad = max(abs(wrap_angle(yaw_rad(sample) - wanted(position(sample)))) for sample in samples)
    allowed_rad = 2 * flight.tolerances.heading_rad
    require(off_rad <= allowed_rad, f"the nose was {math.degrees(off_rad):.0f}° from pointing {what}")


def _same(heading_rad: float, _: Vector3) -> float:
    return heading_rad


def _towards(place: Vector3, target: Vector3) -> float:
    offset = target - place
    return math.atan2(offset.y, offset.x)


CHECKS = (keeps_below_a_speed, points_along_a_path, points_at_a_point_of_interest, keeps_a_fixed_heading)
