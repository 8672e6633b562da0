"""What the light simulation cannot show: autopilots that do things another way, told by hand-made snapshots."""

from __future__ import annotations

import math
from concurrent.futures import Future
from dataclasses import dataclass

import pytest

from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalError, UalTimeoutError
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Limits, State, TaskKind
from ual_daemon.backends.values import (
    Control,
    Estimator,
    Freshness,
    LandedState,
    Mode,
    PositionSetpoint,
    Sample,
    Snapshot,
)
from ual_daemon.flight.autopilot_command import COMMAND_PATIENCE_S, AutopilotCommand
from ual_daemon.flight.follow import FollowTrajectory
from ual_daemon.flight.land import Land
from ual_daemon.flight.manoeuvre import Manoeuvre, Step
from ual_daemon.flight.recover import Recover
from ual_daemon.flight.state import estimate
from ual_daemon.flight.take_off import TakeOff
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.references import Hold
from ual_daemon.trajectory import Line, Motion

STEP_S = 0.1
HEIGHT_M = 4.0


@dataclass
class Autopilot:
    """What it says now; a test sets it."""

    time_s: float = 0.0
    z: float = 0.2  # on the ground an estimate is not 0
    climb_m_s: float = 0.0
    armed: bool = True
    control: Control = Control.OTHER
    landed: LandedState = LandedState.ON_GROUND
    silent_s: float = 0.0
    yaw_rad: float = 0.5
    status_text: str = ""

    def now_s(self) -> float:
        return self.time_s

    def snapshot(self) -> Snapshot:
        heard_s = self.time_s - self.silent_s
        return Snapshot(
            time_s=self.time_s,
            heard_s=heard_s,
            armed=Sample(self.armed, heard_s),
            landed=Sample(self.landed, heard_s),
            mode=Sample(Mode(self.control.name, self.control), heard_s),
            estimator=Sample(Estimator(True), heard_s),
            pose=Sample(Pose(Vector3(1.0, 2.0, self.z), Quaternion.from_yaw(self.yaw_rad)), heard_s),
            velocity=Sample(Twist(Vector3(0.0, 0.0, self.climb_m_s)), heard_s),
            status_text=self.status_text,
        )

    def step(self, manoeuvre: Manoeuvre) -> Step:
        self.time_s += STEP_S
        self.z += self.climb_m_s * STEP_S
        snapshot = self.snapshot()
        return manoeuvre.step(snapshot, estimate(snapshot, Freshness()))

    def until_end(self, manoeuvre: Manoeuvre, limit_s: float = 300.0) -> UalError | None:
        for _ in range(round(limit_s / STEP_S)):
            step = self.step(manoeuvre)
            if step.has_ended:
                return step.error
        raise AssertionError("it does not end")

    def task(self, kind: TaskKind) -> VehicleTask:
        return VehicleTask(kind, "", self)


@pytest.fixture
def autopilot() -> Autopilot:
    return Autopilot()


@pytest.fixture
def ack() -> Future[None]:
    return Future()


def sent(ack: Future[None], autopilot: Autopilot) -> AutopilotCommand:
    command = AutopilotCommand("do it", autopilot.time_s)
    command.send(lambda: ack)
    return command


# --- Commands ---------------------------------------------------------------------------------------------------------


def later(autopilot: Autopilot, seconds: float) -> Snapshot:
    return autopilot.snapshot().at(autopilot.time_s + seconds)


def test_a_command_has_time_to_show_its_effect(autopilot: Autopilot, ack: Future[None]) -> None:
    command = sent(ack, autopilot)
    assert command.failure(later(autopilot, COMMAND_PATIENCE_S)) is None
    assert isinstance(command.failure(later(autopilot, COMMAND_PATIENCE_S + 0.1)), UalTimeoutError)


def test_an_accepted_command_without_effect_is_a_refusal_in_its_words(autopilot: Autopilot, ack: Future[None]) -> None:
    command = sent(ack, autopilot)
    ack.set_result(None)
    autopilot.status_text = "Preflight Fail: heading"
    failure = command.failure(later(autopilot, COMMAND_PATIENCE_S + 0.1))
    assert isinstance(failure, RejectedByAutopilotError)
    assert "accepted to do it, but has not after 5 s" in failure.message
    assert "Preflight Fail: heading" in failure.message


