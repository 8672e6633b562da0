"""Hypothesis strategies for the value types."""

from __future__ import annotations

from hypothesis import strategies as st

from ual import errors, types
from ual.geometry import Pose, PoseStamped, Quaternion, Transform, Twist, TwistStamped, Vector3
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    FailsafeTriggered,
    LinkLost,
    MotorsWeak,
    PositionLost,
)

numbers = st.floats(allow_nan=False)
coordinates = st.floats(-1e7, 1e7)
frame_ids = st.text("abcdefghij_/0123456789", max_size=20)
texts = st.text(st.characters(codec="utf-8"), max_size=40)
# What a wall clock gives: whole microseconds from 1970 to 2100.
stamps = st.integers(0, 4_102_444_800_000_000).map(lambda micros: micros / 1e6)
durations = st.integers(0, 10**12).map(lambda micros: micros / 1e6)

vectors = st.builds(Vector3, numbers, numbers, numbers)
quaternions = st.builds(Quaternion, numbers, numbers, numbers, numbers)
poses = st.builds(Pose, vectors, quaternions)
twists = st.builds(Twist, vectors, vectors)
pose_goals = st.builds(PoseStamped, poses, frame_ids)
velocities = st.builds(TwistStamped, twists, frame_ids)
transforms = st.builds(Transform, vectors, quaternions, frame_ids, frame_ids, stamps)

yaws = st.floats(-3.1, 3.1)
pitches = st.floats(-1.5, 1.5)
rotations = st.builds(Quaternion.from_euler, yaws, pitches, yaws)
places = st.builds(Vector3, coordinates, coordinates, coordinates)
rigid_transforms = st.builds(Transform, places, rotations)


def error_equal(a: errors.UalError | None, b: errors.UalError | None) -> bool:
    if a is None or b is None:
        return a is b
    return type(a) is type(b) and a.message == b.message and dict(a.metadata) == dict(b.metadata)


ual_errors = st.builds(
    errors.from_reason,
    st.sampled_from(["WRONG_STATE", "TASK_ABORTED", "TIMEOUT", "LINK_LOST", "REJECTED_BY_AUTOPILOT"]),
    texts,
    st.dictionaries(st.sampled_from(["state", "by", "needed"]), texts),
)
task_infos = st.builds(
    types.TaskInfo,
    id=texts,
    kind=st.sampled_from(types.TaskKind),
    status=st.sampled_from(types.TaskStatus),
    progress=st.none() | numbers,
    distance_left_m=st.none() | numbers,
    elapsed_s=durations,
    waypoint_index=st.none() | st.integers(0, 2**32 - 1),
    error=st.none(),
    description=texts,
    is_paused=st.booleans(),
)
plans = st.builds(types.Plan, st.none() | numbers, st.none() | durations)
geo_points = st.builds(types.GeoPoint, numbers, numbers, st.none() | numbers, st.none() | numbers, st.none() | numbers)
batteries = st.builds(
    types.Battery,
    st.none() | numbers,
    st.none() | numbers,
    st.none() | numbers,
    st.integers(0, 255),
    st.sampled_from(["", "all", "payload"]),
)
healths = st.builds(
    types.Health,
    is_ready_to_arm=st.none() | st.booleans(),
    failing_checks=st.lists(texts, max_size=3).map(tuple),
    link_quality=st.none() | numbers,
    failsafe=texts,
    held_by=texts,
)
gps_infos = st.builds(
    types.GpsInfo,
    st.sampled_from(types.GpsFix),
    st.none() | st.integers(1, 99),
    st.none() | numbers,
    st.none() | numbers,
    st.none() | numbers,
    st.none() | numbers,
)
odometries = st.builds(types.Odometry, poses, twists, frame_ids, frame_ids, stamps)
telemetries = st.builds(
    types.Telemetry,
    state=st.sampled_from(types.State),
    state_reason=texts,
    stamp_s=stamps,
    frame_id=frame_ids,
    pose=st.none() | poses,
    velocity=st.none() | twists,
    odometry=st.none() | odometries,
    transform=st.none() | transforms,
    reference_pose=st.none() | poses,
    position_geo=st.none() | geo_points,
    battery=st.none() | batteries,
    batteries=st.lists(batteries, max_size=3).map(tuple),
    gps=st.none() | gps_infos,
    flight_mode=texts,
    armed=st.booleans(),
    task=st.none() | task_infos,
    sequence=st.integers(0, 2**64 - 1),
    status_text=texts,
    frame_lost=texts,
    missed_count=st.integers(0, 2**64 - 1),
    health=st.none() | healths,
)
frames = st.builds(types.Frame, frame_ids, frame_ids, st.none() | transforms, st.booleans())
infos = st.builds(
    types.Info,
    namespace=texts,
    backend=texts,
    autopilot=texts,
    autopilot_version=texts,
    is_simulation=st.booleans(),
    capabilities=st.frozensets(st.sampled_from(types.Capability)),
    limits=st.builds(types.Limits, numbers, numbers, numbers, numbers, numbers, numbers),
    ual_version=texts,
    is_arming_allowed=st.booleans(),
    url=texts,
)
commands = st.sampled_from(Command)
faults = st.one_of(
    st.just(LinkLost()),
    st.just(PositionLost()),
    st.builds(EstimatorJumps, vectors, numbers),
    st.builds(MotorsWeak, numbers),
    st.builds(BatteryLow, numbers),
    st.builds(CommandRefused, commands, texts),
    st.builds(AckLost, commands),
    st.builds(AckLate, commands, numbers),
    st.builds(FailsafeTriggered, texts),
)
