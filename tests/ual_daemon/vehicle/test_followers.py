"""References that outlive their task and cannot go on: they say so, and hold for good until they are asked again."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator

import pytest

from tests.ual_daemon.stepped import Stepped, at, stepped
from ual.geometry import IDENTITY, Transform, Vector3
from ual_daemon.settings import GeofenceSettings, VehicleSettings

FENCE = GeofenceSettings(
    polygon=((-20.0, -20.0), (40.0, -20.0), (40.0, 20.0), (-20.0, 20.0)), min_height_m=-1.0, max_height_m=15.0
)


@pytest.fixture
def uav() -> Iterator[Stepped]:
    with stepped(VehicleSettings(geofence=FENCE)) as flying:
        flying.fly()
        yield flying


def put(uav: Stepped, x: float, z: float = 0.0, parent: str = "uav_1/odom") -> None:
    uav.vehicle.frame_editor.add(Transform(Vector3(x, 0.0, z), IDENTITY, parent, "boat"))


def follow(uav: Stepped) -> None:
    """Catches up with the boat, which then goes on, and the task has ended."""
    put(uav, 5.0)
    put(uav, 5.01)
    uav.end(uav.prepare.go_to_waypoint(at(0.0, 0.0, 4.0, frame_id="boat")).begin().future)
    put(uav, 5.02)
    uav.run(1.0)
    assert_reported(uav, "")


def assert_reported(uav: Stepped, what: str) -> None:
    sample = uav.vehicle.telemetry()
    checks = () if sample.health is None else sample.health.failing_checks
    assert ("does not follow" in sample.state_reason) is bool(what)
    assert any("does not follow" in each for each in checks) is bool(what)
    if what:
        assert what in sample.state_reason
        assert any(what in each for each in checks)


LOSSES: dict[str, tuple[Callable[[Stepped], None], str]] = {
    "beyond the fence": (lambda uav: put(uav, 70.0), "geofence"),
    "above the ceiling": (lambda uav: put(uav, 5.0, 30.0), "geofence"),
    "below the floor": (lambda uav: put(uav, 5.0, -10.0), "below the floor"),
    "below the body": (lambda uav: put(uav, 5.0, parent="uav_1/base_link"), "the frame boat hangs below"),
    "removed": (lambda uav: uav.vehicle.frame_editor.remove("boat"), "boat"),
}


@pytest.mark.parametrize("loss", LOSSES)
def test_a_follower_that_cannot_follow_says_so_and_then_holds_for_good(
    uav: Stepped, loss: str, caplog: pytest.LogCaptureFixture
) -> None:
    """It stood without a word, and set off by itself once its frame was back."""
    caplog.set_level(logging.INFO)
    lose, what = LOSSES[loss]
    follow(uav)
    lose(uav)
    uav.run(1.0)
    assert_reported(uav, what)
    assert [each.levelname for each in caplog.records if each.getMessage().startswith("reference_stands")] == [
        "WARNING"
    ]
    uav.run(5.0)
    assert_reported(uav, what)
    assert "until it is commanded again" in uav.vehicle.telemetry().state_reason
    assert sum(each.getMessage().startswith("reference_ended") for each in caplog.records) == 1
    stood = uav.pose.position
    put(uav, 30.0)
    uav.run(5.0)
    assert (uav.pose.position - stood).norm() < 0.2
    assert_reported(uav, what)
    uav.end(uav.prepare.go_to_waypoint(at(0.0, 0.0, 3.0)).begin().future)
    assert_reported(uav, "")


def test_a_follower_goes_on_where_its_frame_is_back_at_once(uav: Stepped, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    follow(uav)
    put(uav, 70.0)
    uav.run(3.0)
    put(uav, 12.0)
    uav.run(6.0)
    assert uav.pose.position.x == pytest.approx(12.0, abs=0.3)
    assert_reported(uav, "")
    assert sum(each.getMessage().startswith("reference_goes_on") for each in caplog.records) == 1


def test_a_frame_at_the_edge_is_one_message_in_the_log(uav: Stepped, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    follow(uav)
    for step in range(40):
        put(uav, 41.0 if step % 2 else 6.0)
        uav.run(0.2)
    assert sum(each.getMessage().startswith("reference_stands") for each in caplog.records) == 1
