"""Checks of what a UAV reports. Nothing moves."""

from __future__ import annotations

import itertools
import math
from dataclasses import astuple
from functools import partial

from ual.conformance.check import READY, check
from ual.conformance.flight import Flight, require
from ual.errors import InvalidArgumentError, UnknownFrameError
from ual.geometry import IDENTITY, Quaternion, Transform, Vector3, wrap_angle
from ual.types import State, Telemetry

_ROUNDING_M = 1e-6
_SAMPLES = 10


@check()
def says_who_it_is(flight: Flight) -> None:
    """Info contains the namespace, the backend, the capabilities and the limits."""
    info = flight.info
    require(info.namespace == flight.uav.ns, f"info has the namespace {info.namespace}, ns is {flight.uav.ns}")
    require(bool(info.backend), "info has no backend")
    require(bool(info.ual_version), "info has no version")
    require(bool(info.capabilities), "info has no capabilities")
    for limit in astuple(info.limits):
        require(math.isfinite(limit) and limit > 0.0, f"a limit is {limit}")


@check()
def becomes_ready(flight: Flight) -> None:
    """The state becomes other than UNINITIALIZED, and has a reason."""
    sample = flight.wait(lambda each: each.state is not State.UNINITIALIZED, "ready", 60.0)
    require(bool(sample.state_reason), "the state has no reason")
    require(flight.uav.is_ready(), "is_ready() is False")
    require(bool(sample.flight_mode), "the flight mode has no name")


@check(*READY)
def telemetry_agrees_with_itself(flight: Flight) -> None:
    """Pose, velocity, odometry and transform of one sample agree."""
    for sample in flight.let_pass(0.5):
        _require_consistent(flight, sample)


@check(*READY)
def telemetry_flows(flight: Flight) -> None:
    """A subscription gets samples with rising numbers and times, and none after it has ended."""
    received: list[Telemetry] = []
    with flight.uav.subscribe(received.append):
        flight.wait(lambda _: len(received) >= _SAMPLES, f"{_SAMPLES} samples of a second subscription", 60.0)
    count = len(received)
    for before, after in itertools.pairwise(received):
        require(after.sequence > before.sequence, "the sequence does not rise")
        require(after.stamp_s >= before.stamp_s, "the stamps go back")
    flight.let_pass(0.2)
    require(len(received) == count, "an ended subscription went on")


@check(*READY)
def a_slow_rate_leaves_out_samples(flight: Flight) -> None:
    """A subscription with a low rate gets only some of the samples."""
    received: list[Telemetry] = []
    with flight.uav.subscribe(received.append, rate_hz=1.0), flight.recording() as recorded:
        flight.wait(lambda _: len(received) >= 2, "two samples", 600.0)
        every = len(recorded())
    require(every > len(received), f"{len(received)} samples of {every} came at 1 Hz")


@check(*READY)
def members_agree_with_telemetry(flight: Flight) -> None:
    """State, pose, velocity and odometry are the same as in the telemetry."""
    uav, t = flight.uav, flight.tolerances
    sample = uav.telemetry()
    require(uav.state() is sample.state, "state() differs")
    require(uav.is_idle() is (sample.task is None), "is_idle() differs")
    pose, velocity, odometry = uav.pose(), uav.velocity(), uav.odometry()
    assert sample.pose is not None
    assert sample.velocity is not None
    require((pose.pose.position - sample.pose.position).norm() <= t.position_m, "pose() differs")
    require(pose.frame_id == velocity.frame_id == sample.frame_id, "the frames differ")
    require((velocity.twist.linear - sample.velocity.linear).norm() <= t.speed_m_s, "velocity() differs")
    require(odometry.stamp_s >= sample.stamp_s, "odometry() is older than the telemetry before it")


@check(*READY)
def frames_form_a_tree(flight: Flight) -> None:
    """`map` is the root, the UAV's odom and base_link hang from it, and every parent exists."""
    frames = {frame.frame_id: frame for frame in flight.uav.frames()}
    odom, body = f"{flight.uav.ns}/odom", f"{flight.uav.ns}/base_link"
    for name in ("map", odom, body):
        require(name in frames, f"there is no frame {name}")
    require(not frames["map"].parent_frame_id, "map has a parent")
    require(frames[odom].parent_frame_id == "map" and frames[odom].is_static, f"{odom} is not fixed in map")
    require(frames[body].parent_frame_id == odom and not frames[body].is_static, f"{body} does not move in {odom}")
    for frame in frames.values():
        require(not frame.parent_frame_id or frame.parent_frame_id in frames, f"the parent of {frame.frame_id} is lost")


@check(*READY)
def the_geofence_is_reported(flight: Flight) -> None:
    """The geofence is reported in `map`, and makes sense."""
    fence = flight.uav.geofence()
    require(fence.frame_id == "map", f"the geofence is in {fence.frame_id}")
    require(len(fence.corners) not in (1, 2), "the geofence has a polygon without an area")
    if fence.min_z_m is not None and fence.max_z_m is not None:
        require(fence.min_z_m < fence.max_z_m, "the top of the geofence is not above its bottom")


