from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.strategies import ROTATIONS, vectors
from ual.errors import InvalidArgumentError
from ual.geometry import IDENTITY, KEEP_HEADING, Pose, Quaternion, Transform, Twist, Vector3
from ual.types import AltitudeReference, PathHeading
from ual_daemon import validation

NAN, INF = math.nan, math.inf
DENORMAL = 5e-324

NO_NUMBERS: list[Any] = [None, "3", b"3", "high", [3], object(), 1j, True, False]
NOT_FINITE = [NAN, INF, -INF, 10**400]


def refusal(check: Callable[[], object], field: str) -> str:
    """Returns the refusal of a value; the message and the metadata name the field, in one line."""
    with pytest.raises(InvalidArgumentError) as caught:
        check()
    assert caught.value.metadata["field"] == field
    assert caught.value.message.startswith(f"{field}: ")
    assert "\n" not in caught.value.message
    return caught.value.message


# --- Numbers ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [0.0, -0.0, 1, -2.5, 7.0, -7.0, DENORMAL])
def test_a_finite_number_is_taken(value: float) -> None:
    found = validation.number(value, "height_m", at_most=7.0)
    assert found == value
    assert type(found) is float


def test_anything_that_is_a_number_is_taken() -> None:
    from decimal import Decimal

    import numpy as np

    assert validation.number(np.float32(0.5), "x", at_most=1.0) == 0.5
    assert validation.number(np.int64(-1), "x", at_most=1.0) == -1.0
    assert validation.number(Decimal("0.5"), "x", at_most=1.0) == 0.5


@pytest.mark.parametrize("value", NO_NUMBERS)
def test_what_is_no_number_is_refused(value: Any) -> None:
    assert "is not a number" in refusal(lambda: validation.number(value, "height_m", at_most=7.0), "height_m")


@pytest.mark.parametrize("value", NOT_FINITE)
def test_what_is_not_finite_is_refused(value: float) -> None:
    assert "is not a finite number" in refusal(lambda: validation.number(value, "height_m", at_most=7.0), "height_m")


@pytest.mark.parametrize("value", [7.000001, -8.0, 1e300])
def test_what_cannot_be_meant_is_refused(value: float) -> None:
    message = refusal(lambda: validation.number(value, "height_m", at_most=7.0), "height_m")
    assert message.endswith(f"is out of range ({'at most 7' if value > 0 else 'at least -7'})")


def test_a_value_just_out_of_range_is_not_reported_as_the_limit() -> None:
    with pytest.raises(InvalidArgumentError, match=r"180\.00005 is out of range \(at most 180\)"):
        validation.longitude(180.00005)
    with pytest.raises(InvalidArgumentError, match=r"-90\.00000000000001 is out of range \(at least -90\)"):
        validation.latitude(-90.00000000000001)


def test_signs() -> None:
    assert validation.not_negative(0.0, "x", at_most=1.0) == 0.0
    assert validation.positive(DENORMAL, "x", at_most=1.0) == DENORMAL
    assert refusal(lambda: validation.not_negative(-0.1, "x", at_most=1.0), "x") == "x: -0.1 is negative"
    assert refusal(lambda: validation.positive(-0.1, "x", at_most=1.0), "x") == "x: -0.1 is negative"
    assert refusal(lambda: validation.positive(0.0, "x", at_most=1.0), "x") == "x: is zero; it must be more"
    assert refusal(lambda: validation.positive(-0.0, "x", at_most=1.0), "x") == "x: is zero; it must be more"


@given(st.floats(-7.0, 7.0))
def test_a_number_comes_out_as_it_went_in(value: float) -> None:
    assert validation.number(value, "x", at_most=7.0) == value


# --- Vectors ----------------------------------------------------------------------------------------------------------


@given(vectors(1e6))
def test_a_position_comes_out_as_it_went_in(value: Vector3) -> None:
    assert validation.position(value, "position") == value


@pytest.mark.parametrize("component", ["x", "y", "z"])
@pytest.mark.parametrize("value", [*NOT_FINITE, 1.1e7])
def test_a_component_at_fault_is_named(value: float, component: str) -> None:
    bad = Vector3(**{component: value})
    refusal(lambda: validation.position(bad, "waypoint.pose.position"), f"waypoint.pose.position.{component}")


def test_a_vector_that_is_too_long_though_its_components_are_not_is_refused() -> None:
    assert validation.position(Vector3(1e7, 0, 0), "p") == Vector3(1e7, 0, 0)
    assert "its length" in refusal(lambda: validation.position(Vector3(9e6, 9e6, 0), "p"), "p")


