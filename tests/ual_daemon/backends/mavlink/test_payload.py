"""Messages that extensions send and read through the backend, over real UDP sockets on loopback."""

import contextlib
import logging
import threading
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ports import free_port
from tests.ual_daemon.backends.mavlink.fakes import ack, heartbeat
from tests.ual_daemon.backends.mavlink.test_backend import Autopilot, Pair, opened
from tests.waiting import LIMIT_S, until
from ual.errors import InvalidArgumentError, LinkLostError, PermissionDeniedError, RejectedByAutopilotError
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.mavlink.payload import PERMITTED
from ual_daemon.backends.payload import PayloadMessage

PITCHYAW = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
STATUS = mavlink.MAVLink_gimbal_manager_status_message(
    time_boot_ms=0,
    flags=12,
    gimbal_device_id=1,
    primary_control_sysid=1,
    primary_control_compid=190,
    secondary_control_sysid=0,
    secondary_control_compid=0,
)
FLYING = (
    "COMPONENT_ARM_DISARM",
    "DO_SET_MODE",
    "NAV_TAKEOFF",
    "NAV_LAND",
    "NAV_RETURN_TO_LAUNCH",
    "DO_REPOSITION",
    "DO_SET_HOME",
    "DO_SET_PARAMETER",
    "DO_MOUNT_CONTROL",
    "DO_SET_ROI",
    "DO_PARACHUTE",
    "DO_FLIGHTTERMINATION",
    "DO_MOTOR_TEST",
    "PREFLIGHT_REBOOT_SHUTDOWN",
    "SET_MESSAGE_INTERVAL",
)


@pytest.fixture
def pair() -> Iterator[Pair]:
    """A backend and an autopilot that have met."""
    port = free_port()
    with contextlib.closing(Autopilot(port)) as autopilot, opened(f"udpin://127.0.0.1:{port}") as backend:

        def meets() -> bool:
            autopilot.say(heartbeat())
            return backend.info().autopilot == "PX4"

        until(meets, "the autopilot")
        yield backend, autopilot


def test_a_permitted_command_arrives_and_ends_with_its_acknowledgement(pair: Pair) -> None:
    backend, autopilot = pair
    sent = backend.payload().send_command(PITCHYAW, (-30.0, 45.0, float("nan"), float("nan"), 12.0, 0.0, 1.0))
    heard = autopilot.hear("COMMAND_LONG", command=PITCHYAW)
    assert (heard.param1, heard.param2, heard.param5, heard.param7) == (-30.0, 45.0, 12.0, 1.0)
    assert not sent.done()
    autopilot.say(ack(PITCHYAW, ACCEPTED))
    sent.result(LIMIT_S)


def test_a_refusal_of_the_autopilot_is_quoted(pair: Pair) -> None:
    backend, autopilot = pair
    sent = backend.payload().send_command(PITCHYAW, (-30.0,))
    autopilot.hear("COMMAND_LONG", command=PITCHYAW)
    autopilot.say(ack(PITCHYAW, mavlink.MAV_RESULT_DENIED))
    with pytest.raises(RejectedByAutopilotError, match="DO_GIMBAL_MANAGER_PITCHYAW: DENIED"):
        sent.result(LIMIT_S)


def test_a_newer_command_of_the_same_id_replaces_the_older_one(pair: Pair) -> None:
    backend, autopilot = pair
    older = backend.payload().send_command(PITCHYAW, (-30.0,))
    newer = backend.payload().send_command(PITCHYAW, (-60.0,))
    assert older.cancelled()
    autopilot.hear("COMMAND_LONG", command=PITCHYAW, param1=-60.0)
    autopilot.say(ack(PITCHYAW, ACCEPTED))
    newer.result(LIMIT_S)


def test_who_hears_that_a_command_was_replaced_may_send_the_next(pair: Pair) -> None:
    """No lock is held over what an extension has called back: it would wait for itself."""
    payload, done = pair[0].payload(), threading.Event()

    def send() -> None:
        older = payload.send_command(PITCHYAW, (-30.0,))
        older.add_done_callback(lambda _: payload.send_command(PITCHYAW, (-90.0,)))
        payload.send_command(PITCHYAW, (-60.0,))
        done.set()

    threading.Thread(target=send, daemon=True).start()
    assert done.wait(LIMIT_S)


