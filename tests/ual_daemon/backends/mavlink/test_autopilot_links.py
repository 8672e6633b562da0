"""Flights over links and with autopilots as they are in the field: bridges, radios, odd ids, old firmware."""

from __future__ import annotations

import logging

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators import ArduPilot, Px4
from tests.simulators.autopilot import Autopilot
from tests.simulators.faults import Faults
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight, UsualRates
from ual.types import State

KINDS = ["px4", "ardupilot"]


def fly(flight: Flight) -> None:
    flight.take_off()
    flight.uav.go_to_waypoint(flight.goal(5.0, 2.0))
    flight.land()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [17, 64, 256])
def test_it_flies_behind_a_bridge_that_cuts_its_messages(kind: str, size: int) -> None:
    flight = UsualRates(kind)
    try:
        flight.link.down = Faults(cut_bytes=size)
        fly(flight)
        statistics = flight.backend.link_statistics()
        assert statistics.loss < 0.01
        assert statistics.corrupt_count <= 2  # where it begins in the middle of a frame
        link = flight.backend.link()
        assert (link.lost_count, link.reboots_count) == (0, 0)
        assert link.rate_hz is not None
        assert link.rate_hz > 10.0
    finally:
        flight.uav.close()


@pytest.mark.parametrize("component_id", [0, 50, 200, 250])
def test_an_autopilot_at_another_component_flies(component_id: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Autopilot, "component_id", component_id)
    flight = UsualRates("ardupilot")
    try:
        fly(flight)
    finally:
        flight.uav.close()


def test_a_radio_that_is_overrun_is_requested_less_until_it_fits(caplog: pytest.LogCaptureFixture) -> None:
    flight = UsualRates("px4")
    try:
        flight.kill()
        flight.autopilot = Px4(flight.link)  # with all that a real one sends: 24 kB/s
        flight.link.down = Faults(rate_bytes_s=4000.0)
        flight.start()
        flight.wait_for(lambda: "the link loses " in reason(flight), "the loss")
        flight.wait_for(lambda: "as the link carries no more" in reason(flight), "less")
        (channel,) = flight.autopilot.channels
        position = mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        flight.wait_for(lambda: 0.03 <= channel.intervals_s[position] <= 0.25, "a lower rate")
        flight.wait_for(lambda: flight.backend.link_statistics().loss < 0.1, "a link that fits")
        # 25 positions and all else are 4.3 kB/s: about a tenth is lost; whether that is too much is close.
        text = "not armed; it is asked for {} positions a second, as the link carries no more"
        settled = {text.format(25), text.format(12.5)}
        flight.wait_for(lambda: reason(flight) in settled, "the parameters that were lost at first")
        assert sum(vars(record).get("ual_event") == "stream_rates_changed" for record in caplog.records) <= 4
        fly(flight)
        flight.uav.close()
        flight.autopilot.run(0.5)
        assert channel.intervals_s == {each: 1.0 / rate_hz for each, rate_hz in channel._rates_hz.items()}
    finally:
        flight.uav.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_link_that_loses_at_random_is_requested_all_again(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    flight = UsualRates(kind)
    try:
        flight.wait_for_state(State.LANDED_DISARMED)
        flight.link.down = Faults(loss=0.45)
        flight.wait_for(lambda: len(changes(caplog)) == 2, "a try, and its end")
        flight.link.down = Faults()
        (channel, *_) = flight.autopilot.channels
        position = mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        flight.wait_for(lambda: channel.intervals_s[position] == pytest.approx(0.02), "the wanted rate")
        geo = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
        unasked_hz = channel._rates_hz[geo] if kind == "px4" else 5.0
        flight.wait_for(lambda: channel.intervals_s.get(geo) == pytest.approx(1.0 / unasked_hz), "its own rate")
        flight.wait_for(lambda: "the link" not in reason(flight), "a link that is good")
        assert "carries no more" not in reason(flight)
    finally:
        flight.uav.close()


def changes(caplog: pytest.LogCaptureFixture) -> list[logging.LogRecord]:
    return [record for record in caplog.records if vars(record).get("ual_event") == "stream_rates_changed"]


def reason(flight: Flight) -> str:
    return flight.uav.telemetry().state_reason


def test_an_arducopter_3_6_is_requested_groups_and_what_it_lacks_is_reported() -> None:
    flight = UsualRates("ardupilot")
    try:
        flight.wait_for_state(State.LANDED_DISARMED)  # the newer firmware has been asked for its streams
        flight.kill()
        assert isinstance(flight.autopilot, ArduPilot)
        flight.autopilot.become_3_6()
        flight.start()
        refused = "EXTENDED_SYS_STATE (UNSUPPORTED)"
        flight.wait_for(lambda: refused in reason(flight), "what was refused")
        flight.wait_for(lambda: flight.backend.snapshot().motion.pose is not None, "a pose, from angles")
        flight.wait_for(lambda: "ATTITUDE_QUATERNION" not in reason(flight), "that angles will do")
        assert "the autopilot has not said whether it is landed; it refused to send " in reason(flight)
        telemetry = flight.uav.telemetry()
        assert telemetry.position_geo is not None
        assert telemetry.battery is not None
        assert telemetry.gps is not None
    finally:
        flight.uav.close()
