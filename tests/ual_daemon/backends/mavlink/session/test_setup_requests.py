"""What is asked to be streamed is asked again until it flows, whatever was acknowledged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any, cast

import pytest

from ual_daemon.backends.mavlink.autopilots.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.autopilots.command_long import CommandLong
from ual_daemon.backends.mavlink.autopilots.dialect import Dialect
from ual_daemon.backends.mavlink.autopilots.px4 import Px4
from ual_daemon.backends.mavlink.session.setup_requests import SetupRequests
from ual_daemon.backends.mavlink.wire.messages import mavlink

STEP_S = 0.01


def asked(dialect: Dialect, rates_hz: Mapping[int, float], duration_s: float = 60.0) -> Counter[int]:
    """How often each message is asked for, where every request is acknowledged, but these are the rates."""
    telemetry = SimpleNamespace(message_counts=Counter[int](), parameters=dict.fromkeys(dialect.parameters, 0.0))
    found: Counter[int] = Counter()

    class Acknowledged:
        def is_under_way(self, _: CommandLong) -> bool:
            return False

        def submit(self, command: CommandLong, _: float) -> Future[None]:
            if command.id == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                found[round(command.params[0])] += 1
            done: Future[None] = Future()
            done.set_result(None)
            return done

    setup = SetupRequests(dialect, cast("Any", telemetry), cast("Any", Acknowledged()), lambda _: None, 50.0)
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
def test_a_stream_of_ardupilot_at_its_own_rate_is_asked_for_again(message_id: int, unasked_hz: float) -> None:
    assert asked(ArduCopter(), {message_id: unasked_hz})[message_id] > 10


def test_px4s_mode_flows_when_it_comes_twice_a_second_and_not_by_its_own_rate() -> None:
    current_mode = mavlink.MAVLINK_MSG_ID_CURRENT_MODE
    assert asked(Px4(), {current_mode: 2.0})[current_mode] <= 2
    assert asked(Px4(), {current_mode: 0.5})[current_mode] > 10


@pytest.mark.parametrize("dialect", [Px4(), ArduCopter()])
def test_what_flows_as_asked_is_not_asked_for_again(dialect: Dialect) -> None:
    rates_hz = {round(each.params[0]): 1e6 / each.params[1] for each in dialect.streams(50.0)}
    assert set(asked(dialect, rates_hz).values()) == {1}
