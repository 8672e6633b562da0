from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.strategies import ANGLES, ROTATIONS, TRANSFORMS, vectors
from ual.errors import InvalidArgumentError
from ual.geometry import IDENTITY, KEEP_HEADING, Pose, Quaternion, Transform, Vector3, wrap_angle

X, Y, Z = Vector3(1.0, 0.0, 0.0), Vector3(0.0, 1.0, 0.0), Vector3(0.0, 0.0, 1.0)
VECTORS = vectors(1e3)


def near(a: Vector3, b: Vector3, size: float = 1e3) -> bool:
    return (a - b).norm() <= 1e-12 * max(size, a.norm())


def same_rotation(a: Quaternion, b: Quaternion) -> bool:
    # A quaternion and its negative are the same rotation.
    return abs(abs(sum(p * q for p, q in zip(a, b, strict=True))) - 1.0) <= 1e-12


# --- Axes: the examples by which REP 103 is told ----------------------------------------------------------------------


def test_a_quarter_turn_to_the_left_takes_forward_to_left() -> None:
    assert near(Quaternion.from_yaw(math.pi / 2).rotate(X), Y)


def test_pitching_down_is_positive() -> None:
    assert near(Quaternion.from_euler(0.0, math.pi / 2, 0.0).rotate(X), -Z)


def test_rolling_to_the_right_is_positive() -> None:
    assert near(Quaternion.from_euler(math.pi / 2, 0.0, 0.0).rotate(Y), Z)


def test_euler_angles_turn_about_fixed_axes_roll_first() -> None:
    q = Quaternion.from_euler(math.pi / 2, 0.0, math.pi / 2)
    assert near(q.rotate(Y), Z)
    assert near(q.rotate(X), Y)


@pytest.mark.parametrize("angle_rad", [math.inf, -math.inf])
def test_an_infinite_angle_is_refused_by_its_name(angle_rad: float) -> None:
    with pytest.raises(InvalidArgumentError, match=r"yaw_rad: -?inf is not an angle"):
        Pose.at(0.0, 0.0, 0.0, angle_rad)
    with pytest.raises(InvalidArgumentError, match=r"pitch_rad: -?inf is not an angle"):
        Quaternion.from_euler(0.0, angle_rad, 0.0)


def test_the_other_rotation_comes_first_in_a_product() -> None:
    yaw, pitch = Quaternion.from_yaw(math.pi / 2), Quaternion.from_euler(0.0, math.pi / 2, 0.0)
    assert near((yaw * pitch).rotate(X), yaw.rotate(pitch.rotate(X)))


def test_all_zeros_asks_to_keep_the_heading() -> None:
    assert Pose.at(1.0, 2.0, 3.0).orientation == KEEP_HEADING
    assert Pose.at(1.0, 2.0, 3.0, 0.0).orientation == IDENTITY
    with pytest.raises(ZeroDivisionError):
        KEEP_HEADING.normalized()


# --- Laws -------------------------------------------------------------------------------------------------------------


@given(VECTORS, VECTORS)
def test_vectors_add_and_scale(a: Vector3, b: Vector3) -> None:
    assert a + b == b + a
    assert near((a + b) - b, a, 4e3)
    assert 2.0 * a == a + a == a * 2.0
    assert near((a * 3.0) / 3.0, a)
    assert tuple(-a) == (-a.x, -a.y, -a.z)


@given(VECTORS, VECTORS)
def test_the_cross_product_is_perpendicular_and_as_long_as_the_area(a: Vector3, b: Vector3) -> None:
    cross = a.cross(b)
    assert abs(cross.dot(a)) <= 1e-9 * (1.0 + a.norm() * a.norm() * b.norm())
    area = cross.norm() ** 2 + a.dot(b) ** 2
    assert area == pytest.approx(a.dot(a) * b.dot(b), rel=1e-9, abs=1e-9)


@given(VECTORS)
def test_the_horizontal_part_is_that_along_x_and_y(v: Vector3) -> None:
    assert math.hypot(v.horizontal_norm(), v.z) == pytest.approx(v.norm())


@given(ROTATIONS, VECTORS)
def test_a_rotation_keeps_lengths_and_can_be_undone(q: Quaternion, v: Vector3) -> None:
    assert q.rotate(v).norm() == pytest.approx(v.norm(), rel=1e-12, abs=1e-12)
    assert near(q.inverse().rotate(q.rotate(v)), v)


@given(ROTATIONS, ROTATIONS, VECTORS)
def test_a_product_rotates_by_one_after_the_other(a: Quaternion, b: Quaternion, v: Vector3) -> None:
    assert near((a * b).rotate(v), a.rotate(b.rotate(v)))
    assert (a * b).norm() == pytest.approx(1.0)


@given(ROTATIONS, st.floats(0.1, 10.0))
def test_a_quaternion_slightly_off_is_the_same_rotation(q: Quaternion, scale: float) -> None:
    off = Quaternion(q.x * scale, q.y * scale, q.z * scale, q.w * scale)
    assert same_rotation(off.normalized(), q)


