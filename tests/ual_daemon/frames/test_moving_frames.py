"""Motion of goals in frames that a client moves."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ual.geometry import IDENTITY, Pose, PoseStamped, Quaternion, Transform, Vector3
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.frames.tree import MAP
from ual_daemon.settings import VehicleSettings


def test_an_update_while_a_goal_is_looked_up_is_no_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """A client's thread moves the boat between the two looks that give the goal's velocity."""
    frames = FrameResolver("uav_1", VehicleSettings())

    def put(x_m: float, now_s: float) -> None:
        frames.tree.add(Transform(Vector3(x_m, 0.0, 0.0), IDENTITY, MAP, "boat"), now_s)

    for step in range(20):
        put(0.5 * step, 0.1 * step)
    goal = frames.goal(PoseStamped(Pose(Vector3(0.0, 0.0, 5.0), Quaternion()), "boat"), "waypoint")
    lookup: Callable[..., Transform] = frames.tree.lookup

    def lookup_and_put(*arguments: object) -> Transform:
        found = lookup(*arguments)
        put(10.5, 2.0)
        return found

    monkeypatch.setattr(frames.tree, "lookup", lookup_and_put)
    motion = frames.moving_to_local(goal, 1.95, 0.0)
    assert motion.position.x == pytest.approx(9.75, abs=0.01)
    assert motion.velocity.x == pytest.approx(5.0, abs=0.01)
