"""Attitudes of gimbals, in all axes, of a UAV that tilts."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.strategies import POSES
from ual.geometry import Pose, Quaternion, Vector3, wrap_angle
from ual.gimbals import AngleRange, GimbalAbility, GimbalInfo, GimbalReference
from ual_daemon.backends.offers.gimbals import GimbalAttitude
from ual_daemon.vehicle.gimbals import aimed, angles_from_nose

BODY, HORIZON, EARTH = GimbalReference.BODY, GimbalReference.HORIZON, GimbalReference.EARTH
ROLLS, PITCHES, YAWS = st.floats(-1.0, 1.0), st.floats(-1.5, 1.5), st.floats(-math.pi, math.pi)
AHEAD = Vector3(1.0)
ALL = GimbalInfo(0, "any", frozenset(GimbalAbility))


def attitude(reference: GimbalReference, roll: float, pitch: float, yaw: float) -> GimbalAttitude:
    return GimbalAttitude(Quaternion.from_euler(roll, pitch, yaw), reference, 0.0)


@given(POSES, st.sampled_from(GimbalReference), ROLLS, PITCHES, YAWS)
def test_in_the_body_and_outside_it_points_the_same_manner(
    body: Pose, reference: GimbalReference, roll: float, pitch: float, yaw: float
) -> None:
    looks = attitude(reference, roll, pitch, yaw)
    in_local, in_body = looks.in_local(body), looks.in_body(body)
    assert in_local is not None
    assert in_body is not None
    for axis in (AHEAD, Vector3(0.0, 1.0)):
        outside = tuple(body.orientation.rotate(in_body.rotate(axis)))
        assert outside == pytest.approx(tuple(in_local.rotate(axis)), abs=1e-9)


@given(POSES, ROLLS, PITCHES, YAWS)
def test_a_level_one_keeps_its_angles_while_the_uav_tilts(body: Pose, roll: float, pitch: float, yaw: float) -> None:
    angles = angles_from_nose(attitude(HORIZON, roll, pitch, yaw), body)
    assert angles is not None
    assert (angles.roll_rad, angles.pitch_rad) == pytest.approx((roll, pitch), abs=1e-6)
    assert wrap_angle(angles.yaw_rad - yaw) == pytest.approx(0.0, abs=1e-6)


def test_one_that_is_fixed_to_the_body_tilts_with_it() -> None:
    """The UAV noses down by 0.3 rad, and its gimbal looks ahead of it, or to its left."""
    body = Pose(Vector3(), Quaternion.from_euler(0.0, 0.3, 1.0))
    ahead = angles_from_nose(attitude(BODY, 0.0, 0.0, 0.0), body)
    left = angles_from_nose(attitude(BODY, 0.0, 0.0, math.pi / 2.0), body)
    assert ahead is not None
    assert left is not None
    assert (ahead.roll_rad, ahead.pitch_rad, ahead.yaw_rad) == pytest.approx((0.0, 0.3, 0.0), abs=1e-9)
    assert (left.roll_rad, left.pitch_rad, left.yaw_rad) == pytest.approx((0.3, 0.0, math.pi / 2.0), abs=1e-9)


@pytest.mark.parametrize("reference", [BODY, HORIZON])
def test_without_the_pose_of_the_body_only_its_own_axes_are_reported(reference: GimbalReference) -> None:
    looks = attitude(reference, 0.1, 0.2, 0.3)
    assert looks.in_local(None) is None
    assert (looks.in_body(None) is None) is (reference is HORIZON)
    assert (angles_from_nose(looks, None) is None) is (reference is BODY)


@given(POSES, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_what_it_is_aimed_at_is_what_it_faces(body: Pose, x: float, y: float, z: float) -> None:
    way = Vector3(x, y, z)
    assume(way.norm() > 0.01)
    aim = aimed(ALL, body, way)
    looks = GimbalAttitude(aim.angles.orientation, aim.reference, 0.0).in_local(body)
    assert looks is not None
    assert tuple(looks.rotate(AHEAD) * way.norm()) == pytest.approx(tuple(way), abs=1e-4)
    assert not aim.limit


@given(POSES, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_it_is_never_aimed_beyond_its_limits(body: Pose, x: float, y: float, z: float) -> None:
    limited = GimbalInfo(0, "limited", frozenset(GimbalAbility), pitch=AngleRange(-0.2, 1.0), yaw=AngleRange(-1.0, 0.5))
    aim = aimed(limited, body, Vector3(x, y, z))
    assert -0.2 <= aim.angles.pitch_rad <= 1.0
    assert aim.reference is EARTH
    assert -1.0 - 1e-9 <= wrap_angle(aim.angles.yaw_rad - body.yaw_rad) <= 0.5 + 1e-9