@given(ANGLES, st.floats(-1.55, 1.55), ANGLES)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    back = Quaternion.from_euler(roll, pitch, yaw).to_euler()
    for found, given_rad in zip(back, (roll, pitch, yaw), strict=True):
        assert abs(wrap_angle(found - given_rad)) <= 1e-7


@given(ANGLES)
def test_the_heading_of_a_turn_is_the_turn(yaw: float) -> None:
    assert abs(wrap_angle(Quaternion.from_yaw(yaw).yaw_rad - yaw)) <= 1e-12
    assert abs(wrap_angle(Pose.at(0.0, 0.0, 0.0, yaw).yaw_rad - yaw)) <= 1e-12


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_is_the_same_direction(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(TRANSFORMS, VECTORS)
def test_a_transform_can_be_undone(transform: Transform, point: Vector3) -> None:
    back = transform.inverse()
    assert (back.frame_id, back.child_frame_id) == ("child", "parent")
    assert near(back.apply(transform.apply(point)), point, 1e4)


@given(TRANSFORMS, TRANSFORMS, VECTORS)
def test_composed_transforms_apply_one_after_the_other(outer: Transform, inner: Transform, point: Vector3) -> None:
    both = outer.compose(inner)
    assert near(both.apply(point), outer.apply(inner.apply(point)), 1e4)
    assert (both.frame_id, both.child_frame_id) == ("parent", "child")


@given(TRANSFORMS, VECTORS, ROTATIONS)
def test_a_pose_is_a_point_and_a_rotation(transform: Transform, point: Vector3, turn: Quaternion) -> None:
    pose = transform.apply_pose(Pose(point, turn))
    assert near(pose.position, transform.apply(point), 1e4)
    assert near(pose.orientation.rotate(X), transform.rotation.rotate(turn.rotate(X)))


# --- Beside numpy -----------------------------------------------------------------------------------------------------


@given(VECTORS)
def test_a_vector_is_an_array_of_three_and_made_of_one(vector: Vector3) -> None:
    array = np.asarray(vector)
    assert array.shape == (3,)
    assert array.dtype == float
    assert Vector3(array) == vector
    assert Vector3(list(vector)) == vector
    assert np.linalg.norm(vector) == pytest.approx(vector.norm())


def test_a_quaternion_is_an_array_of_four() -> None:
    assert np.asarray(Quaternion(0.1, 0.2, 0.3, 0.4), dtype="f4") == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert Quaternion(np.array([0.1, 0.2, 0.3, 0.4])) == Quaternion(0.1, 0.2, 0.3, 0.4)
    assert Quaternion([0, 0, 0, 1]) == Quaternion()


@pytest.mark.parametrize("wrong", [np.zeros(3), np.zeros((4, 4)), (0.0, 0.0, 0.0, "w"), [Vector3()]])
def test_what_is_no_quaternion_makes_none(wrong: Any) -> None:
    with pytest.raises(InvalidArgumentError, match="four"):
        Quaternion(wrong)
    with pytest.raises(InvalidArgumentError, match="four"):
        Quaternion([0.0, 0.0, 0.0, 1.0], 0.0, 0.0, 0.5)  # type: ignore[call-overload]  # what a caller may write


def test_whole_numbers_make_an_array_that_takes_fractions() -> None:
    array = np.asarray(Pose.at(1, 2, 3).position)
    array += 0.5
    assert list(array) == [1.5, 2.5, 3.5]


def test_a_number_of_numpys_times_a_vector_is_a_vector() -> None:
    assert np.float64(2.0) * X == X * np.float64(2.0) == Vector3(2.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "wrong", [np.zeros(2), np.zeros(4), np.zeros((3, 3)), (1.0, 2.0, "fast"), {"x": 1.0, "y": 2.0, "z": 3.0}]
)
def test_what_is_no_vector_makes_none(wrong: Any) -> None:
    with pytest.raises(InvalidArgumentError, match="three"):
        Vector3(wrong)


def test_an_array_is_a_whole_vector_or_none() -> None:
    with pytest.raises(InvalidArgumentError, match="three"):
        _ = np.ones(3) * Vector3(1.0, 2.0, 3.0)


# --- Headings that no one means ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [90.0, -90.0, 7, 359.0])
def test_degrees_where_radians_are_due_are_refused(degrees: float) -> None:
    with pytest.raises(InvalidArgumentError, match=r"math.radians\(-?\d+\)") as refused:
        Pose.at(1.0, 2.0, 3.0, yaw_rad=degrees)
    assert refused.value.metadata["field"] == "yaw_rad"


@given(st.floats(-math.tau, math.tau))
def test_any_heading_within_a_full_turn_is_taken(yaw_rad: float) -> None:
    assert math.remainder(Pose.at(0.0, 0.0, 0.0, yaw_rad).yaw_rad - yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-9)
