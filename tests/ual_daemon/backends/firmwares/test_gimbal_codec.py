"""Description of a gimbal by its parameters, and the form of an order for each autopilot."""

from __future__ import annotations

import math
from dataclasses import astuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.errors import NotSupportedError
from ual.geometry import Quaternion
from ual.gimbals import GimbalAbility, GimbalAngles, GimbalReference
from ual_daemon.backends.firmwares.gimbal_codec import MOUNT_CONTROL, ArduPilotGimbal, GimbalCodec, Px4Gimbal
from ual_daemon.backends.firmwares.gimbal_protocol import PITCH_YAW, attitude_of

BODY, HORIZON, EARTH = GimbalReference.BODY, GimbalReference.HORIZON, GimbalReference.EARTH
MOUNT = {
    "MNT1_TYPE": 1.0,
    "MNT1_PITCH_MIN": -90.0,
    "MNT1_PITCH_MAX": 20.0,
    "MNT1_YAW_MIN": -45.0,
    "MNT1_YAW_MAX": 45.0,
}
SERVOS = {
    "MNT_MODE_IN": 4.0,
    "MNT_MODE_OUT": 0.0,
    "MNT_DO_STAB": 1.0,
    "MNT_RANGE_ROLL": 90.0,
    "MNT_RANGE_PITCH": 180.0,
    "MNT_RANGE_YAW": 360.0,
}
ARDUPILOT, PX4 = ArduPilotGimbal(), Px4Gimbal()


@pytest.mark.parametrize(
    ("codec", "known", "pitch_deg"), [(ARDUPILOT, MOUNT, (-20.0, 90.0)), (PX4, SERVOS, (-90.0, 90.0))]
)
def test_it_is_known_once_all_that_says_so_is(
    codec: GimbalCodec, known: dict[str, float], pitch_deg: tuple[float, float]
) -> None:
    first, *_ = known
    assert codec.parameters({}) == (first,)
    assert set(codec.parameters(known)) >= set(known)
    for name in known:
        assert codec.identity({each: value for each, value in known.items() if each != name}) is None
    identity = codec.identity(known)
    assert identity is not None
    assert identity.pitch is not None
    assert tuple(map(math.degrees, astuple(identity.pitch))) == pytest.approx(pitch_deg)
    assert codec.meant(known) is BODY


@pytest.mark.parametrize(
    ("codec", "known"),
    [
        (ARDUPILOT, {**MOUNT, "MNT1_TYPE": 0.0}),
        (PX4, {**SERVOS, "MNT_MODE_IN": -1.0}),
        (PX4, {**SERVOS, "MNT_MODE_IN": 1.0}),
    ],
)
def test_where_none_is_set_up_there_is_none(codec: GimbalCodec, known: dict[str, float]) -> None:
    assert codec.identity(known) is None
    assert len(codec.parameters(known)) == 1


def test_an_axis_that_cannot_turn_is_none() -> None:
    identity = ARDUPILOT.identity({**MOUNT, "MNT1_YAW_MIN": 0.0, "MNT1_YAW_MAX": 0.0})
    assert identity is not None
    assert identity.yaw is None
    assert identity.abilities.isdisjoint({GimbalAbility.YAW, GimbalAbility.EARTH, GimbalAbility.ROLL})


def test_of_two_mounts_it_is_not_known_which_one_points_where() -> None:
    known = {**MOUNT, "MNT2_TYPE": 1.0}
    identity = ARDUPILOT.identity(known)
    assert identity is not None
    assert "there are two" in identity.note
    assert not ARDUPILOT.tells_attitude(known)
    assert not ARDUPILOT.tells_mount(known)


def test_px4_says_zeros_of_a_gimbal_that_is_a_device_itself() -> None:
    known = {**SERVOS, "MNT_MODE_OUT": 2.0}
    assert (PX4.tells_mount(known), PX4.tells_attitude(known), PX4.tells_mount(SERVOS)) == (False, True, True)
    identity = PX4.identity(known)
    assert identity is not None
    assert (identity.roll, identity.pitch, identity.yaw) == (None, None, None)


@given(st.floats(-0.5, 0.5), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_what_is_ordered_is_what_is_observed(roll: float, pitch: float, yaw: float) -> None:
    angles = GimbalAngles(roll, pitch, yaw)
    mount = PX4.turning(angles, HORIZON)
    assert (mount.id, mount.params[6], mount.holds) == (MOUNT_CONTROL, 2.0, False)
    pitch_deg, roll_deg, yaw_deg = mount.params[:3]
    assert observed(roll_deg, pitch_deg, yaw_deg) == pytest.approx((roll, pitch, yaw), abs=1e-6)
    for reference in (HORIZON, EARTH):
        order = ARDUPILOT.turning(angles, reference)
        assert (order.id, order.params[6]) == (PITCH_YAW, 1.0)
        (pitch_deg, yaw_deg), flags = order.params[:2], int(order.params[4])
        assert observed(0.0, pitch_deg, yaw_deg, flags, reference) == pytest.approx((0.0, pitch, yaw), abs=1e-6)


def observed(
    roll_deg: float, pitch_deg: float, yaw_deg: float, flags: int = 0, reference: GimbalReference = HORIZON
) -> tuple[float, ...]:
    """The angles that a device says that does as it is told."""
    q = Quaternion.from_euler(*map(math.radians, (roll_deg, pitch_deg, yaw_deg)))
    found = attitude_of(flags, (q.w, q.x, q.y, q.z))
    assert found is not None
    assert found[1] is reference
    return found[0].to_euler()


def test_px4_takes_no_rates_and_retracts_nothing() -> None:
    assert PX4.resting(is_retracted=False).params == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    with pytest.raises(NotSupportedError):
        PX4.turning_at(0.1, 0.1)
    with pytest.raises(NotSupportedError):
        PX4.resting(is_retracted=True)