@pytest.mark.parametrize("value", [None, 3, (1, 2), (1, 2, 3, 4), "four"])
def test_what_is_no_vector_is_refused(value: Any) -> None:
    assert "is not a vector of three components" in refusal(lambda: validation.position(value, "p"), "p")


def test_a_velocity_that_nobody_can_mean_is_refused() -> None:
    fast, fastest = Vector3(0, 1000.0, 0), Vector3(0, 1000.1, 0)
    assert validation.twist(Twist(fast, Vector3(z=12.5)), "velocity.twist") == Twist(fast, Vector3(z=12.5))
    refusal(lambda: validation.twist(Twist(fastest), "velocity.twist"), "velocity.twist.linear.y")
    refusal(lambda: validation.twist(Twist(angular=Vector3(z=NAN)), "velocity.twist"), "velocity.twist.angular.z")
    refusal(lambda: validation.twist(Twist(Vector3(NAN, 0, 0)), "velocity.twist"), "velocity.twist.linear.x")


@pytest.mark.parametrize("degrees_s", [Vector3(z=90.0), Vector3(z=-13), Vector3(y=90.0)])
def test_a_rate_of_turn_that_is_meant_in_degrees_is_refused(degrees_s: Vector3) -> None:
    why = refusal(lambda: validation.twist(Twist(angular=degrees_s), "velocity.twist"), "velocity.twist.angular")
    assert why.endswith("rad/s are more than two turns a second: give radians, not degrees")


# --- Rotations --------------------------------------------------------------------------------------------------------


@given(ROTATIONS, st.floats(0.951, 1.049))
def test_a_quaternion_slightly_off_is_normalized(rotation: Quaternion, norm: float) -> None:
    scaled = Quaternion(*(component * norm for component in rotation))
    found = validation.rotation(scaled, "q")
    assert found.norm() == pytest.approx(1.0, abs=1e-12)
    assert all(a == pytest.approx(b, abs=1e-12) for a, b in zip(found, rotation, strict=True))


@pytest.mark.parametrize(
    "value",
    [
        Quaternion(0, 0, 0, 0.94),
        Quaternion(0, 0, 0, 1.06),
        Quaternion(0, 0, 1, 1),
        Quaternion(0, 0, 0, DENORMAL),
        Quaternion(DENORMAL, -DENORMAL, DENORMAL, DENORMAL),
        Quaternion(1e-300, 0, 0, 0),
        Quaternion(1e-9, 0, 0, 0),
        Quaternion(1e308, 1e308, 1e308, 1e308),
    ],
)
def test_a_quaternion_that_is_no_rotation_is_refused_also_where_zeros_keep_the_heading(value: Quaternion) -> None:
    assert "is not a rotation: its norm is" in refusal(lambda: validation.rotation(value, "q"), "q")
    assert "is not a rotation: its norm is" in refusal(lambda: validation.orientation(value, "q"), "q")


@pytest.mark.parametrize("component", ["x", "y", "z", "w"])
@pytest.mark.parametrize("value", NOT_FINITE)
def test_a_quaternion_that_is_not_finite_is_refused(value: float, component: str) -> None:
    bad = Quaternion(**{"w": 1.0, component: value})
    refusal(lambda: validation.orientation(bad, "q"), f"q.{component}")


@pytest.mark.parametrize("value", [None, 1.0, Vector3(), (0, 0, 0), "xyz"])
def test_what_is_no_quaternion_is_refused(value: Any) -> None:
    refusal(lambda: validation.orientation(value, "q"), "q")


@pytest.mark.parametrize("value", [KEEP_HEADING, Quaternion(-0.0, 0.0, -0.0, 0.0)])
def test_all_zeros_keep_the_heading_but_are_no_rotation_of_a_frame(value: Quaternion) -> None:
    assert validation.orientation(value, "q") is None
    refusal(lambda: validation.rotation(value, "q"), "q")


# --- Names of frames, transforms --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("check", "field", "limit"),
    [(validation.latitude, "latitude_deg", 90.0), (validation.longitude, "longitude_deg", 180.0)],
)
def test_latitude_and_longitude_are_on_earth(check: Callable[[float], float], field: str, limit: float) -> None:
    assert check(limit) == limit
    assert check(-limit) == -limit
    for bad in (limit + 1e-9, -limit - 1e-9, NAN, INF):
        refusal(partial(check, bad), field)


