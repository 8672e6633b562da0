"""Following a trajectory."""

from __future__ import annotations

import math

from tests.ual_daemon.flight.hand_made import Autopilot
from ual.geometry import Vector3
from ual.types import Limits, TaskKind
from ual_daemon.flight.manoeuvres.follow import FollowTrajectory
from ual_daemon.settings import ToleranceSettings
from ual_daemon.trajectory import Motion, StraightTrajectory


def test_a_heading_that_is_half_a_turn_off_has_not_arrived(flying: Autopilot) -> None:
    """With a noisy estimate, the errors are near +pi and -pi: their plain mean would be 0."""
    here = Vector3(1.0, 2.0, flying.z)
    line = StraightTrajectory(Motion(here, math.pi), here, math.pi, Limits())
    go_to = FollowTrajectory("go_to", flying.task(TaskKind.GO_TO_WAYPOINT), line, ToleranceSettings())
    for update in range(60):
        flying.yaw_rad = 0.02 if update % 2 else -0.02
        assert not flying.step(go_to).has_ended
    flying.yaw_rad = math.pi - 0.02
    assert flying.until_end(go_to, 2.0) is None
