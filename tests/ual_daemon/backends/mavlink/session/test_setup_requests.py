"""Streams are requested again until they flow, whatever was acknowledged."""

from __future__ import annotations

import itertools
import logging
import math
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any, cast

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec
from tests.ual_daemon.backends.mavlink.fakes import BOOT_MS, UTC_S, Harness, ack, attitude, heartbeat, position
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.command_long import LongCommand
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.session.setup_requests import SetupRequests
from ual_daemon.backends.mavlink.wire.frames import split

STEP_S = 0.01
INTERVAL, REQUEST = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE


def requests_made(dialect: Dialect, rates_hz: Mapping[int, float], duration_s: float = 60.0) -> Counter[int]:
    """Returns the requests for each message, where every request is acknowledged, but these are the rates."""
    telemetry = SimpleNamespace(message_counts=Counter[int](), parameters=dict.fromkeys(dialect.parameters, 0.0))
    found: Counter[int] = Counter()

    class Acknowledged:
        def is_pending(self, _: LongCommand) -> bool:
            return False

        def submit(self, command: LongCommand, _: float) -> Future[None]:
            if command.request.id == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                found[round(command.request.params[0])] += 1
            done: Future[None] = Future()
            done.set_result(None)
            return done

    setup = SetupRequests(
        dialect, cast("Any", telemetry), cast("Any", Acknowledged()), lambda _: None, dialect.streams(50.0)
    )
    due = dict.fromkeys(rates_hz, 0.0)
    for index in range(round(duration_s / STEP_S)):
        for message_id, rate_hz in rates_hz.items():
            due[message_id] += rate_hz * STEP_S
            if due[message_id] >= 1.0:
                due[message_id] -= 1.0
                telemetry.message_counts[message_id] += 1
        setup.tick(index * STEP_S)
    return found


@pytest.mark.parametrize(
    ("message_id", "unasked_hz"),
    [
        (mavlink.MAVLINK_MSG_ID_HEARTBEAT, 1.0),  # tells its mode: at 1 Hz the safety pilot is seen a second late
        (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 4.0),
        (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, 4.0),
    ],
)
def test_a_stream_of_ardupilot_at_its_own_rate_is_requested_again(message_id: int, unasked_hz: float) -> None:
    assert requests_made(ArduCopter(), {message_id: unasked_hz})[message_id] > 10


def test_px4s_mode_flows_when_it_comes_twice_a_second_and_not_by_its_own_rate() -> None:
    current_mode = mavlink.MAVLINK_MSG_ID_CURRENT_MODE
    assert requests_made(Px4(), {current_mode: 2.0})[current_mode] <= 2
    assert requests_made(Px4(), {current_mode: 0.5})[current_mode] > 10


@pytest.mark.parametrize("dialect", [Px4(), ArduCopter()])
def test_what_flows_as_requested_is_not_requested_again(dialect: Dialect) -> None:
    rates_hz = {round(each.request.params[0]): 1e6 / each.request.params[1] for each in dialect.streams(50.0)}
    assert set(requests_made(dialect, rates_hz).values()) == {1}


# --- In a session -----------------------------------------------------------------------------------------------------

STREAMS = {436: 5e4, 245: 5e4, 230: 1e5, 31: 2e4, 32: 2e4, 85: pytest.approx(1e6 / 37.0), 65: 2e5}


def _requested_streams(harness: Harness, *, until_s: float) -> dict[int, float]:
    """Returns the streams that it requests while every request is accepted."""
    asked: dict[int, float] = {}
    while harness.now_s < until_s:
        harness.run(0.05)
        for sent in harness.commands(INTERVAL):
            asked[int(sent.param1)] = sent.param2
            harness.receive(ack(INTERVAL, mavlink.MAV_RESULT_ACCEPTED))
    return asked


def _attitude_at(now_s: float) -> Any:
    return attitude(boot_ms=BOOT_MS + int(now_s * 1000))


def _stream(harness: Harness, *, until_s: float, without: int = 0) -> set[float]:
    """It sends what it was asked for, a third of it at that: the link is bad. What it is asked meanwhile."""
    asked: set[float] = set()
    while harness.now_s < until_s:
        harness.run(0.15)
        said = [
            mavlink.MAVLink_current_mode_message(0, 0x03040000, 0),
            mavlink.MAVLink_extended_sys_state_message(0, 1),
            mavlink.MAVLink_estimator_status_message(0, 0x37F, *[0.0] * 8),
            *[_attitude_at(harness.now_s), position(harness.now_s)] * 3,
        ]
        for sent in harness.commands(INTERVAL):
            asked.add(sent.param1)
            said.append(ack(INTERVAL, mavlink.MAV_RESULT_ACCEPTED))
        harness.receive(*[message for message in said if message.get_msgId() != without])
    return asked