def test_a_refusal_is_known_at_once(autopilot: Autopilot, ack: Future[None]) -> None:
    command = sent(ack, autopilot)
    ack.set_exception(RejectedByAutopilotError("no"))
    assert str(command.failure(autopilot.snapshot())) == "no"
    assert not command.is_accepted


def test_a_backend_that_raises_has_refused(autopilot: Autopilot) -> None:
    def refuse() -> Future[None]:
        raise LinkLostError("the port is gone")

    command = AutopilotCommand("do it", 0.0)
    command.send(refuse)
    assert isinstance(command.failure(autopilot.snapshot()), LinkLostError)


# --- Take-off ---------------------------------------------------------------------------------------------------------


def test_a_command_that_is_withdrawn_before_it_is_sent_is_not_sent() -> None:
    command = AutopilotCommand("arm", 0.0)
    command.withdraw()
    command.send(lambda: pytest.fail("it was sent"))
    assert not command.is_answered


def test_a_command_that_is_withdrawn_while_it_is_sent_is_taken_back(ack: Future[None]) -> None:
    command = AutopilotCommand("arm", 0.0)

    def send() -> Future[None]:
        command.withdraw()  # by another thread, which sees no future yet
        return ack

    command.send(send)
    assert ack.cancelled()


def take_off(autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool) -> TakeOff:
    return TakeOff(
        autopilot.task(TaskKind.TAKE_OFF),
        sent(ack, autopilot),
        autopilot.snapshot(),
        HEIGHT_M,
        Limits(),
        ToleranceSettings(),
        on_setpoints=on_setpoints,
    )


