"""Paths that hold at waypoints. In stepped time."""

from __future__ import annotations

import math

import pytest

from tests.ual_daemon.stepped import UPDATE_S, Stepped, at, stepped
from tests.ual_daemon.tracker.test_tracker import assert_sent_within, wiretap
from ual.errors import InvalidArgumentError
from ual.geometry import Vector3
from ual.types import TaskStatus
from ual_daemon.settings import Tracker, VehicleSettings

CORNERS = [Vector3(4, 0, 3), Vector3(4, 4, 3), Vector3(0, 4, 3)]
GOALS = [at(*corner) for corner in CORNERS]


def rest_s(uav: Stepped, place: Vector3) -> float:
    """For how long it stood at a place."""
    count = sum(
        sample.pose is not None
        and (sample.pose.position - place).norm() < 0.2
        and sample.velocity is not None
        and sample.velocity.linear.norm() < 0.05
        for sample in uav.samples
    )
    return count * UPDATE_S


WAYS = {
    "reference": (VehicleSettings(), {}),
    "pursuit": (VehicleSettings(tracker=Tracker.PURSUIT), {}),
    "positions": (VehicleSettings(), {"takes": "positions"}),
}


@pytest.mark.parametrize(("settings", "light"), list(WAYS.values()), ids=list(WAYS))
@pytest.mark.parametrize("radius_m", [0.0, 1.0])
def test_it_holds_at_the_waypoints_that_say_so(
    settings: VehicleSettings, light: dict[str, str], radius_m: float
) -> None:
    with stepped(settings, light=light) as uav:
        uav.fly()
        uav.run(1.0)
        uav.keep_samples()
        task = uav.prepare.follow_path(GOALS, corner_radius_m=radius_m, holds_s=[5.0, 0.0, 4.0]).begin()
        uav.until(lambda: task.info().waypoint_index == 0 and rest_s(uav, CORNERS[0]) > 2.0)
        uav.end(task.future)
        assert task.info().status is TaskStatus.SUCCEEDED
        assert 4.8 <= rest_s(uav, CORNERS[0]) <= 7.5  # it arrives before it stands quite still
        assert rest_s(uav, CORNERS[1]) <= 2.0
        assert rest_s(uav, CORNERS[2]) >= 3.0


def test_a_dry_run_includes_the_holds_and_nothing_is_beyond_the_limits() -> None:
    with stepped() as uav:
        uav.fly()
        uav.run(1.0)
        without = uav.prepare.follow_path(GOALS).plan
        plan = uav.prepare.follow_path(GOALS, holds_s=[3.0, 2.0, 0.0]).plan
        assert without.duration_s is not None
        assert plan.duration_s == pytest.approx(without.duration_s + 5.0)
        assert plan.length_m == without.length_m
        limits = uav.vehicle.info().limits
        with wiretap(uav) as sent:
            task = uav.prepare.follow_path(GOALS, holds_s=[3.0, 2.0, 0.0]).begin()
            uav.end(task.future)
        assert_sent_within(sent, limits)


def test_a_long_hold_does_not_time_out_and_can_be_paused() -> None:
    with stepped() as uav:
        uav.fly()
        task = uav.prepare.follow_path(GOALS[:2], holds_s=[60.0, 0.0]).begin()
        uav.run(50.0)
        uav.vehicle.commands.pause()
        uav.run(250.0)  # longer than the whole path may take, with its hold
        uav.vehicle.commands.resume()
        uav.run(8.0)
        assert (uav.pose.position - CORNERS[0]).norm() < 0.1
        assert task.info().status.name == "RUNNING"
        uav.end(task.future, 60.0)


def test_a_hold_where_it_is_already() -> None:
    with stepped() as uav:
        uav.fly()
        here = uav.pose.position
        task = uav.prepare.follow_path([at(here.x, here.y, here.z)], holds_s=[3.0]).begin()
        uav.run(2.5)
        assert not task.future.done()
        uav.end(task.future, 5.0)


@pytest.mark.parametrize(
    ("holds_s", "what"),
    [
        ([1.0], "1 for 3 waypoints"),
        ([1.0, -1.0, 0.0], r"holds_s\[1\]: -1 is negative"),
        ([1.0, math.nan, 0.0], r"holds_s\[1\]"),
        ([3601.0, 0.0, 0.0], r"holds_s\[0\].*3600"),
        (["1", 0.0, 0.0], r"holds_s\[0\]"),
    ],
)
def test_holds_that_are_none_are_refused(holds_s: list[float], what: str) -> None:
    with stepped() as uav:
        uav.fly()
        with pytest.raises(InvalidArgumentError, match=what):
            uav.prepare.follow_path(GOALS, holds_s=holds_s)
