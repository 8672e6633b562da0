import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.geometry import IDENTITY, Quaternion, Vector3
from ual_daemon.backends.mavlink.dialects.axes import (
    enu_to_ned,
    enu_to_ned_yaw,
    frd_to_flu,
    ned_to_enu,
    orientation_to_enu,
)

NUMBERS = st.floats(-1e4, 1e4)
ANGLES = st.floats(-math.pi, math.pi)


@st.composite
def rotations(draw: st.DrawFn) -> Quaternion:
    return Quaternion.from_euler(draw(ANGLES), draw(ANGLES), draw(ANGLES))


def near(a: Vector3, b: Vector3) -> bool:
    return (a - b).norm() < 1e-6 * (1.0 + a.norm())


@given(NUMBERS, NUMBERS, NUMBERS)
def test_both_changes_of_axes_are_their_own_inverses_and_keep_handedness(x: float, y: float, z: float) -> None:
    for convert in (ned_to_enu, frd_to_flu):
        assert tuple(convert(*convert(x, y, z))) == (x, y, z)
        assert convert(1, 0, 0).cross(convert(0, 1, 0)) == convert(0, 0, 1)
    assert enu_to_ned(ned_to_enu(x, y, z)) == (x, y, z)


def test_north_east_down_are_y_x_and_minus_z() -> None:
    assert ned_to_enu(1.0, 2.0, 3.0) == Vector3(2.0, 1.0, -3.0)
    assert enu_to_ned(Vector3(1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert frd_to_flu(1.0, 2.0, 3.0) == Vector3(1.0, -2.0, -3.0)


@given(rotations(), NUMBERS, NUMBERS, NUMBERS)
def test_an_orientation_rotates_an_arrow_of_the_body_to_the_same_position(
    q: Quaternion, x: float, y: float, z: float
) -> None:
    """Rotates by MAVLink's rotation and then converts the axes, or the other way round."""
    in_ned = q.rotate(Vector3(x, y, z))
    ours = orientation_to_enu(q.w, q.x, q.y, q.z).rotate(frd_to_flu(x, y, z))
    assert near(ours, ned_to_enu(*in_ned))


@given(ANGLES)
def test_headings_agree_with_orientations(yaw: float) -> None:
    ours = orientation_to_enu(math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
    assert math.cos(ours.yaw_rad - enu_to_ned_yaw(yaw)) == pytest.approx(1.0)
    assert math.cos(enu_to_ned_yaw(enu_to_ned_yaw(yaw)) - yaw) == pytest.approx(1.0)


def test_north_is_a_quarter_turn_left_of_east() -> None:
    assert enu_to_ned_yaw(0.0) == pytest.approx(math.pi / 2)
    assert enu_to_ned_yaw(math.pi / 2) == pytest.approx(0.0)
    level_to_the_east = orientation_to_enu(math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    assert abs(sum(a * b for a, b in zip(level_to_the_east, IDENTITY, strict=True))) == pytest.approx(1.0)


@given(rotations(), st.floats(0.9, 1.1))
def test_a_quaternion_slightly_off_comes_out_with_unit_length(q: Quaternion, factor: float) -> None:
    assert orientation_to_enu(*(c * factor for c in (q.w, q.x, q.y, q.z))).norm() == pytest.approx(1.0)