@pytest.mark.parametrize("name", FLYING)
def test_a_command_that_may_fly_is_refused_and_the_permitted_ones_are_named(name: str) -> None:
    payload = MavlinkBackend(BackendOptions("uav_1", "udpin://127.0.0.1:14540")).payload()
    with pytest.raises(PermissionDeniedError, match="permitted: DO_GIMBAL_MANAGER_PITCHYAW"):
        payload.send_command(int(getattr(mavlink, f"MAV_CMD_{name}")), ())


def test_no_navigation_or_condition_command_is_permitted() -> None:
    assert not [name for name in PERMITTED if name.startswith(("NAV_", "CONDITION_", "PREFLIGHT_"))]


def test_too_many_parameters_are_refused(pair: Pair) -> None:
    with pytest.raises(InvalidArgumentError, match="at most 7"):
        pair[0].payload().send_command(PITCHYAW, (0.0,) * 8)


def test_without_an_autopilot_a_command_ends_with_a_lost_link() -> None:
    payload = MavlinkBackend(BackendOptions("uav_1", "udpin://127.0.0.1:14540")).payload()
    with pytest.raises(LinkLostError):
        payload.send_command(PITCHYAW, (0.0,)).result(0.0)


def test_a_message_reaches_those_who_listen_until_they_end_it(pair: Pair) -> None:
    backend, autopilot = pair
    heard: list[PayloadMessage] = []
    others: list[PayloadMessage] = []
    end = backend.payload().subscribe("GIMBAL_MANAGER_STATUS", heard.append)
    backend.payload().subscribe("GIMBAL_MANAGER_STATUS", others.append)
    autopilot.say(STATUS)
    until(lambda: others, "the message")
    assert (heard[0].name, heard[0].fields["flags"]) == ("GIMBAL_MANAGER_STATUS", 12)
    end()
    autopilot.say(STATUS)
    until(lambda: len(others) == 2, "the second message")
    assert len(heard) == 1


def test_a_callback_that_fails_costs_no_other_listener_the_message(
    pair: Pair, caplog: pytest.LogCaptureFixture
) -> None:
    backend, autopilot = pair
    heard: list[PayloadMessage] = []

    def fail(_message: PayloadMessage) -> None:
        raise LookupError

    backend.payload().subscribe("GIMBAL_MANAGER_STATUS", fail)
    backend.payload().subscribe("GIMBAL_MANAGER_STATUS", heard.append)
    with caplog.at_level(logging.ERROR):
        autopilot.say(STATUS)
        until(lambda: heard, "the message")
    assert "an extension's callback failed with GIMBAL_MANAGER_STATUS" in caplog.text


def test_a_message_of_a_payload_can_be_requested_once_and_as_a_stream(pair: Pair) -> None:
    backend, autopilot = pair
    status_id = float(mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS)
    once = backend.payload().request_message("GIMBAL_MANAGER_STATUS")
    autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_REQUEST_MESSAGE, param1=status_id)
    autopilot.say(ack(mavlink.MAV_CMD_REQUEST_MESSAGE, ACCEPTED))
    once.result(LIMIT_S)
    backend.payload().request_message("GIMBAL_MANAGER_STATUS", 10.0)

    def is_requested() -> bool:
        asked = autopilot.hear("COMMAND_LONG", command=mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
        autopilot.say(ack(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, ACCEPTED))
        return (asked.param1, asked.param2) == (status_id, 1e5)

    until(is_requested, "the request of a stream")


def test_messages_that_the_daemon_needs_at_its_own_rates_cannot_be_requested(pair: Pair) -> None:
    with pytest.raises(PermissionDeniedError, match="permitted: CAMERA_"):
        pair[0].payload().request_message("LOCAL_POSITION_NED", 1.0)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan")])
def test_a_rate_that_is_not_positive_is_refused(pair: Pair, rate_hz: float) -> None:
    with pytest.raises(InvalidArgumentError, match="must be positive"):
        pair[0].payload().request_message("GIMBAL_MANAGER_STATUS", rate_hz)


def test_a_message_that_mavlink_does_not_have_is_refused(pair: Pair) -> None:
    with pytest.raises(InvalidArgumentError, match="no message 'GIMBAL_STATE'"):
        pair[0].payload().subscribe("GIMBAL_STATE", lambda _: None)
