"""Impossible data of an aircraft is dropped, as by every backend of a real autopilot."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from typing_extensions import override

from ual.geometry import Vector3
from ual.types import Battery
from ual_daemon.backends.dji import modes
from ual_daemon.backends.dji.settings import DjiSettings
from ual_daemon.backends.dji.telemetry import DjiTelemetry
from ual_daemon.backends.dji.wrappers import WRAPPERS, Wrapper
from ual_daemon.backends.engine.readings import Reading
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.values import Snapshot

NOW_S = 1.0


def reported(**messages: Message) -> Snapshot:
    """The snapshot after an aircraft of dji_osdk_ros has said everything, with some of it in other words."""
    usual: dict[str, Message] = {
        "on_gps_level": {"data": 5},
        "on_attitude": {"quaternion": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}},
        "on_velocity": {"vector": {"x": 1.0, "y": 0.0, "z": 0.0}},
        "on_body_rates": {"vector": {"x": 0.0, "y": 0.0, "z": 0.1}},
        "on_position": {"latitude": 37.0, "longitude": -6.0, "altitude": 20.0},
    }
    telemetry = DjiTelemetry(next(each for each in WRAPPERS if not each.has_sea_level), DjiSettings())
    for name, message in {**usual, **messages}.items():
        telemetry.on_message(name, message, NOW_S)
    return telemetry.snapshot(NOW_S)


def test_what_can_be_true_is_taken() -> None:
    snapshot = reported()
    assert snapshot.motion.pose is not None
    assert snapshot.motion.position_geo is not None
    assert snapshot.motion.velocity is not None
    assert snapshot.motion.velocity.value.linear.x == 1.0
    assert snapshot.motion.velocity.value.angular.z == pytest.approx(0.1)


@pytest.mark.parametrize(
    "place",
    [
        {"latitude": 214.0, "longitude": -6.0, "altitude": 20.0},
        {"latitude": 37.0, "longitude": 3e38, "altitude": 20.0},
        {"latitude": 37.0, "longitude": -6.0, "altitude": 3e38},
        {"latitude": 37.0, "longitude": -6.0, "altitude": math.nan},
    ],
)
def test_an_impossible_position_is_no_pose(place: Message) -> None:
    snapshot = reported(on_position=place)
    assert snapshot.motion.pose is None
    assert snapshot.motion.position_geo is None


@pytest.mark.parametrize(
    ("status", "height_m", "home_m"),
    [
        (modes.STOPPED, 0.3, 20.0),
        (modes.ON_GROUND, None, 20.0),
        (modes.IN_AIR, 12.0, 8.0),
        (modes.IN_AIR, None, None),
        (modes.IN_AIR, math.nan, None),
        (None, 12.0, None),
    ],
)
def test_home_is_on_the_ground_also_where_the_daemon_was_started_in_the_air(
    status: int | None, height_m: float | None, home_m: float | None
) -> None:
    """It was where the aircraft was then: 120 m of ceiling counted from there, and so did goals above home."""
    said: dict[str, Message] = {"on_flight_status": {"data": status}} if status is not None else {}
    said |= {"on_height": {"data": height_m}} if height_m is not None else {}
    position = {"latitude": 37.0, "longitude": -6.0, "altitude": 20.0}
    telemetry = DjiTelemetry(next(each for each in WRAPPERS if not each.has_sea_level), DjiSettings())
    level = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    usual: dict[str, Message] = {"on_gps_level": {"data": 5}, "on_attitude": {"quaternion": level}}
    for name, message in {**usual, **said, "on_position": position}.items():
        telemetry.on_message(name, message, NOW_S)
    assert telemetry.snapshot(NOW_S).earth.home_altitude_amsl_m == home_m
    if home_m is not None:
        telemetry.on_message("on_position", {**position, "altitude": 50.0}, NOW_S + 0.02)
        assert telemetry.snapshot(NOW_S).earth.home_altitude_amsl_m == home_m


def test_home_is_where_the_motors_were_started_last() -> None:
    """It was carried to a field 50 m higher: 30 m above home were 20 m below that."""
    telemetry = DjiTelemetry(next(each for each in WRAPPERS if not each.has_sea_level), DjiSettings())
    place, now_s, found = {"latitude": 37.0, "longitude": -6.0}, NOW_S, []
    telemetry.on_message("on_gps_level", {"data": 5}, now_s)
    telemetry.on_message("on_attitude", {"quaternion": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}, now_s)
    for status, altitude_m in (
        (modes.STOPPED, 20.0),
        (modes.STOPPED, 70.0),
        (modes.ON_GROUND, 70.0),
        (modes.IN_AIR, 99.0),
    ):
        now_s += 0.02
        telemetry.on_message("on_flight_status", {"data": status}, now_s)
        telemetry.on_message("on_position", {**place, "altitude": altitude_m}, now_s)
        found.append(telemetry.snapshot(now_s).earth.home_altitude_amsl_m)
    assert found == [20.0, 20.0, 70.0, 70.0]


@pytest.mark.parametrize("quaternion", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (2.0, 0.0, 0.0, 1.0)])
def test_an_impossible_attitude_is_no_pose(quaternion: tuple[float, ...]) -> None:
    assert reported(on_attitude={"quaternion": dict(zip("xyzw", quaternion, strict=True))}).motion.pose is None


@pytest.mark.parametrize("speed_m_s", [math.nan, math.inf, 3e38])
def test_an_impossible_velocity_is_none(speed_m_s: float) -> None:
    assert reported(on_velocity={"vector": {"x": speed_m_s, "y": 0.0, "z": 0.0}}).motion.velocity is None


def test_impossible_rates_are_not_taken() -> None:
    snapshot = reported(on_body_rates={"vector": {"x": 0.0, "y": 0.0, "z": math.nan}})
    assert snapshot.motion.velocity is not None
    assert snapshot.motion.velocity.value.angular.z == 0.0


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0, ""),
        (22, "motor start error 22: it is not activated: activate it with DJI's program"),
        (23, "motor start error 23: it is in a no-fly zone"),
        (999, "motor start error 999"),
    ],
)
def test_why_its_motors_do_not_start_is_reported_in_words(number: int, text: str) -> None:
    telemetry = DjiTelemetry(WRAPPERS[0], DjiSettings())
    telemetry.on_motor_error({"data": number}, 0.0)
    assert telemetry.why_not_start == text


def test_the_mode_of_the_ground_may_come_before_the_ground() -> None:
    telemetry = DjiTelemetry(next(each for each in WRAPPERS if not each.has_sea_level), DjiSettings())
    telemetry.on_flight_status({"data": modes.IN_AIR}, 1.0)
    for mode, now_s in ((modes.AUTO_LANDING, 1.0), (modes.SDK_CONTROL, 1.02), (modes.AUTO_LANDING, 1.04)):
        telemetry.on_display_mode({"data": mode}, now_s)  # the second one has come late
    for now_s in (5.0, 5.05):
        telemetry.on_display_mode({"data": modes.P_GPS}, now_s)
    assert telemetry.is_landing
    telemetry.on_flight_status({"data": modes.STOPPED}, 5.06)
    telemetry.on_display_mode({"data": modes.P_GPS}, 5.07)
    assert not telemetry.is_landing


def test_a_landing_that_is_ended_in_the_air_is_reported_soon() -> None:
    telemetry = DjiTelemetry(next(each for each in WRAPPERS if not each.has_sea_level), DjiSettings())
    telemetry.on_flight_status({"data": modes.IN_AIR}, 1.0)
    telemetry.on_display_mode({"data": modes.AUTO_LANDING}, 1.0)
    telemetry.on_display_mode({"data": modes.P_GPS}, 2.0)
    assert telemetry.is_landing
    telemetry.on_display_mode({"data": modes.P_GPS}, 2.11)
    assert not telemetry.is_landing


class _Vanishing(Reading[Any]):
    """Another thread discards the value as soon as it was read once."""

    __slots__ = ()

    @override
    def __getattribute__(self, name: str) -> object:
        found = super().__getattribute__(name)
        if name == "sample":
            self.discard()
        return found


@pytest.mark.parametrize("wrapper", WRAPPERS, ids=lambda wrapper: wrapper.name)
@pytest.mark.parametrize(
    "read",
    [
        lambda telemetry: telemetry.snapshot(NOW_S),
        lambda telemetry: telemetry.has_authority,
        lambda telemetry: telemetry.is_authority_known,
        lambda telemetry: bool(telemetry.why_authority_lost),
        lambda telemetry: telemetry.mode_s,
        lambda telemetry: telemetry.is_landing,
        lambda telemetry: telemetry.is_descending,
        lambda telemetry: telemetry.flight_status,
        lambda telemetry: telemetry.is_on_ground,
        lambda telemetry: telemetry.note_setpoint(Vector3(1.0), NOW_S),
    ],
)
def test_what_is_discarded_while_another_thread_reads_it(
    wrapper: Wrapper, read: Callable[[DjiTelemetry], object]
) -> None:
    telemetry = DjiTelemetry(wrapper, DjiSettings())
    telemetry.on_attitude({"quaternion": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}, NOW_S)
    telemetry.on_gps_level({"data": 5}, NOW_S)
    telemetry.on_altitude({"data": 20.0}, NOW_S)
    telemetry.on_velocity({"vector": {"x": 1.0, "y": 0.0, "z": 0.0}}, NOW_S)
    telemetry.on_position({"latitude": 37.0, "longitude": -6.0, "altitude": 20.0}, NOW_S)
    telemetry.on_flight_status({"data": modes.IN_AIR}, NOW_S)
    telemetry.on_display_mode({"data": modes.SDK_CONTROL}, NOW_S)
    telemetry.on_control_mode({"device_mode": 4, "control_auth": 1}, NOW_S)
    for name, reading in list(vars(telemetry).items()):
        if isinstance(reading, Reading):
            vanishing = _Vanishing(telemetry._readings, math.inf, None)
            vanishing.sample = reading.sample
            setattr(telemetry, name, vanishing)
    read(telemetry)


@pytest.mark.parametrize(
    ("message", "is_severe"),
    [
        ({"level": 16}, True),
        ({"level": 8}, False),
        ({"level": 50, "stamp": {}}, True),
        ({"level": 40, "stamp": {}}, False),
    ],
    ids=["ros1 fatal", "ros1 error", "ros2 fatal", "ros2 error"],
)
def test_what_the_wrapper_logs_as_fatal_is_severe(message: Message, is_severe: bool) -> None:
    telemetry = DjiTelemetry(next(each for each in WRAPPERS if not each.has_sea_level), DjiSettings())
    telemetry.note_severity(message, "the SDK has failed", NOW_S)
    found = telemetry.snapshot(NOW_S).condition.severe_texts
    assert [each.text for each in found] == ["the SDK has failed"] * is_severe


def test_what_the_battery_has_not_measured_is_not_reported() -> None:
    """NaN was told as a charge, and 300 %."""
    unmeasured: Message = {"percentage": None, "voltage": None, "current": None}
    assert reported(on_battery=unmeasured).condition.battery is None
    assert reported(on_battery={**unmeasured, "percentage": 300.0}).condition.battery is None
    assert reported(on_battery={**unmeasured, "percentage": 80.0}).condition.battery == Battery(80.0)