@check(*READY)
def a_new_frame_can_be_used(flight: Flight) -> None:
    """A frame that was added is there, transforms go both ways, and it can be moved."""
    uav, name = flight.uav, f"{flight.uav.ns}/check"
    for x in (1.0, 2.0):
        added = Transform(Vector3(x, 2.0, 3.0), Quaternion.from_yaw(0.5), "map", name)
        uav.add_frame(added)
        require(any(frame.frame_id == name for frame in uav.frames()), f"{name} is not listed")
        there, back = uav.transform("map", name), uav.transform(name, "map")
        require((there.frame_id, there.child_frame_id) == ("map", name), "the transform names other frames")
        require((there.translation - added.translation).norm() <= _ROUNDING_M, "the transform is another")
        require(abs(wrap_angle(there.rotation.yaw_rad - 0.5)) <= _ROUNDING_M, "the rotation is another")
        point = Vector3(4.0, 5.0, 6.0)
        require((back.apply(there.apply(point)) - point).norm() <= _ROUNDING_M, "there and back is not the same")
    flight.refuses(InvalidArgumentError, lambda: uav.remove_frame(f"{uav.ns}/odom"), "removing a built-in frame")
    uav.remove_frame(name)
    require(all(frame.frame_id != name for frame in uav.frames()), f"{name} is still listed")
    flight.refuses(UnknownFrameError, lambda: uav.remove_frame(name), "removing a frame twice")


@check(*READY)
def bad_frames_are_refused(flight: Flight) -> None:
    """Unknown frames, reserved names, loops and values that are not valid are refused."""
    uav, name = flight.uav, f"{flight.uav.ns}/check"
    nan = math.nan
    flight.refuses(UnknownFrameError, lambda: uav.transform("no_such_frame"), "an unknown target")
    flight.refuses(UnknownFrameError, lambda: uav.transform("", "no_such_frame"), "an unknown source")
    for bad, what in (
        (Transform(frame_id="no_such_frame", child_frame_id=name), "an unknown parent"),
        (Transform(child_frame_id="map"), "the name map"),
        (Transform(child_frame_id=f"{uav.ns}/base_link"), "the name of the body"),
        (Transform(child_frame_id=""), "no name"),
        (Transform(frame_id=name, child_frame_id=name), "a frame in itself"),
        (Transform(Vector3(nan, 0.0, 0.0), IDENTITY, "map", name), "a translation that is not a number"),
        (Transform(Vector3(), Quaternion(0.0, 0.0, 0.0, 3.0), "map", name), "a quaternion that is not a rotation"),
    ):
        flight.refuses(InvalidArgumentError, partial(uav.add_frame, bad), what)


@check(*READY)
def an_unknown_task_is_refused(flight: Flight) -> None:
    """The identifier of a task that never existed is refused."""
    flight.refuses(InvalidArgumentError, lambda: flight.uav.task("no-such-task"), "an unknown task")


def _require_consistent(flight: Flight, sample: Telemetry) -> None:
    ns, odometry, transform = flight.uav.ns, sample.odometry, sample.transform
    require(sample.pose is not None and sample.velocity is not None, "a sample has no pose or velocity")
    require(odometry is not None and transform is not None, "a sample has no odometry or transform")
    assert sample.pose is not None
    assert sample.velocity is not None
    assert odometry is not None
    assert transform is not None
    require((odometry.frame_id, odometry.child_frame_id) == (f"{ns}/odom", f"{ns}/base_link"), "odometry's frames")
    require((transform.frame_id, transform.child_frame_id) == ("map", f"{ns}/base_link"), "transform's frames")
    require(odometry.stamp_s == transform.stamp_s == sample.stamp_s, "the stamps differ")
    require(abs(odometry.pose.orientation.norm() - 1.0) <= _ROUNDING_M, "the orientation is not a rotation")
    if sample.frame_id == odometry.frame_id:
        require((sample.pose.position - odometry.pose.position).norm() <= _ROUNDING_M, "pose and odometry differ")
        rotated = odometry.pose.orientation.rotate(odometry.twist.linear)
        require((rotated - sample.velocity.linear).norm() <= _ROUNDING_M, "velocity and odometry differ")
    to_map = flight.uav.transform("map", odometry.frame_id)
    off_m = (to_map.apply(odometry.pose.position) - transform.translation).norm()
    require(off_m <= _ROUNDING_M, f"transform and odometry differ by {off_m:.3g} m")
    require(sample.armed is (sample.state is not State.LANDED_DISARMED), "armed and state differ")


CHECKS = (
    says_who_it_is,
    becomes_ready,
    telemetry_agrees_with_itself,
    telemetry_flows,
    a_slow_rate_leaves_out_samples,
    members_agree_with_telemetry,
    frames_form_a_tree,
    the_geofence_is_reported,
    a_new_frame_can_be_used,
    bad_frames_are_refused,
    an_unknown_task_is_refused,
)
