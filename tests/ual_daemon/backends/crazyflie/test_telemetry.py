"""From logged values to snapshots."""

from __future__ import annotations

import math

import pytest

from ual_daemon.backends.crazyflie.commander import MODES, Phase
from ual_daemon.backends.crazyflie.telemetry import Telemetry
from ual_daemon.backends.values import Estimator


def motion(x: float) -> dict[str, float]:
    values = {f"stateEstimate.{axis}": 0.0 for axis in "xyz"} | {f"stateEstimateZ.v{axis}": 0.0 for axis in "xyz"}
    return {**values, "stateEstimate.x": x, "stateEstimateZ.quat": 0, "supervisor.info": 0, "stabilizer.thrust": 0}


@pytest.mark.parametrize("x", [math.nan, math.inf, 3e38])
def test_a_position_that_cannot_be_true_is_no_pose_and_is_told_once(x: float, caplog: pytest.LogCaptureFixture) -> None:
    telemetry = Telemetry(0.5)
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
    telemetry = Telemetry(0.5)
    telemetry.parameters = {} if deck is None else {deck: 1.0}
    variances = {f"kalman.varP{each}": 1e-4 for each in "XYZ"}
    telemetry.on_status(variances, 1.0)
    assert estimator_of(telemetry).is_good
    telemetry.on_status(variances | {f"kalman.varP{axis}": variance}, 1.1)
    assert not estimator_of(telemetry).is_good
    assert "not finite" in estimator_of(telemetry).why


def estimator_of(telemetry: Telemetry) -> Estimator:
    estimator = telemetry.snapshot(1.2, MODES[Phase.SETPOINTS], "").estimator
    assert estimator is not None
    return estimator.value