def test_an_autopilot_that_climbs_by_itself_gets_no_setpoint_until_it_is_up(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    ack.set_result(None)
    autopilot.control = Control.REFERENCES
    assert autopilot.step(climb).setpoint is None
    autopilot.landed, autopilot.climb_m_s = LandedState.TAKING_OFF, 1.0
    while autopilot.z < HEIGHT_M + 0.2:
        assert autopilot.step(climb) == Step()
    autopilot.climb_m_s = 0.0
    for _ in range(20):  # it is up, but takes no references before it says so itself
        assert autopilot.step(climb) == Step()
    autopilot.landed = LandedState.IN_AIR
    step = Step()
    while not step.has_ended:
        step = autopilot.step(climb)
    assert step.error is None
    assert isinstance(step.next_reference, Hold)
    assert step.next_reference.motion(autopilot.snapshot()).position.z == pytest.approx(HEIGHT_M + 0.2)


@pytest.mark.parametrize("off_m", [-0.7, 0.7])
def test_an_autopilot_that_counts_from_elsewhere_is_led_to_the_height_once_it_is_up(
    autopilot: Autopilot, ack: Future[None], off_m: float
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    ack.set_result(None)
    autopilot.control, autopilot.landed = Control.REFERENCES, LandedState.TAKING_OFF
    autopilot.z = HEIGHT_M + 0.2 + off_m
    assert autopilot.step(climb) == Step()
    autopilot.landed = LandedState.IN_AIR
    step = autopilot.step(climb)
    while not step.has_ended:
        assert isinstance(step.setpoint, PositionSetpoint)
        autopilot.z = step.setpoint.position.z
        step = autopilot.step(climb)
    assert step.error is None
    assert autopilot.z == pytest.approx(HEIGHT_M + 0.2, abs=0.2)


def test_setpoints_hold_the_ground_until_the_mode_is_there_then_climb(autopilot: Autopilot, ack: Future[None]) -> None:
    climb = take_off(autopilot, ack, on_setpoints=True)
    ground = PositionSetpoint(Vector3(1.0, 2.0, 0.2), Quaternion.from_yaw(0.5).yaw_rad)
    for _ in range(5):
        assert autopilot.step(climb).setpoint == ground
    ack.set_result(None)
    assert autopilot.step(climb).setpoint == ground  # PX4 says yes before it does so: the mode counts
    autopilot.control = Control.REFERENCES
    heights = []
    for _ in range(40):
        setpoint = autopilot.step(climb).setpoint
        assert isinstance(setpoint, PositionSetpoint)
        heights.append(setpoint.position.z)
        autopilot.z = setpoint.position.z
    assert heights == sorted(heights)
    assert heights[-1] > 2.0


def test_a_low_climb_is_not_up_while_it_stands_on_the_ground(autopilot: Autopilot, ack: Future[None]) -> None:
    climb = TakeOff(
        autopilot.task(TaskKind.TAKE_OFF),
        sent(ack, autopilot),
        autopilot.snapshot(),
        0.1,
        Limits(),
        ToleranceSettings(),
        on_setpoints=False,
    )
    ack.set_result(None)
    autopilot.control = Control.REFERENCES
    for _ in range(30):
        assert not autopilot.step(climb).has_ended
    autopilot.landed = LandedState.IN_AIR
    assert autopilot.until_end(climb, 1.0) is None


def test_where_the_acknowledgement_is_lost_the_mode_alone_must_do(autopilot: Autopilot, ack: Future[None]) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    autopilot.control = Control.TAKE_OFF
    for _ in range(15):
        autopilot.step(climb)
    autopilot.control = Control.OTHER
    error = autopilot.step(climb).error
    assert isinstance(error, TaskAbortedError)  # it had begun, so the pilot took it
    assert error.metadata["by"] == "safety pilot"


@pytest.mark.parametrize("on_setpoints", [False, True])
def test_a_pilot_who_leaves_the_mode_before_the_climb_is_answered_is_not_lifted_off(
    autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    assert not autopilot.step(climb).has_ended  # not in its mode yet
    autopilot.control = Control.REFERENCES
    assert not autopilot.step(climb).has_ended
    autopilot.control = Control.OTHER
    error = autopilot.step(climb).error
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"
    climb.end(error)
    assert ack.cancelled()  # it is not sent again


def test_an_offboard_that_was_left_over_may_end_before_it_is_taken_anew(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    """PX4 leaves it by itself, for want of setpoints, just as they begin."""
    autopilot.control = Control.REFERENCES
    climb = take_off(autopilot, ack, on_setpoints=True)
    assert not autopilot.step(climb).has_ended
    autopilot.control = Control.OTHER
    assert not autopilot.step(climb).has_ended
    autopilot.control = Control.REFERENCES
    assert not autopilot.step(climb).has_ended
    autopilot.control = Control.OTHER  # but now it is the pilot
    assert isinstance(autopilot.step(climb).error, TaskAbortedError)


@pytest.mark.parametrize("on_setpoints", [False, True])
def test_a_pilot_who_lifts_it_off_before_the_mode_is_there_has_it(
    autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    for _ in range(5):  # in his mode, on the ground
        assert not autopilot.step(climb).has_ended
    autopilot.landed, autopilot.z = LandedState.IN_AIR, 0.5
    step = autopilot.step(climb)
    assert step.setpoint is None
    assert isinstance(step.error, TaskAbortedError)
    assert step.error.metadata["by"] == "safety pilot"
    climb.end(step.error)
    assert ack.cancelled()


@pytest.mark.parametrize(
    ("what", "kind"),
    [
        ({"armed": False}, TaskAbortedError),
        ({"silent_s": 10.0}, LinkLostError),
    ],
)
def test_a_take_off_ends_when_it_cannot_go_on(
    autopilot: Autopilot, ack: Future[None], what: dict[str, object], kind: type[UalError]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=True)
    autopilot.step(climb)
    for name, value in what.items():
        setattr(autopilot, name, value)
    assert isinstance(autopilot.step(climb).error, kind)


def test_a_climb_that_comes_to_nothing_times_out_and_says_at_which_height(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    ack.set_result(None)
    autopilot.control, autopilot.z = Control.REFERENCES, 1.2
    error = autopilot.until_end(climb)
    assert isinstance(error, UalTimeoutError)
    assert "at 1.00 m" in error.message


def test_a_take_off_whose_refusal_comes_late_fails_by_it_while_it_still_stands(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    autopilot.control = Control.REFERENCES
    for _ in range(15):  # no answer: the mode alone must do
        assert not autopilot.step(climb).has_ended
    refusal = RejectedByAutopilotError("refused to take off")
    ack.set_exception(refusal)
    assert autopilot.step(climb).error is refusal


# --- Go-to ------------------------------------------------------------------------------------------------------------


def test_a_heading_that_is_half_a_turn_off_has_not_arrived(flying: Autopilot) -> None:
    """Its estimate is noisy: the mean of angles that are half a turn off this way and that is no turn at all."""
    here = Vector3(1.0, 2.0, flying.z)
    line = Line(Motion(here, math.pi), here, math.pi, Limits())
    go_to = FollowTrajectory("go_to", flying.task(TaskKind.GO_TO_WAYPOINT), line, ToleranceSettings())
    for update in range(150):
        flying.yaw_rad = 0.02 if update % 2 else -0.02
        assert not flying.step(go_to).has_ended
    flying.yaw_rad = math.pi - 0.02
    assert flying.until_end(go_to, 2.0) is None


# --- Landing ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def flying(autopilot: Autopilot) -> Autopilot:
    autopilot.z, autopilot.landed, autopilot.control = 5.0, LandedState.IN_AIR, Control.REFERENCES
    return autopilot


def land(autopilot: Autopilot, ack: Future[None]) -> Land:
    hold = Hold(Vector3(1.0, 2.0, autopilot.z), 0.5)
    return Land(autopilot.task(TaskKind.LAND), sent(ack, autopilot), hold, autopilot.snapshot())


def test_it_is_held_until_it_lands_by_itself_and_then_gets_nothing(flying: Autopilot, ack: Future[None]) -> None:
    landing = land(flying, ack)
    assert isinstance(flying.step(landing).setpoint, PositionSetpoint)
    flying.landed = LandedState.LANDING  # its landed state may come before its mode
    assert flying.step(landing) == Step()
    flying.control, flying.climb_m_s = Control.LAND, -1.0
    for _ in range(40):
        assert flying.step(landing) == Step()
    flying.landed = LandedState.ON_GROUND
    assert flying.step(landing) == Step(has_ended=True)


def test_a_landing_that_the_pilot_stops_is_his(flying: Autopilot, ack: Future[None]) -> None:
    landing = land(flying, ack)
    flying.control = Control.LAND
    flying.step(landing)
    flying.control = Control.OTHER
    error = flying.step(landing).error
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"


def test_a_landing_that_hangs_in_the_air_times_out_and_a_slow_one_does_not(
    flying: Autopilot, ack: Future[None]
) -> None:
    landing = land(flying, ack)
    flying.control, flying.climb_m_s, flying.z = Control.LAND, -0.25, 100.0
    landing = land(flying, ack)
    flying.control = Control.LAND
    for _ in range(3900):
        assert flying.step(landing) == Step()
    flying.climb_m_s = 0.0
    assert isinstance(flying.until_end(landing, 600.0), UalTimeoutError)


# --- Taking control back ----------------------------------------------------------------------------------------------


def test_recovering_holds_where_it_is_until_the_mode_changes(flying: Autopilot, ack: Future[None]) -> None:
    flying.control = Control.OTHER
    recover = Recover(sent(ack, flying), Limits())
    ack.set_result(None)
    setpoint = flying.step(recover).setpoint
    assert isinstance(setpoint, PositionSetpoint)
    assert setpoint.position == Vector3(1.0, 2.0, 5.0)
    flying.control = Control.REFERENCES
    step = flying.step(recover)
    assert step.has_ended
    assert step.error is None
    assert step.next_reference is not None


def test_recovering_ends_when_it_lands_meanwhile(flying: Autopilot, ack: Future[None]) -> None:
    flying.control = Control.OTHER
    recover = Recover(sent(ack, flying), Limits())
    flying.landed = LandedState.ON_GROUND
    error = flying.step(recover).error
    assert isinstance(error, TaskAbortedError)
    assert error.state == State.LANDED_ARMED.name
