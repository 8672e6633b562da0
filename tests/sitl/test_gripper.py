"""Payload of a UAV, on real autopilots in simulation. Nothing flies."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from tests.sitl.simulators import PX4, Simulator
from tests.waiting import until
from ual.errors import NotSupportedError, RejectedByAutopilotError
from ual.gripper import GripperState, WinchAction
from ual.interface import Gripper
from ual_daemon import UAL
from ual_daemon.settings import (
    GripperSettings,
    PayloadSettings,
    RelaySettings,
    ServoSettings,
    VehicleSettings,
    WinchSettings,
)

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(120)]

_PREPARED = "UAL_TEST_ARDUPILOT_GRIPPER"
"""ArduPilot reads these only when it boots: GRIP_ENABLE 1, GRIP_TYPE 1, SERVO8_FUNCTION 28, RELAY1_FUNCTION 1,
RELAY1_PIN 13, WINCH_TYPE 1, SERVO10_FUNCTION 88."""
CARRIED = PayloadSettings(
    grippers=(GripperSettings(name="claw"),),
    winches=(WinchSettings(name="hook"),),
    servos=(
        ServoSettings(name="door", channel=9, min_pwm_us=1000, max_pwm_us=2000, positions={"open": 1100}),
        ServoSettings(name="motor", channel=1, min_pwm_us=1000, max_pwm_us=2000),
    ),
    relays=(RelaySettings(name="lamp", number=1),),
)
PATIENCE_S = 30.0


@pytest.fixture
def carried(simulator: Simulator, pilot: object, url: str) -> Iterator[Gripper]:
    if simulator is not PX4 and not os.environ.get(_PREPARED):
        pytest.skip(f"start it as the docstring of _PREPARED says, and set {_PREPARED}=1")
    del pilot  # it only has to be there: both return home without
    with UAL("mavlink", url=url, settings=VehicleSettings(payload=CARRIED)) as uav:
        until(lambda: bool(uav.info().autopilot), "the autopilot", seen=uav.telemetry, limit_s=PATIENCE_S)
        yield uav.gripper


def state(carried: Gripper) -> GripperState:
    return carried.get_all().grippers[0].state


def test_a_gripper_closes_and_opens(carried: Gripper, simulator: Simulator) -> None:
    for order, is_so in ((carried.grip, GripperState.CLOSED), (carried.release, GripperState.OPEN)):
        order()
        if simulator is PX4:
            assert state(carried) is GripperState.UNKNOWN
        else:
            until(lambda is_so=is_so: state(carried) is is_so, is_so.name, limit_s=PATIENCE_S)  # type: ignore[misc]
    carried.release()  # again: what is open stays open


def test_arducopter_says_where_servo_relay_and_winch_are(carried: Gripper, simulator: Simulator) -> None:
    if simulator is PX4:
        with pytest.raises(NotSupportedError):
            carried.set_relay("on")
        return
    carried.set_servo("open", servo="door")
    with pytest.raises(RejectedByAutopilotError, match="Channel 1 is already in use"):
        carried.set_servo(servo="motor", pwm_us=1500)
    for name, is_on in (("on", True), ("off", False)):
        carried.set_relay(name)
        assert carried.get_all().relays[0].is_on is is_on
    assert carried.get_all().servos[0].position == "open"
    before = carried.get_all().winches[0].status
    carried.order_winch(WinchAction.LENGTH, length_m=1.0)
    assert before is not None
    assert before.length_m is not None
    wanted_m = before.length_m + 0.9

    def is_down() -> bool:
        status = carried.get_all().winches[0].status
        return status is not None and status.length_m is not None and status.length_m > wanted_m

    until(is_down, "the line", limit_s=PATIENCE_S)
    carried.order_winch(WinchAction.HOLD)
