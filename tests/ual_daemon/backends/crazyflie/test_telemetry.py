"""From logged values to snapshots."""

from __future__ import annotations

import math

import pytest

from ual_daemon.backends.crazyflie.telemetry import Telemetry


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
