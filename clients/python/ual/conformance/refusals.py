"""Checks of what is refused in flight. The UAV only hovers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

from ual.conformance.check import check
from ual.conformance.flight import HEIGHT_M, Flight, require
from ual.errors import GeofenceError, InvalidArgumentError, PermissionDeniedError, UnknownFrameError, WrongStateError
from ual.geometry import Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
from ual.interface import Uav
from ual.types import Capability, State

_FLYING = State.FLYING_AUTO
_NOT_FINITE = (math.nan, math.inf, -math.inf)
_IMPOSSIBLE_DISTANCE_M = 2e7
_IMPOSSIBLE_SPEED_M_S = 2e3
_OUT_OF_REACH_M = 9000.0

Refused = tuple[Callable[[], object], str]


@check(_FLYING, capabilities=(Capability.POSITION,))
def bad_poses_are_refused(flight: Flight) -> None:
    """Goals and timeouts that are not valid are refused in a waypoint, a path and a reference, and nothing moves."""
    for pose, what in _bad_poses():
        path: list[PoseStamped | Pose] = [flight.start, pose]
        for action, where in (
            (partial(flight.uav.go_to_waypoint, pose), "a waypoint"),
            (partial(flight.uav.follow_path, path), "a path"),
            (partial(flight.uav.set_pose, pose), "a reference"),
        ):
            flight.refuses(InvalidArgumentError, action, f"{where} with {what}")
    for timeout_s in (math.nan, -1.0):
        action = partial(flight.uav.go_to_waypoint, flight.goal(HEIGHT_M, 0.0), timeout_s=timeout_s)
        flight.refuses(InvalidArgumentError, action, f"a wait of {timeout_s} s")
    _require_unmoved(flight)


@check(_FLYING, capabilities=(Capability.VELOCITY,))
def bad_velocities_are_refused(flight: Flight) -> None:
    """Velocities that are not valid are refused, and nothing moves."""
    for value in (*_NOT_FINITE, _IMPOSSIBLE_SPEED_M_S):
        for twist in (Twist(Vector3(value, 0.0, 0.0)), Twist(angular=Vector3(0.0, 0.0, value))):
            flight.refuses(InvalidArgumentError, partial(flight.uav.set_velocity, twist), f"{twist}")
    unknown = TwistStamped(Twist(), "no_such_frame")
    flight.refuses(UnknownFrameError, lambda: flight.uav.set_velocity(unknown), "a velocity in an unknown frame")
    _require_unmoved(flight)


@check(_FLYING, capabilities=(Capability.GEO,))
def bad_geographic_waypoints_are_refused(flight: Flight) -> None:
    """Geographic positions that are not valid are refused, and nothing moves."""
    uav = flight.uav
    for latitude_deg, longitude_deg, altitude_m, yaw_rad in (
        (math.nan, 0.0, 2.0, None),
        (91.0, 0.0, 2.0, None),
        (0.0, 181.0, 2.0, None),
        (0.0, math.inf, 2.0, None),
        (0.0, 0.0, math.nan, None),
        (0.0, 0.0, 2.0, math.nan),
    ):
        go = partial(uav.go_to_waypoint_geo, latitude_deg, longitude_deg, altitude_m, yaw_rad=yaw_rad)
        flight.refuses(InvalidArgumentError, go, f"{latitude_deg} {longitude_deg} {altitude_m} {yaw_rad}")
    _require_unmoved(flight)


@check(_FLYING, capabilities=(Capability.POSITION,))
def bad_paths_are_refused(flight: Flight) -> None:
    """A path without waypoints, and corner radii that are not valid, are refused."""
    uav = flight.uav
    flight.refuses(InvalidArgumentError, lambda: uav.follow_path([]), "a path without waypoints")
    for radius_m in (*_NOT_FINITE, -1.0):
        follow = partial(uav.follow_path, [flight.start], corner_radius_m=radius_m)
        flight.refuses(InvalidArgumentError, follow, f"a corner radius of {radius_m}")
    _require_unmoved(flight)


@check(_FLYING, capabilities=(Capability.POSITION,))
def a_goal_below_the_ground_is_refused(flight: Flight) -> None:
    """Goals far below the ground and far above the ceiling are refused (fails where the configuration lifts these)."""
    p = flight.start.position
    for z, where in ((p.z - _OUT_OF_REACH_M, "below the ground"), (p.z + _OUT_OF_REACH_M, "above the ceiling")):
        goal = Pose.at(p.x, p.y, z)
        plan = flight.uav.dry_run  # a real UAV must not move, whatever its configuration
        for action, what in (
            (partial(plan.go_to_waypoint, goal), "a waypoint"),
            (partial(plan.follow_path, [flight.start, goal]), "a path"),
            (partial(plan.set_pose, goal), "a reference"),
        ):
            flight.refuses(GeofenceError, action, f"{what} {where}")
    _require_unmoved(flight)


@check(_FLYING)
def ground_commands_are_refused_in_flight(flight: Flight) -> None:
    """Taking off, recovering, setting home, arming and disarming are refused in the air."""
    uav = flight.uav
    for action, what in _ground_commands(uav):
        error = flight.refuses(WrongStateError, action, f"{what} in flight")
        require(error.state == State.FLYING_AUTO.name, f"{what}: metadata says {error.state}")
        require(State.FLYING_AUTO.name in error.message, f"{what}: the message does not name the state")
    if flight.info.is_arming_allowed:
        for action, what in ((uav.arm, "arming"), (uav.disarm, "disarming")):
            flight.refuses(WrongStateError, action, f"{what} in flight")
    elif Capability.ARM in flight.info.capabilities:
        flight.refuses(PermissionDeniedError, uav.disarm, "disarming in flight")
    _require_unmoved(flight)


def _ground_commands(uav: Uav) -> tuple[Refused, ...]:
    return (
        (lambda: uav.take_off(HEIGHT_M), "a take-off"),
        (uav.recover_from_manual, "recovering"),
        (uav.set_home, "setting home"),
    )


def _bad_poses() -> Iterator[tuple[PoseStamped, str]]:
    for value in (*_NOT_FINITE, _IMPOSSIBLE_DISTANCE_M):
        yield PoseStamped(Pose.at(value, 0.0, HEIGHT_M)), f"x = {value}"
        yield PoseStamped(Pose.at(0.0, 0.0, value)), f"z = {value}"
    for orientation in (
        Quaternion(0.0, 0.0, math.nan, 1.0),
        Quaternion(0.0, 0.0, 0.0, 2.0),
        Quaternion(0.0, 0.0, 5e-324, 0.0),
    ):
        yield PoseStamped(Pose(Vector3(0.0, 0.0, HEIGHT_M), orientation)), f"the orientation {orientation}"
    yield PoseStamped(Pose.at(0.0, 0.0, HEIGHT_M), "no_such_frame"), "an unknown frame"


def _require_unmoved(flight: Flight) -> None:
    require(flight.uav.state() is State.FLYING_AUTO, "the state changed")
    require(flight.uav.is_idle(), "a task runs")
    flight.require_holds(flight.start.position, "after the refusals")


CHECKS = (
    bad_poses_are_refused,
    bad_velocities_are_refused,
    bad_geographic_waypoints_are_refused,
    bad_paths_are_refused,
    a_goal_below_the_ground_is_refused,
    ground_commands_are_refused_in_flight,
)
