"""Learning of a vehicle's response in flight: a point mass with drag, wind and an estimator that contradicts itself."""

from __future__ import annotations

import logging
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual_daemon.backends.mavlink.fakes import Harness, heartbeat
from ual.geometry import Pose, Quaternion, Vector3
from ual_daemon.backends.firmwares.feed_forward import (
    GRAVITY_M_S2,
    MOST_LEAD_M_S2,
    MOST_VELOCITY_ERROR_M_S,
    FeedForward,
)
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.values import PositionSetpoint, VelocitySetpoint

STEP_S = 0.02
STILL = Vector3()


def tilted(acceleration: Vector3) -> Quaternion:
    """The orientation whose thrust accelerates so: gravity made up for, and no more vertically."""
    thrust = Vector3(acceleration.x, acceleration.y, GRAVITY_M_S2)
    axis = Vector3(0.0, 0.0, 1.0).cross(thrust)
    if axis.norm() < 1e-12:
        return Quaternion()
    angle = math.atan2(axis.norm(), thrust.z)
    axis = axis / axis.norm() * math.sin(angle / 2.0)
    return Quaternion(axis.x, axis.y, axis.z, math.cos(angle / 2.0))


def fly(
    learner: FeedForward, drag_1_s: float, wind: Vector3 = STILL, drift: Vector3 = STILL, duration_s: float = 30.0
) -> None:
    """Out and back along x. `wind` is its push in m/s^2, `drift` how the position moves beside the velocity."""
    position = STILL
    for step in range(round(duration_s / STEP_S)):
        time_s = step * STEP_S
        velocity = Vector3(4.0 * math.sin(0.8 * time_s), 0.0, 0.0)
        acceleration = Vector3(3.2 * math.cos(0.8 * time_s), 0.0, 0.0)
        position = position + (velocity + drift) * STEP_S
        pull = acceleration + velocity * drag_1_s - wind
        learner.learn(time_s, Pose(position, tilted(pull)), velocity)


@pytest.mark.parametrize("drag_1_s", [0.2, 0.5, 1.0])
def test_drag_is_learnt_from_the_tilt_that_it_takes_to_fly(drag_1_s: float) -> None:
    learner = FeedForward()
    fly(learner, drag_1_s)
    assert learner.drag_1_s == pytest.approx(drag_1_s, rel=0.06, abs=0.03)


def test_a_steady_wind_is_not_taken_for_drag() -> None:
    learner = FeedForward()
    fly(learner, 0.3, wind=Vector3(1.0, -2.0, 0.0))
    assert learner.drag_1_s == pytest.approx(0.3, abs=0.03)


def test_where_there_is_no_drag_none_is_reported() -> None:
    learner = FeedForward()
    fly(learner, 0.0)
    setpoint = PositionSetpoint(STILL, 0.0, Vector3(5.0, 0.0, 0.0), Vector3(1.0, 0.0, 0.0))
    assert learner.apply(setpoint, 0.0).acceleration.x == pytest.approx(1.0, abs=0.1)


def test_hovering_teaches_nothing_of_drag() -> None:
    learner = FeedForward()
    for step in range(1000):
        learner.learn(step * STEP_S, Pose(STILL, tilted(Vector3(0.5, 0.0, 0.0))), Vector3(0.1, 0.0, 0.0))
    assert learner.drag_1_s == 0.0


def test_a_drag_that_is_expected_counts_from_the_first_setpoint_on() -> None:
    fast = PositionSetpoint(STILL, 0.0, Vector3(4.0, -2.0, 1.0))
    assert FeedForward(0.5).apply(fast, 0.0).acceleration == Vector3(2.0, -1.0, 0.0)


@pytest.mark.parametrize("drag_1_s", [0.0, 0.3, 1.0])
def test_a_drag_that_was_expected_wrongly_is_learned_all_the_same(
    drag_1_s: float, caplog: pytest.LogCaptureFixture
) -> None:
    learner = FeedForward(0.6)
    with caplog.at_level(logging.INFO):
        fly(learner, drag_1_s)
    assert learner.drag_1_s == pytest.approx(drag_1_s, abs=0.05)
    assert "drag_learned" in caplog.text


