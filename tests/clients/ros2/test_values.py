"""ROS messages become values of UAL, and values messages; numbers pass as they are."""

from __future__ import annotations

import math
from fractions import Fraction
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import ual
from tests.clients.ros2 import messages
from ual_ros2 import values

numbers = st.floats(width=64)  # whatever ROS can send: the daemon says what is wrong
vectors = st.builds(ual.Vector3, numbers, numbers, numbers)
quaternions = st.builds(ual.Quaternion, numbers, numbers, numbers, numbers)
poses = st.builds(ual.Pose, vectors, quaternions)
twists = st.builds(ual.Twist, vectors, vectors)
names = st.text(max_size=8)


def same(one: object, other: object) -> bool:
    """Returns whether two values are the same, with NaN as NaN and -0 as -0."""
    return repr(one) == repr(other)


@given(poses, names)
def test_a_pose_comes_back_as_it_went(pose: ual.Pose, frame_id: str) -> None:
    message = SimpleNamespace(header=messages.header(frame_id), pose=messages.pose())
    values.fill_pose(message.pose, pose)
    assert same(values.pose_stamped(message), ual.PoseStamped(pose, frame_id))


@given(twists, names)
def test_a_velocity_comes_back_as_it_went(twist: ual.Twist, frame_id: str) -> None:
    message = SimpleNamespace(header=messages.header(frame_id), twist=messages.twist())
    values.fill_twist(message.twist, twist)
    assert same(values.twist_stamped(message), ual.TwistStamped(twist, frame_id))


@given(vectors, quaternions, names, names)
def test_a_transform_comes_back_as_it_went(where: ual.Vector3, turned: ual.Quaternion, frame: str, child: str) -> None:
    link = ual.Transform(where, turned, frame, child)
    message = messages.transform_stamped()
    values.fill_transform(message, link)
    assert same(values.transform_stamped(message), link)


@given(poses, names)
def test_a_pose_from_outside_comes_back_as_it_went(pose: ual.Pose, frame_id: str) -> None:
    message = SimpleNamespace(header=messages.header(frame_id), pose=messages.pose())
    values.fill_pose(message.pose, pose)
    told = ual.PoseStamped(pose, frame_id, 5.0)
    assert same(values.external_pose(message, 5.0), ual.types.ExternalPose(told))
    measured = SimpleNamespace(pose=message.pose, covariance=[0.0] * 36)
    covered = SimpleNamespace(header=message.header, pose=measured)
    assert same(values.external_pose_with_covariance(covered, 5.0), ual.types.ExternalPose(told))


@pytest.mark.parametrize(
    ("variances", "position_m", "orientation_rad"),
    [
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), None, None),
        ((0.04, 0.01, 0.09, 0.0, 0.0, 0.0), 0.3, None),
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0025), None, 0.05),
        ((0.01, -0.01, 0.01, math.nan, 0.01, 0.01), math.nan, math.nan),
        ((math.inf, 0.01, 0.01, -1.0, 0.0, 0.0), math.nan, math.nan),
    ],
)
def test_a_covariance_gives_the_largest_standard_deviation(
    variances: tuple[float, ...], position_m: float | None, orientation_rad: float | None
) -> None:
    covariance = [7.0] * 36  # what is beside the diagonal is not read
    covariance[::7] = variances
    found = values.standard_deviation(covariance, 0), values.standard_deviation(covariance, 3)
    assert found == pytest.approx((position_m, orientation_rad), nan_ok=True)


@given(st.floats(0.0, 2.0**31 - 1.0))
def test_a_time_is_split_exactly(time_s: float) -> None:
    seconds, nanoseconds = values.split(time_s)
    assert 0 <= nanoseconds < values.NANO
    assert abs(seconds + Fraction(nanoseconds, values.NANO) - Fraction(time_s)) <= Fraction(1, 10**6)


def test_a_time_that_rounds_up_to_a_second_is_one() -> None:
    assert values.split(math.nextafter(5.0, 0.0)) == (5, 0)


def test_the_states_have_the_numbers_of_the_first_ual() -> None:
    assert [values.STATE_NUMBERS[state] for state in ual.State] == [0, 1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(
    ("number", "reference"),
    [
        (0, ual.AltitudeReference.HOME),
        (1, ual.AltitudeReference.HOME),
        (2, ual.AltitudeReference.AMSL),
        (3, ual.AltitudeReference.ELLIPSOID),
    ],
)
def test_what_an_altitude_is_above(number: int, reference: ual.AltitudeReference) -> None:
    assert values.altitude_reference(number) is reference


def test_a_number_that_is_no_constant_is_refused_by_its_field() -> None:
    with pytest.raises(ual.InvalidArgumentError, match="altitude_reference: 4 is none") as refused:
        values.altitude_reference(4)
    assert refused.value.metadata["field"] == "altitude_reference"
    with pytest.raises(ual.InvalidArgumentError, match="heading: 255 is none"):
        values.path_heading(255)
    assert values.path_heading(0) is ual.PathHeading.WAYPOINTS


def test_a_battery_discharges_with_a_negative_current() -> None:
    message = SimpleNamespace()
    values.fill_battery(message, ual.Battery(remaining_percent=50.0, voltage_v=15.2, current_a=3.0))
    assert (message.percentage, message.voltage, message.current) == (0.5, 15.2, -3.0)
    assert message.power_supply_status == values.DISCHARGING
    values.fill_battery(message, ual.Battery())
    assert all(math.isnan(number) for number in (message.percentage, message.voltage, message.current))
    assert message.power_supply_status == values.POWER_STATUS_UNKNOWN


def test_a_fix_has_the_altitude_over_the_ellipsoid_and_its_accuracy() -> None:
    message = SimpleNamespace(status=SimpleNamespace())
    position = ual.GeoPoint(37.0, -6.0, altitude_amsl_m=50.0, altitude_ellipsoid_m=98.0)
    values.fill_fix(message, position, ual.GpsInfo(ual.GpsFix.RTK_FIXED, 20, 0.5, 2.0))
    assert (message.latitude, message.longitude, message.altitude) == (37.0, -6.0, 98.0)
    assert message.status.status == values.GROUND_FIX
    assert message.position_covariance == [0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 4.0]
    assert message.position_covariance_type == values.COVARIANCE_DIAGONAL_KNOWN
    values.fill_fix(message, ual.GeoPoint(37.0, -6.0, altitude_amsl_m=50.0), None)
    assert math.isnan(message.altitude)
    assert message.status.status == values.NO_FIX
    assert message.position_covariance_type == values.COVARIANCE_UNKNOWN


def test_feedback_has_nan_for_what_is_not_known() -> None:
    message = SimpleNamespace(waypoint_index=7)
    task = ual.TaskInfo("a", ual.TaskKind.FOLLOW_PATH, ual.TaskStatus.RUNNING, distance_left_m=4.0, is_paused=True)
    values.fill_feedback(message, ual.Telemetry(ual.State.FLYING_AUTO, "in the air"), task)
    assert (message.distance_left, message.state, message.reason, message.is_paused) == (4.0, 4, "in the air", True)
    assert math.isnan(message.progress)
    assert message.waypoint_index == -1
