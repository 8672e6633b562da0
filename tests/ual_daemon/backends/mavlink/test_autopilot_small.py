"""Small things with simulated autopilots: stream rates, parameters that do not come, and our own pauses."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators import ArduPilot
from tests.simulators.ardupilot import RENAMED, RENAMED_IN_4_7_0
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight, UsualRates
from tests.waiting import until
from ual.types import Limits, State

POSITION = mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = UsualRates(str(request.param))
    yield flight
    flight.uav.close()


def test_stream_rates_that_another_program_lowers_are_requested_again_but_not_all_the_time(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.let_pass(15.0)
    (channel, *_) = flight.autopilot.channels
    assert channel.intervals_s[POSITION] == pytest.approx(0.02)
    began_s = flight.now_s
    for _ in range(3):  # a ground station does so again and again
        with flight.autopilot.lock:
            channel.stream(POSITION, 0.05, flight.now_s)
        flight.wait_for(lambda: channel.intervals_s[POSITION] < 0.03, "the rate that was asked for")
    asked = [
        at_s
        for at_s, command, params, _ in flight.autopilot.commands
        if at_s > began_s and command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and params[0] == POSITION
    ]
    assert len(asked) <= (flight.now_s - began_s) / 9.0 + 1


def test_the_default_rates_come_back_when_the_daemon_ends(flight: Flight) -> None:
    (channel, *_) = flight.autopilot.channels
    before = {each: 1.0 / rate_hz for each, rate_hz in channel._rates_hz.items()}
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.let_pass(3.0)
    assert channel.intervals_s != before
    flight.uav.close()
    flight.autopilot.run(0.5)
    assert channel.intervals_s == before


def test_limits_that_cannot_be_read_are_reported_with_what_is_assumed(
    flight: Flight, caplog: pytest.LogCaptureFixture
) -> None:
    with flight.autopilot.lock:
        flight.autopilot.ignored.add(mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ)
    flight.kill()
    with caplog.at_level(logging.WARNING):
        flight.start()
        flight.wait_for_state(State.LANDED_DISARMED)
        flight.let_pass(30.0)
    (record,) = [record for record in caplog.records if vars(record).get("ual_event") == "parameters_missing"]
    fields = str(record.__dict__)
    assert "MPC_XY_VEL_MAX" in fields or "WP_SPD or WPNAV_SPEED" in fields
    assert "at most 1.6 m/s" in fields
    assert "it has not sent " in flight.uav.telemetry().state_reason
    with flight.autopilot.lock:
        flight.autopilot.ignored.clear()
    flight.wait_for(lambda: "it has not sent " not in flight.uav.telemetry().state_reason, "the parameters")


@pytest.mark.parametrize("renamed", [RENAMED, RENAMED_IN_4_7_0])
def test_an_arducopter_4_7_flies_by_its_renamed_parameters(renamed: dict[str, tuple[str, float]]) -> None:
    flight = UsualRates("ardupilot")
    try:
        autopilot = flight.autopilot
        assert isinstance(autopilot, ArduPilot)
        flight.kill()
        autopilot.become_4_7(renamed)
        flight.start()
        flight.wait_for(lambda: flight.uav.info().limits.horizontal_speed_m_s == 10.0, "its speed")
        assert flight.uav.info().autopilot_version.startswith("4.7.1")
        assert flight.uav.info().limits == Limits(10.0, 2.5, 1.5, 1.5, 0.6, math.radians(60.0))
        flight.take_off()
        flight.uav.go_to_waypoint(flight.goal(20.0, 0.0))
        flight.land()
    finally:
        flight.uav.close()


def test_a_severe_text_is_reported_by_health_and_by_the_log_and_ages(caplog: pytest.LogCaptureFixture) -> None:
    flight = Flight("ardupilot")
    with flight.uav:
        flight.wait_for_state(State.LANDED_DISARMED)
        with flight.autopilot.lock:
            flight.autopilot.say("Potential Thrust Loss (3)", mavlink.MAV_SEVERITY_EMERGENCY)
            flight.autopilot.say("Mission: 3 WP", mavlink.MAV_SEVERITY_INFO)
        text = "autopilot: Potential Thrust Loss (3)"
        flight.wait_for(lambda: text in str(flight.uav.telemetry().health), "the text")
        is_told = "autopilot_says"
        (said,) = until(
            lambda: [vars(each) for each in caplog.records if vars(each).get("ual_event") == is_told], "its line"
        )
        assert said["ual_fields"] == {"text": "Potential Thrust Loss (3)", "severity": 0}
        assert "Mission" not in str(flight.uav.telemetry().health)
        flight.wait_for(lambda: text not in str(flight.uav.telemetry().health), "its end")