def test_a_drag_that_was_expected_rightly_is_not_reported_again(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        fly(FeedForward(0.5), 0.5)
    assert not caplog.records


def test_a_velocity_that_the_position_contradicts_is_corrected() -> None:
    learner = FeedForward()
    fly(learner, 0.0, drift=Vector3(0.0, -0.3, 0.2))
    assert learner.velocity_error.y == pytest.approx(0.3, abs=0.01)
    assert learner.velocity_error.z == pytest.approx(-0.2, abs=0.01)
    told = learner.apply(PositionSetpoint(STILL, 0.0), 0.0).velocity
    assert told.y == pytest.approx(0.3, abs=0.01)


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_no_correction_of_the_velocity_is_larger_than_the_most(x: float, y: float) -> None:
    learner = FeedForward()
    for step in range(100):
        learner.learn(step * STEP_S, Pose(Vector3(x, y, 0.0) * (step * STEP_S)), STILL)
        assert learner.velocity_error.norm() <= MOST_VELOCITY_ERROR_M_S + 1e-9


@pytest.mark.parametrize("jump_s", [-10.0, 1.0])
def test_after_a_gap_or_a_boot_the_correction_begins_anew(jump_s: float) -> None:
    learner = FeedForward()
    fly(learner, 0.0, drift=Vector3(0.3, 0.0, 0.0), duration_s=20.0)
    learner.learn(20.0 + jump_s, Pose(Vector3(100.0, 0.0, 0.0)), STILL)
    assert learner.velocity_error == STILL


def test_at_rest_a_setpoint_stays_as_it_is() -> None:
    learner = FeedForward()
    for step in range(100):
        learner.learn(step * STEP_S, Pose(), STILL)
        setpoint = PositionSetpoint(Vector3(1.0, 2.0, 3.0), 0.5)
        assert learner.apply(setpoint, step * STEP_S) == setpoint


def test_an_acceleration_that_grows_is_reported_early() -> None:
    learner = FeedForward()
    for step in range(50):
        setpoint = PositionSetpoint(STILL, 0.0, acceleration=Vector3(2.0 * step * STEP_S, 0.0, 0.0))
        told = learner.apply(setpoint, step * STEP_S)
    assert told.acceleration.x == pytest.approx(2.0 * (49 * STEP_S + 0.2), abs=0.08)


def test_one_that_jumps_is_no_kick() -> None:
    learner = FeedForward()
    learner.apply(PositionSetpoint(STILL, 0.0), 0.0)
    told = learner.apply(PositionSetpoint(STILL, 0.0, acceleration=Vector3(10.0, 0.0, 0.0)), STEP_S)
    assert told.acceleration.x == pytest.approx(10.0 + MOST_LEAD_M_S2)


@pytest.mark.parametrize("learns", [True, False])
def test_it_can_be_switched_off(learns: bool) -> None:
    harness = Harness(MavlinkSettings(learns_feed_forward=learns))
    harness.receive(heartbeat())
    for i, acceleration in enumerate((STILL, Vector3(1.0))):
        _, sent = harness.session.setpoint_encoder.encode(PositionSetpoint(STILL, 0.0, STILL, acceleration), 0.02 * i)
    assert (sent.afy == pytest.approx(1.0)) is not learns  # x here is east, y there


def test_a_reset_of_the_estimate_is_not_learned_as_a_velocity() -> None:
    feed_forward = FeedForward()
    for step in range(100):
        jumped_m = 5.0 if step >= 50 else 0.0
        feed_forward.learn(step * 0.02, Pose.at(jumped_m, 0.0, 3.0), Vector3())
        assert feed_forward.velocity_error.norm() < 1e-6


def test_a_steady_speed_is_no_error_however_seldom_positions_come() -> None:
    for step_s in (0.02, 0.05, 0.1):
        learner = FeedForward()
        for step in range(round(3.0 / step_s)):
            position = Vector3(5.0 * step * step_s, 0.0, 0.0)
            learner.learn(step * step_s, Pose(position, Quaternion()), Vector3(5.0, 0.0, 0.0))
        assert learner.velocity_error.norm() < 1e-6  # it was 0.5 m/s at 10 Hz


def test_a_velocity_is_sent_as_it_is_executed_with_the_acceleration_that_leads_to_it() -> None:
    """PX4's own answer: a (1 + D) = P (commanded - v), with the drag added."""
    learner, commanded = FeedForward(0.5), Vector3(2.0, -1.0, 0.5)
    flown = Vector3()
    learner.apply(PositionSetpoint(STILL, 0.0), 0.0)
    for step in range(1, 400):
        sent = learner.apply(VelocitySetpoint(commanded, 0.3), step * STEP_S)
        assert sent.acceleration is not None
        missing = commanded - sent.velocity
        assert sent.acceleration.x == pytest.approx(1.8 * missing.x + 0.5 * sent.velocity.x)
        assert sent.acceleration.y == pytest.approx(1.8 * missing.y + 0.5 * sent.velocity.y)
        assert (sent.velocity.z, sent.acceleration.z, sent.yaw_rate_rad_s) == (0.5, 0.0, 0.3)
        gained = (sent.velocity - flown).x / STEP_S
        assert gained * 1.2 == pytest.approx(1.8 * (commanded.x - (sent.velocity.x + flown.x) / 2), abs=0.02)
        flown = sent.velocity
    assert (flown - commanded).norm() < 0.01


def test_the_gains_are_those_that_were_read() -> None:
    parameters: dict[str, float] = {}
    learner = FeedForward(0.0, parameters)
    parameters.update({"MPC_XY_VEL_P_ACC": 3.0, "MPC_XY_VEL_D_ACC": 0.5})
    learner.apply(PositionSetpoint(STILL, 0.0), 0.0)
    sent = learner.apply(VelocitySetpoint(Vector3(1.0)), 0.5)
    assert sent.velocity.x == pytest.approx(1.0 - math.exp(-1.0))
    assert sent.acceleration is not None
    assert sent.acceleration.x == pytest.approx(3.0 * math.exp(-1.0))


def test_no_velocity_asks_for_more_than_a_tilt_of_45_degrees() -> None:
    learner = FeedForward()
    learner.apply(PositionSetpoint(STILL, 0.0, Vector3(-6.0, 8.0)), 0.0)
    velocity = Vector3(-6.0, 8.0)
    for step in range(1, 400):
        sent = learner.apply(VelocitySetpoint(Vector3(6.0, -8.0)), step * STEP_S)
        assert sent.acceleration is not None
        assert sent.acceleration.norm() <= GRAVITY_M_S2 + 1e-9
        assert (sent.velocity - velocity).norm() <= GRAVITY_M_S2 * STEP_S / 1.2 + 1e-9
        velocity = sent.velocity
    assert (velocity - Vector3(6.0, -8.0)).norm() < 0.01


def test_a_velocity_after_a_pause_is_sent_as_it_is() -> None:
    learner = FeedForward()
    learner.apply(PositionSetpoint(STILL, 0.0), 0.0)
    sent = learner.apply(VelocitySetpoint(Vector3(2.0, -1.0)), 60.0)
    assert (sent.velocity - Vector3(2.0, -1.0)).norm() < 1e-9
    assert sent.acceleration is not None
    assert sent.acceleration.norm() < 1e-9


def test_a_velocity_after_a_flight_to_a_goal_begins_with_the_motion_of_that() -> None:
    learner = FeedForward(0.5)
    learner.apply(PositionSetpoint(STILL, 0.0, Vector3(4.0)), 1.0)
    sent = learner.apply(VelocitySetpoint(STILL), 1.0)
    assert sent.velocity == Vector3(4.0)
    assert sent.acceleration is not None
    assert (sent.acceleration - Vector3(-1.8 * 4.0 + 0.5 * 4.0)).norm() < 1e-9