def test_streams_are_requested_until_each_is_acknowledged_and_flows() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    harness.run(30.0)  # nobody answers
    harness.link.sent.clear()
    assert _requested_streams(harness, until_s=45.0) == STREAMS
    _stream(harness, until_s=60.0)
    assert _stream(harness, until_s=90.0) == set()


def test_a_stream_that_does_not_flow_is_requested_again_though_it_was_acknowledged() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    assert _requested_streams(harness, until_s=2.0) == STREAMS  # by the acknowledgement of another, for all we know
    _stream(harness, until_s=4.0, without=245)
    assert _stream(harness, until_s=6.0, without=245) == {245.0}


def test_a_stream_that_it_refuses_is_not_requested_again() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    asked_count = 0
    for _ in range(400):
        harness.run(0.05)
        for _ in harness.commands(INTERVAL):
            asked_count += 1
            harness.receive(ack(INTERVAL, mavlink.MAV_RESULT_UNSUPPORTED))
    assert asked_count == len(STREAMS)


def test_what_is_sent_only_on_request_is_requested_until_it_comes() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    harness.run(20.0)
    assert {sent.param1 for sent in harness.commands(REQUEST)} == {148.0, 49.0, 242.0}
    harness.receive(mavlink.MAVLink_home_position_message(1, 1, 1, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))
    harness.run(5.0)  # those that were under way
    harness.link.sent.clear()
    harness.run(60.0)
    assert {sent.param1 for sent in harness.commands(REQUEST)} == {148.0, 49.0}


def test_px4s_origin_is_requested_now_and_then_as_the_message_that_moves_it_may_have_been_lost() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    harness.receive(mavlink.MAVLink_gps_global_origin_message(1, 1, 1))
    harness.run(20.0)
    harness.link.sent.clear()
    harness.run(60.0)
    assert 5 <= [sent.param1 for sent in harness.commands(REQUEST)].count(49.0) <= 6 * 4  # each four times at most


def test_limits_come_from_parameters_that_are_read_until_they_are_known() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    harness.run(0.1)
    asked = {message.param_id for message in harness.link.take("PARAM_REQUEST_READ")}
    assert "MPC_XY_VEL_MAX" in asked
    harness.receive(mavlink.MAVLink_param_value_message(b"MPC_XY_VEL_MAX", 12.0, 9, 900, 1))
    harness.receive(mavlink.MAVLink_param_value_message(b"MPC_YAWRAUTO_MAX", 90.0, 9, 900, 1))
    harness.run(1.0)
    again = {message.param_id for message in harness.link.take("PARAM_REQUEST_READ")}
    assert again == asked - {"MPC_XY_VEL_MAX", "MPC_YAWRAUTO_MAX"}
    limits = harness.session.info().limits
    assert limits.horizontal_speed_m_s == 12.0
    assert limits.yaw_rate_rad_s == pytest.approx(math.pi / 2)


def test_a_parameter_that_it_does_not_have_is_requested_ever_more_rarely() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    asked_s: list[float] = []
    while harness.now_s < 3600.0:
        harness.run(0.5, 0.5)
        asked = [message.param_id for message in harness.link.take("PARAM_REQUEST_READ")]
        asked_s += [harness.now_s] * asked.count("MPC_XY_VEL_MAX")
    assert 8 <= len(asked_s) <= 17
    pauses_s = [later - earlier for earlier, later in itertools.pairwise(asked_s)]
    assert pauses_s == sorted(pauses_s)
    assert pauses_s[-1] > 600.0


