"""Checks of waypoints and paths."""

from __future__ import annotations

import math

from ual.conformance.check import check
from ual.conformance.flight import Flight, position, require, speed, yaw_rad
from ual.geometry import Pose, PoseStamped, Vector3, wrap_angle
from ual.types import AltitudeReference, Capability, GeoPoint, State, TaskStatus

_POSITION = (Capability.POSITION,)
_FLYING = State.FLYING_AUTO
# The length of a degree of latitude, exact enough for a few metres.
_DEGREE_M = 111_320.0


@check(_FLYING, capabilities=_POSITION, moves="5 m aside, 1 m up, a quarter turn")
def goes_straight_to_a_waypoint(flight: Flight) -> None:
    """It flies to a waypoint on a straight line without overshoot, and turns meanwhile."""
    goal = flight.goal(4.0, -3.0, 1.0, math.pi / 2)
    start = flight.position()
    with flight.recording() as recorded:
        task = flight.uav.go_to_waypoint(goal)
        flight.let_pass(1.0)
        flight.require_straight(recorded(), start, goal.position)
    require(task.info().status is TaskStatus.SUCCEEDED, f"the task is {task.info().status.name}")
    flight.require_heading(goal, "at the waypoint")
    require(flight.uav.is_idle(), "a task still runs")
    flight.require_holds(goal.position, "after the waypoint")


@check(_FLYING, capabilities=_POSITION, moves="2 m aside")
def keeps_the_heading(flight: Flight) -> None:
    """A waypoint without orientation keeps the heading."""
    goal = flight.goal(0.0, 2.0)
    before_rad = yaw_rad(flight.uav.telemetry())
    with flight.recording() as recorded:
        p = goal.position
        flight.uav.go_to_waypoint(Pose.at(p.x, p.y, p.z))
        turned_rad = max(abs(wrap_angle(yaw_rad(sample) - before_rad)) for sample in recorded())
    flight.require_at(goal, "at the waypoint")
    require(turned_rad <= flight.tolerances.heading_rad, f"it turned by {math.degrees(turned_rad):.0f}°")


@check(_FLYING, capabilities=_POSITION, moves="a turn")
def turns_by_the_smaller_angle(flight: Flight) -> None:
    """It turns by the smaller angle: from 160° to -160° it turns over 180°, not over 0°."""
    p = flight.start.position
    to_left, to_right = math.radians(160.0), math.radians(-160.0)
    flight.uav.go_to_waypoint(Pose.at(p.x, p.y, p.z, to_left))
    with flight.recording() as recorded:
        flight.uav.go_to_waypoint(Pose.at(p.x, p.y, p.z, to_right))
        samples = recorded()
    widest_rad = max(abs(wrap_angle(yaw_rad(sample) - math.pi)) for sample in samples)
    allowed_rad = math.radians(20.0) + 2 * flight.tolerances.heading_rad
    require(widest_rad <= allowed_rad, f"its heading was {math.degrees(widest_rad):.0f}° from 180°")
    flight.require_at(Pose.at(p.x, p.y, p.z, to_right), "after the turn")


@check(_FLYING, capabilities=_POSITION, moves="2 m aside")
def goes_to_a_waypoint_in_map(flight: Flight) -> None:
    """A waypoint in map is the same position as its transform to odom."""
    goal = flight.goal(2.0, 0.0)
    in_map = flight.uav.transform("map", f"{flight.uav.ns}/odom").apply_pose(goal)
    flight.uav.go_to_waypoint(PoseStamped(in_map, "map"))
    flight.require_at(goal, "at the waypoint")


@check(_FLYING, capabilities=_POSITION, moves="2 m ahead, a turn")
def goes_to_a_waypoint_ahead(flight: Flight) -> None:
    """A waypoint in the body's frame is relative to the pose of the body at the time of the command."""
    body = f"{flight.uav.ns}/base_link"
    turned = flight.goal(0.0, 0.0, 0.0, math.pi / 2)
    flight.uav.go_to_waypoint(turned)
    here = flight.position()
    flight.uav.go_to_waypoint(PoseStamped(Pose.at(2.0, 0.0, 0.0, 0.0), body))
    ahead = turned.orientation.rotate(Vector3(2.0, 0.0, 0.0))
    flight.require_at(Pose(here + ahead, turned.orientation), "ahead")


