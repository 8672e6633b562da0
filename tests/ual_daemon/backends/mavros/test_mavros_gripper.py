"""Payload of a UAV, through a simulated MAVROS: the orders, and the meaning of its answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.simulators.lockstep_mavros import LockstepMavros
from tests.ual_daemon.backends.mavros.test_mavros_faults import make
from tests.waiting import until
from ual.errors import NotSupportedError, RejectedByAutopilotError, UalTimeoutError
from ual.gripper import GripperState, WinchAction
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.engine.command import Verdict
from ual_daemon.backends.firmwares.gripper_codec import GRIPPER, SET_RELAY, SET_SERVO, WINCH, ArduPilotGripper
from ual_daemon.backends.mavros import commands
from ual_daemon.backends.mavros.commands import read_answer
from ual_daemon.settings import VehicleSettings, convert

PAYLOAD = {
    "grippers": [{"name": "claw"}],
    "winches": [{"name": "hook"}],
    "servos": [{"name": "door", "channel": 2, "min_pwm_us": 1000, "max_pwm_us": 2000}],
    "relays": [{"name": "lamp", "number": 1}],
}
RELEASE = commands.move(ArduPilotGripper("ArduPilot").grip(1, is_closing=False))


@pytest.fixture(params=["px4", "ardupilot"])
def backend(request: pytest.FixtureRequest) -> LockstepMavros:
    return make(request.param)


@pytest.fixture
def uav(backend: LockstepMavros) -> Iterator[UAL]:
    with UAL(backend, settings=convert({"payload": PAYLOAD}, VehicleSettings)) as uav:
        until(lambda: uav.state() is State.LANDED_DISARMED, "a state", seen=uav.telemetry)
        yield uav


def ordered(backend: LockstepMavros) -> list[tuple[float, ...]]:
    moving = (GRIPPER, WINCH, SET_SERVO, SET_RELAY)
    return [(command, *params[:3]) for _, command, params, _ in backend.autopilot.commands if command in moving]


@pytest.mark.parametrize("backend", ["ardupilot"], indirect=True)
def test_orders_get_to_the_autopilot_once_and_its_refusals_are_reported(uav: UAL, backend: LockstepMavros) -> None:
    orders: list[Callable[[], None]] = [
        uav.gripper.release,
        lambda: uav.gripper.order_winch(WinchAction.LENGTH, length_m=2.0),
        lambda: uav.gripper.set_servo(pwm_us=1100),
        lambda: uav.gripper.set_relay("on"),
    ]
    for order in orders:
        with pytest.raises(RejectedByAutopilotError, match="UNSUPPORTED"):
            order()
    assert ordered(backend) == [(GRIPPER, 1, 0, 0), (WINCH, 1, 1, 2), (SET_SERVO, 2, 1100, 0), (SET_RELAY, 0, 1, 0)]


@pytest.mark.parametrize("backend", ["ardupilot"], indirect=True)
def test_the_gripper_is_what_its_texts_say(uav: UAL, backend: LockstepMavros) -> None:
    assert uav.gripper.get_all().grippers[0].state is GripperState.UNKNOWN
    autopilot = backend.autopilot
    autopilot.at(0.1, lambda: autopilot.say("Gripper load grabbed"))
    until(lambda: uav.gripper.get_all().grippers[0].state is GripperState.CLOSED, "the text")
    with pytest.raises(RejectedByAutopilotError):
        uav.gripper.release()
    until(lambda: uav.gripper.get_all().grippers[0].state is GripperState.UNKNOWN, "the order")


@pytest.mark.parametrize("backend", ["ardupilot"], indirect=True)
def test_an_order_that_is_not_acknowledged_learns_it(uav: UAL, backend: LockstepMavros) -> None:
    backend.autopilot.ignored.add(GRIPPER)
    with pytest.raises(UalTimeoutError, match="MAVROS has not answered the command to release the gripper"):
        uav.gripper.release()
    assert ordered(backend) == [(GRIPPER, 1, 0, 0)]


def test_what_mavros_does_not_tell_is_unknown(uav: UAL, backend: LockstepMavros) -> None:
    found = uav.gripper.get_all()
    assert (found.winches[0].status, found.servos[0].pwm_us, found.relays[0].is_on) == (None, None, None)
    for each in (found.winches[0], found.servos[0], found.relays[0]):
        assert "MAVROS does not pass on what the autopilot says" in each.note
    assert found.grippers[0].state is GripperState.UNKNOWN
    assert ordered(backend) == []


@pytest.mark.parametrize("backend", ["px4"], indirect=True)
def test_no_actuator_of_px4_is_moved_by_halves(uav: UAL, backend: LockstepMavros) -> None:
    with pytest.raises(NotSupportedError, match="the bridge has no NaN"):
        uav.gripper.set_servo(pwm_us=1100)
    assert ordered(backend) == []


@pytest.mark.parametrize(
    ("answer", "after_s", "verdict"),
    [
        ({"success": True, "result": 0}, 0.1, Verdict.ACCEPTED),
        ({"success": False, "result": 5}, 0.1, Verdict.ACCEPTED),  # PX4's gripper moves; no more is passed on
        ({"success": False, "result": 4}, 0.1, Verdict.REFUSED),
        ({"success": False, "result": 4}, 5.0, Verdict.LOST),  # what MAVROS says where none came
        ({"success": False, "result": 0}, 5.0, Verdict.LOST),
        ({"success": False, "result": 2}, 5.0, Verdict.REFUSED),
    ],
)
def test_what_an_answer_of_mavros_means(answer: dict[str, object], after_s: float, verdict: Verdict) -> None:
    assert read_answer(RELEASE.request, answer, after_s).verdict is verdict