def test_after_a_reboot_everything_is_requested_anew_and_the_old_boots_positions_are_forgotten() -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude(), position(100.0), mavlink.MAVLink_gps_global_origin_message(1, 1, 1))
    assert _requested_streams(harness, until_s=10.0) == STREAMS
    young = mavlink.MAVLink_attitude_quaternion_message(BOOT_MS // 10, 1, 0, 0, 0, 0, 0, 0)
    young_position = mavlink.MAVLink_local_position_ned_message(BOOT_MS // 10, 0, 0, 0, 0, 0, 0)
    before = harness.snapshot()
    harness.receive(young, young_position)  # not believed yet: the old boot's places do not apply to its position
    assert harness.snapshot().motion.pose == before.motion.pose
    harness.receive(young, young_position)
    assert harness.snapshot().earth.projection is None
    assert harness.snapshot().motion.stamp_s == pytest.approx(UTC_S + harness.now_s)
    assert harness.supervision.watch.reboots_count == 1
    assert _requested_streams(harness, until_s=20.0) == STREAMS


def test_after_a_silence_everything_is_requested_anew() -> None:
    harness = Harness()
    harness.receive(heartbeat())
    assert _requested_streams(harness, until_s=2.0) == STREAMS
    harness.run(10.0)
    harness.receive(heartbeat())
    assert _requested_streams(harness, until_s=20.0) == STREAMS


def test_a_lost_link_is_no_autopilot_that_is_received_and_streams_no_more(caplog: pytest.LogCaptureFixture) -> None:
    harness = Harness()
    harness.receive(heartbeat(), attitude())
    harness.run(0.5)
    harness.receive(heartbeat())
    with caplog.at_level(logging.INFO):
        harness.run(10.0)
    assert [record.message for record in caplog.records if "is heard" in record.message] == []


# --- Autopilots that do not know the request for single streams ------------------------------------------------------

GENERIC = heartbeat(5, autopilot=mavlink.MAV_AUTOPILOT_GENERIC)


def _angles(roll_rad: float = 0.0, yaw_rad: float = 0.0, boot_ms: int = 0) -> Any:
    return mavlink.MAVLink_attitude_message(boot_ms, roll_rad, 0.0, yaw_rad, 0.1, 0.2, 0.3)


def _answering(harness: Harness, result: int | None, duration_s: float) -> list[Any]:
    """An autopilot that answers all requests in the same way. Returns which groups of streams it is asked for."""
    groups: list[Any] = []
    for _ in range(round(duration_s / 0.1)):
        harness.run(0.1)
        sent = [AutopilotCodec(1).decode(frame) for data in harness.link.sent for frame in split(data)[0]]
        harness.link.sent.clear()
        groups += [each for each in sent if each.get_type() == "REQUEST_DATA_STREAM"]
        said: list[Any] = [GENERIC]
        if result is not None:
            said += [ack(each.command, result) for each in sent if each.get_type() == "COMMAND_LONG"]
        harness.receive(*said)
    return groups


@pytest.mark.parametrize(("result", "told"), [(mavlink.MAV_RESULT_UNSUPPORTED, "UNSUPPORTED"), (None, "no answer")])
def test_where_no_request_for_a_stream_is_taken_groups_are_requested_and_it_is_reported(
    result: int | None, told: str
) -> None:
    harness = Harness()
    harness.receive(GENERIC)
    groups = _answering(harness, result, 30.0)
    assert {(each.req_stream_id, each.req_message_rate, each.start_stop) for each in groups} >= {
        (mavlink.MAV_DATA_STREAM_EXTRA1, 50, 1),
        (mavlink.MAV_DATA_STREAM_POSITION, 50, 1),
        (mavlink.MAV_DATA_STREAM_EXTENDED_STATUS, 5, 1),
    }
    assert {(each.target_system, each.target_component) for each in groups} == {(1, 1)}
    assert f"LOCAL_POSITION_NED ({told})" in harness.session.refused


def test_where_some_requests_are_taken_no_group_is_requested() -> None:
    """On ArduPilot that would lower the rates of other messages."""
    harness = Harness()
    harness.receive(GENERIC)
    assert _answering(harness, mavlink.MAV_RESULT_ACCEPTED, 20.0) == []
    assert harness.session.refused == ""


def test_angles_are_the_attitude_where_no_quaternion_comes() -> None:
    harness = Harness()
    harness.receive(GENERIC, _angles(), position(0.0))
    assert harness.snapshot().motion.pose is None, "a quaternion may come yet"
    _answering(harness, mavlink.MAV_RESULT_UNSUPPORTED, 4.0)
    harness.receive(_angles(0.2, math.pi / 2), position(harness.now_s))
    pose, rates = harness.snapshot().motion.pose.value, harness.snapshot().motion.velocity.value.angular
    roll_rad, pitch_rad, yaw_rad = pose.orientation.to_euler()
    assert (roll_rad, pitch_rad, yaw_rad) == pytest.approx((0.2, 0.0, 0.0), abs=1e-6)  # to the east: along x
    assert tuple(rates) == pytest.approx((0.1, -0.2, -0.3))
    for bad in (math.nan, math.inf, 1e6):
        harness.receive(_angles(bad, 0.5), position(harness.now_s))
        assert harness.snapshot().motion.pose.value.orientation.to_euler()[2] == pytest.approx(0.0, abs=1e-6)
    harness.receive(attitude(), _angles(0.0, 1.0), position(harness.now_s))
    assert harness.snapshot().motion.pose.value.orientation.to_euler()[2] == pytest.approx(math.pi / 2), (
        "the quaternion counts"
    )