@check(_FLYING, capabilities=(Capability.GEO,), moves="2 m to the north")
def goes_to_a_geographic_waypoint(flight: Flight) -> None:
    """It flies to a geographic waypoint, whatever the altitude is measured from."""
    references = tuple(_altitudes(_position_on_earth(flight)))
    require(bool(references), "the telemetry has no altitude")
    in_map = flight.uav.transform("map", f"{flight.uav.ns}/odom")
    north = in_map.rotation.inverse().rotate(Vector3(0.0, 2.0, 0.0))
    for reference in references:
        flight.return_to_start()
        # Read each time: autopilots correct their home and their geographic position in flight.
        here, start = _position_on_earth(flight), flight.position()
        north_deg, altitude_m = here.latitude_deg + 2.0 / _DEGREE_M, _altitudes(here).get(reference)
        require(altitude_m is not None, f"the altitude above {reference.name} is not known any more")
        assert altitude_m is not None
        flight.uav.go_to_waypoint_geo(north_deg, here.longitude_deg, altitude_m, reference)
        off_m = (flight.position() - start - north).norm()
        require(off_m <= 2 * flight.tolerances.position_m, f"{reference.name}: {off_m:.2f} m from the goal")


@check(_FLYING, capabilities=_POSITION, moves="along a square of 2 m")
def stops_at_each_waypoint_of_a_path(flight: Flight) -> None:
    """Without a corner radius it flies straight from each waypoint to the next and stops at each."""
    corners = [flight.goal(*offset) for offset in ((2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0))]
    with flight.recording() as recorded:
        task = flight.uav.follow_path(corners)
        samples = recorded()
    require(task.info().status is TaskStatus.SUCCEEDED, f"the task is {task.info().status.name}")
    t = flight.tolerances
    for corner in corners[:-1]:
        near = [sample for sample in samples if (position(sample) - corner.position).norm() <= t.position_m]
        require(bool(near), "it did not reach a waypoint")
        # A stop is short. If samples were missed (on a busy computer), the stop may be missing from them.
        if not any(sample.missed_count for sample in near):
            require(min(map(speed, near)) <= t.speed_m_s, "it did not stop at a waypoint")
    flight.require_at(corners[-1], "at the end of the path")


@check(_FLYING, capabilities=_POSITION, moves="around a corner of 2.5 m")
def rounds_the_corners_of_a_path(flight: Flight) -> None:
    """With a corner radius it passes near the corner without a stop, and not beyond it."""
    corner, end = flight.goal(2.5, 0.0), flight.goal(2.5, 2.5)
    radius_m = 1.0
    with flight.recording() as recorded:
        flight.uav.follow_path([corner, end], corner_radius_m=radius_m)
        samples = recorded()
    near = [sample for sample in samples if (position(sample) - corner.position).norm() <= 2 * radius_m / 3]
    nearest_m = min((position(sample) - corner.position).norm() for sample in samples)
    require(nearest_m <= radius_m + flight.tolerances.position_m, f"it cut the corner by {nearest_m:.2f} m")
    require(not near or min(map(speed, near)) > 0.05, "it stopped at the corner")
    beyond_m = max(position(sample).x for sample in samples) - corner.position.x
    require(beyond_m <= flight.tolerances.drift_m, f"it went {beyond_m:.2f} m beyond the corner")
    flight.require_at(end, "at the end of the path")


@check(_FLYING, capabilities=_POSITION, moves="1 m aside")
def holds_a_pose_reference(flight: Flight) -> None:
    """A pose reference returns at once, is what reference_pose returns, and is flown to and held."""
    goal = flight.goal(1.0, 0.0)
    flight.uav.set_pose(goal)
    flight.wait_until_rests_at(goal.position, "rest at the reference")
    require(flight.uav.is_idle(), "a pose reference is no task")
    reference = flight.uav.reference_pose()
    require(reference is not None, "reference_pose() is None")
    assert reference is not None
    if reference.frame_id == f"{flight.uav.ns}/odom":
        off_m = (reference.pose.position - goal.position).norm()
        require(off_m <= 0.01, f"reference_pose() is {off_m:.2f} m from the reference that was set")
    flight.require_holds(goal.position, "at the reference")


def _position_on_earth(flight: Flight) -> GeoPoint:
    here = flight.uav.telemetry().position_geo
    require(here is not None, "the telemetry has no geographic position")
    assert here is not None
    return here


def _altitudes(here: GeoPoint) -> dict[AltitudeReference, float]:
    known = {
        AltitudeReference.HOME: here.altitude_home_m,
        AltitudeReference.AMSL: here.altitude_amsl_m,
        AltitudeReference.ELLIPSOID: here.altitude_ellipsoid_m,
    }
    return {reference: altitude_m for reference, altitude_m in known.items() if altitude_m is not None}


CHECKS = (
    goes_straight_to_a_waypoint,
    keeps_the_heading,
    turns_by_the_smaller_angle,
    goes_to_a_waypoint_in_map,
    goes_to_a_waypoint_ahead,
    goes_to_a_geographic_waypoint,
    stops_at_each_waypoint_of_a_path,
    rounds_the_corners_of_a_path,
    holds_a_pose_reference,
)