@pytest.mark.parametrize("value", ["AMSL", 2, None])
def test_an_altitude_reference_is_one_of_the_enum(value: Any) -> None:
    for reference in AltitudeReference:
        assert validation.altitude_reference(reference) is reference
    message = refusal(lambda: validation.altitude_reference(value), "altitude_reference")
    assert "HOME, AMSL, ELLIPSOID" in message


@pytest.mark.parametrize("name", ["map", "uav_1/odom", "_x", "A/b/C_3", "a" * 200])
def test_a_frame_name_is_taken(name: str) -> None:
    assert validation.frame_id(name, "f") == name


@pytest.mark.parametrize(
    "name", ["", "/map", "map/", "a//b", "a b", "1a", "a\n", "a-b", "å", "a/1", "a" * 201, None, 7, b"map", ["map"]]
)
def test_what_is_no_frame_name_is_refused(name: Any) -> None:
    assert "is not a frame name" in refusal(lambda: validation.frame_id(name, "f"), "f")


def test_a_long_wrong_name_is_not_repeated_in_full() -> None:
    assert len(refusal(lambda: validation.frame_id("-" * 10_000, "f"), "f")) < 400


def test_a_transform_is_checked_part_by_part() -> None:
    good = Transform(Vector3(1, 2, 3), Quaternion(0, 0, 0, 1.01), "map", "box", 5.0)
    assert validation.transform(good, "t") == Transform(Vector3(1, 2, 3), IDENTITY, "map", "box", 5.0)
    assert validation.transform(Transform(child_frame_id="box"), "t").frame_id == ""
    for bad, field in (
        (Transform(Vector3(NAN, 0, 0), child_frame_id="box"), "t.translation.x"),
        (Transform(rotation=KEEP_HEADING, child_frame_id="box"), "t.rotation"),
        (Transform(frame_id="a b", child_frame_id="box"), "t.header.frame_id"),
        (Transform(frame_id="map"), "t.child_frame_id"),
    ):
        refusal(partial(validation.transform, bad, "t"), field)


@pytest.mark.parametrize("value", [None, Pose(), Twist(), "box", 3])
def test_another_type_is_refused(value: Any) -> None:
    assert "is not of type Transform" in refusal(lambda: validation.transform(value, "t"), "t")
    if not isinstance(value, Twist):
        assert "is not of type Twist" in refusal(lambda: validation.twist(value, "t"), "t")


@pytest.mark.parametrize("check", [validation.position, validation.rotation, validation.transform])
def test_what_is_refused_is_shown_in_one_short_message(check: Callable[[Any, str], object]) -> None:
    import numpy as np

    assert len(refusal(lambda: check(np.zeros((9, 9)), "t"), "t")) < 400


# --- Paths ------------------------------------------------------------------------------------------------------------


def test_a_speed_of_its_own_for_each_leg_or_none() -> None:
    assert validation.leg_speeds([], 2) == [None, None]
    assert validation.leg_speeds([2, 0.0], 2) == [2.0, None]
    assert "1 for 2 waypoints" in refusal(lambda: validation.leg_speeds([1.0], 2), "leg_speeds_m_s")
    refusal(lambda: validation.leg_speeds([1.0, NAN], 2), "leg_speeds_m_s[1]")
    refusal(lambda: validation.leg_speeds([1001.0], 1), "leg_speeds_m_s[0]")
    assert "at least 0.01" in refusal(lambda: validation.leg_speeds([1.0, 0.009], 2), "leg_speeds_m_s[1]")


def test_a_speed_that_is_not_to_be_exceeded_is_none_or_one_that_can_be_meant() -> None:
    assert validation.max_speed(None) is None
    assert validation.max_speed(0.01) == 0.01
    assert validation.max_speed(1000) == 1000.0
    for value in (0.0, 1e-9, 0.0099, -1.0, NAN, INF, 1000.1):
        refusal(lambda value=value: validation.max_speed(value), "max_speed_m_s")  # type: ignore[misc]


def test_a_point_of_interest_belongs_to_its_heading() -> None:
    for heading in PathHeading:
        needs_point = heading is PathHeading.POINT_OF_INTEREST
        assert validation.path_heading(heading, has_point=needs_point) is heading
        message = refusal(
            lambda heading=heading, has=not needs_point: validation.path_heading(heading, has_point=has),  # type: ignore[misc]
            "point_of_interest",
        )
        assert heading.name in message
    bad: Any = 3
    assert "ALONG_PATH" in refusal(lambda: validation.path_heading(bad, has_point=False), "heading")
