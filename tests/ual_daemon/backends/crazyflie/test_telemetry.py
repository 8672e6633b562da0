"""From logged values to snapshots."""

from __future__ import annotations

import math

import pytest

from ual_daemon.backends.crazyflie.commander import MODES, Phase
from ual_daemon.backends.crazyflie.supervisor import SupervisorFlags
from ual_daemon.backends.crazyflie.telemetry import REST_TIME_S, CrazyflieTelemetry
from ual_daemon.backends.values import NEVER_S, Estimator, LandedState


def motion(x: float) -> dict[str, float]:
    values = {f"stateEstimate.{axis}": 0.0 for axis in "xyz"} | {f"stateEstimateZ.v{axis}": 0.0 for axis in "xyz"}
    return {**values, "stateEstimate.x": x, "stateEstimateZ.quat": 0, "supervisor.info": 0, "stabilizer.thrust": 0}


@pytest.mark.parametrize("x", [math.nan, math.inf, 3e38])
def test_a_position_that_cannot_be_true_is_no_pose_and_is_reported_once(
    x: float, caplog: pytest.LogCaptureFixture
) -> None:
    telemetry = CrazyflieTelemetry(0.5)
    telemetry.on_motion(motion(2.0), 1.0, 1.0, 1.0)
    for now_s in (1.1, 1.2):
        telemetry.on_motion(motion(x), now_s, now_s, now_s)
    assert telemetry.pose is not None
    assert (telemetry.pose.value.position.x, telemetry.pose.time_s) == (2.0, 1.0)
    (record,) = caplog.records
    assert record.getMessage().startswith("dropped: position of ")


@pytest.mark.parametrize("variance", [math.nan, math.inf])
@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("deck", [None, "deck.bcFlow2"])
def test_a_variance_that_is_not_finite_is_no_position(variance: float, axis: str, deck: str | None) -> None:
    telemetry = CrazyflieTelemetry(0.5)
    telemetry.parameters = {} if deck is None else {deck: 1.0}
    variances = {f"kalman.varP{each}": 1e-4 for each in "XYZ"}
    telemetry.on_status(variances, 1.0)
    assert estimator_of(telemetry).is_good
    telemetry.on_status(variances | {f"kalman.varP{axis}": variance}, 1.1)
    assert not estimator_of(telemetry).is_good
    assert "not finite" in estimator_of(telemetry).why


def estimator_of(telemetry: CrazyflieTelemetry) -> Estimator:
    estimator = telemetry.snapshot(1.2, MODES[Phase.SETPOINTS], "").motion.estimator
    assert estimator is not None
    return estimator.value


def moved(
    telemetry: CrazyflieTelemetry, now_s: float, thrust: int, climb_m_s: float, supervisor: int = SupervisorFlags.FLYING
) -> None:
    values = {"stabilizer.thrust": thrust, "stateEstimateZ.vz": climb_m_s * 1e3, "supervisor.info": supervisor}
    telemetry.on_motion(motion(0.0) | values, now_s, now_s, now_s)


def landed_of(telemetry: CrazyflieTelemetry) -> LandedState:
    landed = telemetry.snapshot(9.0, MODES[Phase.SETPOINTS], "").control.landed
    assert landed is not None
    assert (landed.time_s == NEVER_S) is (landed.value is LandedState.UNKNOWN)
    return landed.value


def test_what_is_lifted_by_a_hand_after_its_landing_is_on_the_ground_until_its_motors_run() -> None:
    telemetry = CrazyflieTelemetry(0.5)
    moved(telemetry, 1.0, 38800, -0.3)
    moved(telemetry, 1.1, 0, 0.0)
    assert landed_of(telemetry) is LandedState.IN_AIR
    moved(telemetry, 1.1 + REST_TIME_S, 0, 0.0)
    assert landed_of(telemetry) is LandedState.ON_GROUND
    moved(telemetry, 1.6, 0, 0.5)
    assert landed_of(telemetry) is LandedState.ON_GROUND
    moved(telemetry, 1.7, 1, 0.5)
    assert landed_of(telemetry) is LandedState.IN_AIR


def test_a_flight_whose_thrust_is_cut_for_a_moment_goes_on() -> None:
    telemetry = CrazyflieTelemetry(0.5)
    moved(telemetry, 1.0, 38800, -0.5)
    moved(telemetry, 1.1, 0, -1.0)
    assert landed_of(telemetry) is LandedState.IN_AIR
    moved(telemetry, 3.1, 0, -1.0, supervisor=0)
    assert landed_of(telemetry) is LandedState.ON_GROUND


def test_motion_without_thrust_that_is_received_first_is_neither_ground_nor_flight() -> None:
    telemetry = CrazyflieTelemetry(0.5)
    for step in range(3):
        moved(telemetry, 1.0 + step, 0, 0.5)
        assert landed_of(telemetry) is LandedState.UNKNOWN
    moved(telemetry, 4.0, 0, 0.5, supervisor=0)
    assert landed_of(telemetry) is LandedState.ON_GROUND
