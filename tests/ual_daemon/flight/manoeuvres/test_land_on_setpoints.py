"""Landing by velocities."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.snapshots import changed
from tests.ual_daemon.flight.hand_made import STEP_S, Autopilot
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual.geometry import Vector3
from ual.types import TaskKind
from ual_daemon.backends.values import Control, Freshness, LandedState, PositionSetpoint, Sample, VelocitySetpoint
from ual_daemon.flight.manoeuvres import land_on_setpoints as landing_module
from ual_daemon.flight.manoeuvres.land_on_setpoints import LandOnSetpoints
from ual_daemon.flight.manoeuvres.manoeuvre import Step
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import estimate
from ual_daemon.tracker.references import Hold

HERE = Vector3(1.0, 2.0, 0.0)


@dataclass
class Motors:
    """Motors that can be stopped: each attempt is noted, and answered or refused."""

    asked: int = 0
    answers: list[Future[None]] = field(default_factory=list)

    def stop(self) -> Future[None]:
        self.asked += 1
        self.answers.append(Future())
        return self.answers[-1]


@pytest.fixture
def motors() -> Motors:
    return Motors()


def land(autopilot: Autopilot, motors: Motors, *, ground_z_m: float = 0.0, descent_m_s: float = 2.0) -> LandOnSetpoints:
    hold = Hold(Vector3(1.0, 2.0, autopilot.z), 0.5)
    landing = LandOnSetpoints(autopilot.task(TaskKind.LAND), motors.stop, hold, autopilot.snapshot())
    landing._descent_m_s, landing._ground_z_m = descent_m_s, ground_z_m
    return landing


def step(landing: LandOnSetpoints, autopilot: Autopilot, after_s: float = STEP_S, **changes: Any) -> Step:
    """Steps with some values of the snapshot changed."""
    autopilot.time_s += after_s
    snapshot = changed(autopilot.snapshot(), **changes)
    return landing.step(snapshot, estimate(snapshot, Freshness()))


def velocity(step: Step) -> Vector3:
    assert isinstance(step.setpoint, VelocitySetpoint)
    assert step.setpoint.yaw_rate_rad_s == 0.0
    return step.setpoint.velocity


def at(autopilot: Autopilot, position: Vector3) -> Sample[Any]:
    pose = autopilot.snapshot().motion.pose
    assert pose is not None
    return Sample(replace(pose.value, position=position), autopilot.time_s + STEP_S)


@pytest.mark.parametrize(
    ("z", "descent_m_s", "expected"), [(5.1, 2.0, -1.0), (5.0, 2.0, -0.5), (80.0, 0.7, -0.7), (1.0, 0.2, -0.2)]
)
def test_it_descends_slowly_near_the_ground_and_never_faster_than_the_user_wants(
    flying: Autopilot, motors: Motors, z: float, descent_m_s: float, expected: float
) -> None:
    flying.z = z
    landing = land(flying, motors, descent_m_s=descent_m_s)
    assert velocity(step(landing, flying)) == Vector3(0.0, 0.0, expected)


def test_a_descent_that_the_user_wants_very_slow_is_not_abandoned(flying: Autopilot, motors: Motors) -> None:
    """It was told as stopped after two minutes, at 18 m."""
    flying.z = 30.0
    landing = land(flying, motors, descent_m_s=0.1)
    flying.climb_m_s = -0.1
    while flying.z > 0.1:
        assert not flying.step(landing).has_ended, flying.z


def test_where_the_ground_is_not_known_it_descends_slowly(flying: Autopilot, motors: Motors) -> None:
    flying.z = 80.0
    landing = LandOnSetpoints(
        flying.task(TaskKind.LAND), motors.stop, Hold(Vector3(1.0, 2.0, 80.0), 0.5), flying.snapshot()
    )
    assert velocity(step(landing, flying)).z == -0.5


def test_it_first_comes_to_rest_and_then_descends_where_it_is(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    fast = flying.snapshot().motion.velocity
    assert fast is not None
    moving = replace(fast.value, linear=Vector3(4.0, 0.0, 0.0))
    first = step(landing, flying, velocity=Sample(moving, flying.time_s + STEP_S))
    assert isinstance(first.setpoint, PositionSetpoint)
    elsewhere = HERE + Vector3(3.0, 0.0, 4.0)
    assert velocity(step(landing, flying, pose=at(flying, elsewhere))).horizontal_norm() == 0.0
    back = velocity(step(landing, flying, pose=at(flying, elsewhere - Vector3(0.5, 0.0, 0.0))))
    assert (back.x, back.y) == pytest.approx((0.4, 0.0))


def test_it_does_not_wait_for_ever_until_it_is_at_rest(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    sample = flying.snapshot().motion.velocity
    assert sample is not None
    moving = replace(sample.value, linear=Vector3(4.0, 0.0, 0.0))
    for _ in range(round(landing_module.LONGEST_STOP_S / STEP_S)):
        assert isinstance(
            step(landing, flying, velocity=Sample(moving, flying.time_s + STEP_S)).setpoint, PositionSetpoint
        )
    for _ in range(2):
        last = step(landing, flying, velocity=Sample(moving, flying.time_s + STEP_S))
    assert velocity(last).z == -0.5


@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0))
def test_it_is_led_back_over_its_position_and_not_faster_than_it_may(east_m: float, north_m: float) -> None:
    autopilot = Autopilot(z=8.0, landed=LandedState.IN_AIR, control=Control.REFERENCES)
    landing = land(autopilot, Motors())
    step(landing, autopilot)
    off = Vector3(east_m, north_m, 0.0)
    back = velocity(step(landing, autopilot, pose=at(autopilot, HERE + off + Vector3(0.0, 0.0, 8.0))))
    assert back.horizontal_norm() <= 1.0 + 1e-9
    assert back.x * off.x + back.y * off.y <= 0.0
    assert back.z == -1.0


def test_a_jump_of_the_estimate_moves_its_position_too(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    step(landing, flying)
    jump = Vector3(0.0, 3.0, 0.0)
    hold = Hold(HERE, 0.5)
    assert landing.estimate_jumped(EstimateJump(jump, 0.0), hold) is None
    moved = velocity(step(landing, flying, pose=at(flying, HERE + jump + Vector3(0.0, 0.0, 5.0))))
    assert (moved.x, moved.y) == (0.0, 0.0)


def test_it_is_not_led_aside_by_a_position_that_has_stopped_and_says_so(flying: Autopilot, motors: Motors) -> None:
    flying.z = 80.0
    landing = land(flying, motors)
    step(landing, flying)
    old = flying.snapshot()
    flying.time_s += 0.9
    assert old.motion.pose is not None
    old_pose = Sample(replace(old.motion.pose.value, position=HERE + Vector3(3.0, 0.0, 80.0)), old.time_s)
    assert velocity(step(landing, flying, 0.05, pose=old_pose)).horizontal_norm() > 0.5
    blind = step(landing, flying, 0.1, pose=old_pose)
    assert velocity(blind) == Vector3(0.0, 0.0, -0.5)
    assert landing.task is not None
    assert "descends without a position: take over" in landing.task.info().description
    assert velocity(step(landing, flying)).z == -1.0
    assert landing.task.info().description == ""


def test_a_velocity_that_has_stopped_is_reported(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    step(landing, flying, velocity=None)
    assert landing.task is not None
    assert "descends without a velocity" in landing.task.info().description


def test_without_a_mode_of_this_moment_nothing_is_sent(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    mode = flying.snapshot().control.mode
    assert step(landing, flying, 0.45, mode=mode).setpoint is not None
    assert step(landing, flying, 0.1, mode=mode) == Step()


@pytest.mark.parametrize("is_silent", [True, False])
def test_it_does_not_go_on_after_a_time_in_which_others_may_have_begun_to_fly(
    flying: Autopilot, motors: Motors, is_silent: bool
) -> None:
    landing = land(flying, motors)
    step(landing, flying)
    old = flying.snapshot()
    if is_silent:  # its mode alone
        ends = [step(landing, flying, 0.5, mode=old.control.mode) for _ in range(5)]
        assert not any(each.has_ended for each in ends[:4])
        error = ends[4].error
    else:  # our own thread
        error = step(landing, flying, 2.1).error
    assert isinstance(error, TaskAbortedError)
    assert "others may fly" in str(error)
    assert "command land again" in str(error)


def test_a_mode_that_is_not_known_any_more_ends_it(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    step(landing, flying)
    assert isinstance(step(landing, flying, mode=None).error, TaskAbortedError)


def test_a_lost_link_ends_it(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    flying.silent_s = 2.0
    assert isinstance(step(landing, flying).error, LinkLostError)


def test_it_does_not_go_on_where_the_values_may_be_those_of_another_vehicle(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    step(landing, flying)
    assert "two of them" in str(step(landing, flying, conflict="there are two of them").error)


def test_the_pilot_ends_it(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    step(landing, flying)
    flying.control = Control.OTHER
    ended = step(landing, flying)
    assert ended.is_taken
    assert isinstance(ended.error, TaskAbortedError)
    assert not motors.asked


def test_a_landing_that_is_held_above_the_ground_asks_for_the_pilot_and_ends(flying: Autopilot, motors: Motors) -> None:
    landing = land(flying, motors)
    for _ in range(90):
        step(landing, flying)
    assert landing.task is not None
    assert "has not descended for" in landing.task.info().description
    assert isinstance(flying.until_end(landing), UalTimeoutError)


def standing(flying: Autopilot, motors: Motors) -> LandOnSetpoints:
    landing = land(flying, motors)
    step(landing, flying)
    flying.landed, flying.z = LandedState.ON_GROUND, 0.0
    return landing


def test_on_the_ground_it_presses_down_until_its_motors_have_stopped(flying: Autopilot, motors: Motors) -> None:
    landing = standing(flying, motors)
    assert velocity(step(landing, flying)) == Vector3(0.0, 0.0, -0.5)
    assert motors.asked == 1
    flying.armed = False
    assert step(landing, flying) == Step(has_ended=True)


def test_motors_that_do_not_stop_at_first_are_stopped_again(flying: Autopilot, motors: Motors) -> None:
    landing = standing(flying, motors)
    step(landing, flying)
    motors.answers[0].set_exception(RejectedByAutopilotError("busy"))
    for _ in range(29):
        assert not step(landing, flying).has_ended
    assert motors.asked == 1
    for _ in range(3):
        step(landing, flying)
    assert motors.asked == 2


@pytest.mark.parametrize("is_refused", [True, False])
def test_motors_that_do_not_stop_are_reported(flying: Autopilot, motors: Motors, is_refused: bool) -> None:
    landing = standing(flying, motors)
    ended = step(landing, flying)
    while not ended.has_ended:
        if is_refused and not motors.answers[-1].done():
            motors.answers[-1].set_exception(RejectedByAutopilotError("busy"))
        ended = step(landing, flying)
    assert motors.asked == 3
    assert isinstance(ended.error, RejectedByAutopilotError if is_refused else UalTimeoutError)
    assert "its motors do not stop: stop them by hand, or disarm it" in str(ended.error)


def test_an_attempt_that_was_not_answered_is_withdrawn_before_the_next(flying: Autopilot, motors: Motors) -> None:
    landing = standing(flying, motors)
    for _ in range(40):
        step(landing, flying)
    assert [answer.cancelled() for answer in motors.answers] == [True, False]


def test_the_motors_of_a_pilot_who_took_over_on_the_ground_are_not_stopped(flying: Autopilot, motors: Motors) -> None:
    landing = standing(flying, motors)
    step(landing, flying)
    flying.control = Control.OTHER
    ended = step(landing, flying)
    for _ in range(15):
        if ended.has_ended:
            break
        assert ended == Step()
        ended = step(landing, flying)
    assert ended.is_taken
    assert motors.asked == 1


def test_control_that_ends_with_the_motors_is_no_take_over(flying: Autopilot, motors: Motors) -> None:
    landing = standing(flying, motors)
    step(landing, flying)
    flying.control = Control.OTHER
    step(landing, flying)
    flying.armed = False
    assert step(landing, flying) == Step(has_ended=True)


def test_its_height_is_reported(flying: Autopilot, motors: Motors) -> None:
    heights: list[float] = []
    landing = LandOnSetpoints(
        flying.task(TaskKind.LAND),
        motors.stop,
        Hold(HERE, 0.5),
        flying.snapshot(),
        on_height=heights.append,
    )
    step(landing, flying)
    assert heights == [5.0]
