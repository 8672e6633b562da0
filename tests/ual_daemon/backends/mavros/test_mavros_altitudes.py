"""Altitudes that are no numbers: rosbridge writes them as null."""

from __future__ import annotations

from typing import Any

import pytest

from ual.geometry import Vector3
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.autopilot import HomeUnknownError
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.telemetry import MavrosTelemetry
from ual_daemon.backends.rosbridge import Message

PLACE: Message = {"latitude": 47.0, "longitude": 8.0}
HERE: Message = {**PLACE, "altitude": 547.0}


class Lab:
    """An ArduCopter through MAVROS that stands at its home, 500 m above mean sea level."""

    def __init__(self) -> None:
        self.telemetry = MavrosTelemetry(ArduCopter(), LinkWatch("bridge", 1.0), lambda: 0.0)
        self.take(topics.FIX, {**HERE, "status": {"status": 0}, "position_covariance_type": 0})
        self.take(topics.GPS_RAW, {"lat": 470000000, "lon": 80000000, "alt": 500000, "fix_type": 3})
        self.take(topics.POSE, {"pose": {"position": xyz(Vector3()), "orientation": {**xyz(Vector3()), "w": 1.0}}})

    def take(self, topic: str, message: Message) -> None:
        """MAVROS publishes something."""
        self.telemetry.update(topic, message, 0.0)

    @property
    def climb_m(self) -> float:
        """The altitude above home of a take-off to 5 m."""
        return ArduCopter().takeoff_altitude_m(5.0, self.telemetry.snapshot(0.0))


def xyz(of: Vector3) -> dict[str, Any]:
    return {"x": of.x, "y": of.y, "z": of.z}


@pytest.fixture
def lab() -> Lab:
    return Lab()


def test_a_take_off_counts_from_home(lab: Lab) -> None:
    lab.take(topics.ORIGIN, {"position": HERE})
    lab.take(topics.HOME, {"geo": {**HERE, "altitude": 546.0}})
    assert lab.climb_m == pytest.approx(6.0)


@pytest.mark.parametrize("altitude_m", [None, 1e9])
def test_a_home_at_no_altitude_is_none(lab: Lab, altitude_m: float | None) -> None:
    lab.take(topics.ORIGIN, {"position": HERE})
    lab.take(topics.HOME, {"geo": {**PLACE, "altitude": altitude_m}})
    assert lab.telemetry.snapshot(0.0).earth.home_altitude_amsl_m is None
    with pytest.raises(HomeUnknownError):
        assert lab.climb_m


def test_an_origin_at_no_altitude_is_none(lab: Lab) -> None:
    lab.take(topics.ORIGIN, {"position": {**PLACE, "altitude": None}})
    assert lab.telemetry.snapshot(0.0).earth.projection is None


def test_a_height_above_home_that_is_none_is_not_climbed_from(lab: Lab) -> None:
    lab.take(topics.GLOBAL, HERE)
    lab.take(topics.ABOVE_HOME, {"data": None})
    with pytest.raises(HomeUnknownError):
        assert lab.climb_m


def test_a_position_at_no_altitude_is_none(lab: Lab) -> None:
    lab.take(topics.GLOBAL, {**PLACE, "altitude": None})
    assert lab.telemetry.snapshot(0.0).motion.position_geo is None


def test_a_home_at_latitude_and_longitude_0_is_not_on_earth(lab: Lab) -> None:
    lab.take(topics.HOME, {"geo": {"latitude": 0.0, "longitude": 0.0, "altitude": 546.0}})
    earth = lab.telemetry.snapshot(0.0).earth
    assert earth.home_geo is None
    assert earth.home_altitude_amsl_m == pytest.approx(499.0)
