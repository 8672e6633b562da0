from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import Harness as BaseHarness
from tests.ual_daemon.backends.mavlink.fakes import ack, attitude, heartbeat
from ual.errors import RejectedByAutopilotError
from ual_daemon.backends.engine.command import FLYING
from ual_daemon.backends.engine.command_runner import EFFECT_S, STALE_ANSWER_S, RunnerSettings
from ual_daemon.backends.mavlink.dialects.command_long import (
    AGAIN,
    REQUESTED,
    LongCommand,
    command_of,
    request_message,
)
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import COMMAND_PATIENCE_S

RESEND_S, SENDS_COUNT = AGAIN.every_s, AGAIN.most
EXPLAIN_S = RunnerSettings().explain_s
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
SET_MODE = mavlink.MAV_CMD_DO_SET_MODE
LAND = mavlink.MAV_CMD_NAV_LAND
OFFBOARD, LANDING = 6 << 16, 4 << 16 | 6 << 24
LOITER = (4.0, 3.0)
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
IN_PROGRESS = mavlink.MAV_RESULT_IN_PROGRESS
PX4 = Px4()


class Harness(BaseHarness):
    """A session that is already open, its link up."""

    def __init__(self) -> None:
        super().__init__()
        self.receive(heartbeat())

    def submit(self, command: LongCommand) -> Future[None]:
        return self.session.submit(command, self.now_s)


def test_a_command_goes_to_the_autopilot_and_ends_with_its_acknowledgement() -> None:
    harness = Harness()
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    (sent,) = harness.commands(ARM)
    assert (sent.target_system, sent.target_component, sent.confirmation) == (1, 1, 0)
    assert (sent.param1, sent.param2) == (1.0, 0.0)
    assert not future.done()
    harness.receive(ack(ARM, ACCEPTED))
    assert future.result(0) is None


@pytest.mark.parametrize(("mode", "needed"), [(OFFBOARD, SET_MODE), (LANDING, ARM)])
def test_what_was_withdrawn_is_not_sent_by_an_acknowledgement_of_something_else(mode: int, needed: int) -> None:
    harness = Harness()
    harness.receive(heartbeat(mode, armed=True))
    command = PX4.take_control() if needed == SET_MODE else PX4.arm(harness.snapshot())  # by way of AUTO.LOITER
    harness.session.submit(request_message(49), harness.now_s)
    future = harness.session.submit(command, harness.now_s)
    assert harness.commands(needed) == []
    harness.setpoints.sent_for_s = 1.0
    future.cancel()
    harness.receive(ack(SET_MODE, ACCEPTED), ack(SET_MODE, ACCEPTED), ack(mavlink.MAV_CMD_REQUEST_MESSAGE, ACCEPTED))
    assert harness.commands(needed) == []


def test_an_acknowledgement_of_the_one_before_does_not_end_a_command_that_was_lost() -> None:
    harness = Harness()
    harness.submit(PX4.take_control())
    harness.setpoints.sent_for_s = 1.0
    harness.run(0.05)
    harness.receive(ack(SET_MODE, ACCEPTED), ack(SET_MODE, ACCEPTED))
    holding = harness.submit(PX4.hold())  # is lost on its way
    harness.commands(SET_MODE)
    harness.receive(ack(SET_MODE, ACCEPTED), ack(SET_MODE, ACCEPTED))  # copies
    _run_received(harness, RESEND_S + 0.1, SOMETHING)
    assert not holding.done()
    assert len(harness.commands(SET_MODE)) == 1
    harness.receive(heartbeat(4 << 16 | 3 << 24, armed=True))
    harness.run(0.05)
    assert holding.done()


def test_a_refusal_soon_after_the_command_before_is_believed_when_it_comes_again() -> None:
    harness = Harness()
    harness.submit(PX4.disarm())
    harness.receive(ack(ARM, ACCEPTED))
    arming = harness.submit(PX4.arm(Snapshot(0.0)))
    harness.receive(ack(ARM, REJECTED))
    harness.run(STALE_ANSWER_S + 0.1)
    assert not arming.done()
    harness.receive(ack(ARM, REJECTED))
    harness.run(EFFECT_S + 0.1)
    assert isinstance(arming.exception(0), RejectedByAutopilotError)


def test_disarming_is_never_forced() -> None:
    harness = Harness()
    harness.submit(PX4.disarm())
    (sent,) = harness.commands(ARM)
    assert [getattr(sent, f"param{i}") for i in range(1, 8)] == [0.0] * 7


def test_an_unanswered_command_is_sent_again_counting_and_then_left_open() -> None:
    harness = Harness()
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    _run_received(harness, 10.0, heartbeat())
    assert [sent.confirmation for sent in harness.commands(ARM)] == list(range(SENDS_COUNT))
    assert not future.done()


def test_a_command_gets_through_a_link_that_loses_and_damages_messages_while_its_effect_is_waited_for() -> None:
    arrives = (1.0 - 0.3) * (1.0 - 0.1)  # of the messages, each way
    fails = (1.0 - arrives**2) ** SENDS_COUNT
    assert fails < 1e-4
    assert SENDS_COUNT * RESEND_S <= COMMAND_PATIENCE_S
    assert RESEND_S > 0.2  # slower than the answer comes by a radio with its jitter


def test_what_is_only_requested_yields_to_the_next_such_request_sooner() -> None:
    harness = Harness()
    harness.submit(request_message(49))
    harness.submit(request_message(242))
    asked: list[float] = []
    for _ in range(8):
        harness.run(REQUESTED.every_s)
        requests = harness.commands(mavlink.MAV_CMD_REQUEST_MESSAGE)
        asked += [sent.param1 for sent in requests if sent.param1 in (49.0, 242.0)]
    assert asked[: REQUESTED.most] == [49.0] * REQUESTED.most
    assert asked[REQUESTED.most] == 242.0


def test_the_effect_of_a_command_ends_it_without_any_acknowledgement() -> None:
    harness = Harness()
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    _run_received(harness, 0.6, heartbeat())
    assert len(harness.commands(ARM)) == 3
    harness.receive(heartbeat(armed=True))
    harness.run(0.05)
    assert future.result(0) is None
    _run_received(harness, 5.0, heartbeat())
    assert harness.commands(ARM) == []


def test_what_was_so_before_the_command_is_not_its_effect() -> None:
    harness = Harness()
    harness.receive(heartbeat(armed=True))
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    harness.run(0.2)
    assert not future.done()


@pytest.mark.parametrize("is_before", [True, False])
def test_the_refusal_of_a_repetition_does_not_count_where_the_first_was_obeyed(is_before: bool) -> None:
    harness = Harness()
    future = harness.submit(PX4.disarm())
    _run_received(harness, 0.3, heartbeat(armed=True))
    assert len(harness.commands(ARM)) == 2
    if is_before:
        harness.receive(heartbeat(armed=False), ack(ARM, REJECTED))
    else:
        harness.receive(ack(ARM, REJECTED))
        harness.run(0.5)
        assert not future.done()
        harness.receive(heartbeat(armed=False))
    harness.run(0.05)
    assert future.result(0) is None


def test_the_refusal_of_a_repetition_counts_where_no_effect_follows() -> None:
    harness = Harness()
    harness.receive(heartbeat(armed=False))
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    _run_received(harness, 0.3, heartbeat())
    harness.receive(ack(ARM, REJECTED))
    harness.run(EFFECT_S + 0.1)
    assert "TEMPORARILY_REJECTED" in str(future.exception(0))


def test_while_an_answer_is_late_the_vehicle_is_looked_at_often() -> None:
    harness = Harness()
    harness.receive(*ANSWERS)
    harness.run(0.5)
    harness.submit(PX4.arm(Snapshot(0.0)))
    harness.link.sent.clear()
    harness.run(1.0)
    assert 8 <= _heartbeats_requested(harness) <= 10


def test_a_late_acknowledgement_still_counts() -> None:
    harness = Harness()
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    harness.run(1.2)
    harness.receive(ack(ARM, ACCEPTED))
    harness.link.sent.clear()
    _run_received(harness, 3.0, heartbeat())
    assert future.done()
    assert harness.commands(ARM) == []


@pytest.mark.parametrize("answer", [ack(LAND, ACCEPTED), ack(ARM, ACCEPTED, (1, 190)), ack(ARM, ACCEPTED, (255, 191))])
def test_an_acknowledgement_of_another_command_or_to_somebody_else_is_not_ours(answer: Message) -> None:
    harness = Harness()
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    harness.receive(answer)
    assert not future.done()


def test_a_refusal_carries_the_result_and_what_the_autopilot_reported_around_it() -> None:
    harness = Harness()
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    harness.receive(mavlink.MAVLink_statustext_message(2, b"Arming denied: no battery", 0, 0))
    harness.receive(ack(ARM, REJECTED))
    assert not future.done()
    harness.receive(mavlink.MAVLink_statustext_message(2, b"Resolve failures first", 0, 0))
    harness.run(EXPLAIN_S + 0.05)
    error = future.exception(0)
    assert isinstance(error, RejectedByAutopilotError)
    assert str(error) == (
        "PX4 refused to arm: TEMPORARILY_REJECTED; it said: Arming denied: no battery; it said: Resolve failures first"
    )
    assert error.metadata == {
        "result": "TEMPORARILY_REJECTED",
        "text": "Arming denied: no battery; Resolve failures first",
        "command": "MAV_CMD_COMPONENT_ARM_DISARM",
    }


def test_work_in_progress_is_waited_for_without_sending_again() -> None:
    harness = Harness()
    future = harness.submit(PX4.land())
    harness.receive(ack(LAND, IN_PROGRESS))
    harness.run(5.0)
    assert len(harness.commands(LAND)) == 1
    harness.receive(ack(LAND, ACCEPTED))
    assert future.done()


def test_a_mode_change_is_believed_at_its_second_acknowledgement() -> None:
    harness = Harness()
    future = harness.submit(PX4.hold())
    harness.receive(ack(SET_MODE, ACCEPTED))
    assert not future.done()
    harness.receive(ack(SET_MODE, REJECTED))
    harness.run(0.15)
    assert isinstance(future.exception(0), RejectedByAutopilotError)


def test_a_mode_change_acknowledged_twice_or_only_once_is_done() -> None:
    for count in (1, 2):
        harness = Harness()
        future = harness.submit(PX4.hold())
        for _ in range(count):
            harness.receive(ack(SET_MODE, ACCEPTED))
        assert future.done() is (count == 2)
        harness.run(0.35)
        assert future.result(0) is None


def test_control_is_taken_only_once_setpoints_have_flowed() -> None:
    harness = Harness()
    harness.submit(PX4.take_control())
    harness.run(0.2)
    assert harness.commands(SET_MODE) == []
    harness.setpoints.sent_for_s = 0.45
    harness.run(0.05)
    (sent,) = harness.commands(SET_MODE)
    assert (sent.param1, sent.param2, sent.param3) == (1.0, 6.0, 0.0)


def test_a_newer_mode_replaces_the_one_before_at_once() -> None:
    harness = Harness()
    waiting = harness.submit(PX4.take_control())
    holding = harness.submit(PX4.hold())
    assert [(sent.param2, sent.param3) for sent in harness.commands(SET_MODE)] == [(4.0, 3.0)]
    landing = harness.submit(PX4.land())
    harness.setpoints.sent_for_s = 1.0
    harness.receive(ack(LAND, ACCEPTED))
    harness.run(5.0)
    assert harness.commands(SET_MODE) == []
    assert landing.done()
    assert not waiting.done()
    assert not holding.done()


def test_of_one_kind_of_request_one_is_in_progress_at_a_time() -> None:
    harness = Harness()
    first, second = (harness.submit(request_message(message_id)) for message_id in (49, 242))
    request = mavlink.MAV_CMD_REQUEST_MESSAGE
    assert [sent.param1 for sent in harness.commands(request)] == [49.0]
    harness.receive(ack(request, ACCEPTED))
    assert [sent.param1 for sent in harness.commands(request)] == [242.0]
    assert (first.done(), second.done()) == (True, False)


def test_a_heartbeat_is_requested_after_an_acknowledgement_and_after_an_event() -> None:
    harness = Harness()
    harness.receive(*ANSWERS)
    harness.run(2.0)
    harness.link.sent.clear()
    harness.submit(PX4.arm(Snapshot(0.0)))
    harness.receive(ack(ARM, ACCEPTED))
    harness.run(0.05)
    assert _heartbeats_requested(harness) == 1
    for _ in range(5):
        harness.receive(data=EVENT)
    harness.run(0.2)
    assert _heartbeats_requested(harness) == 1


@pytest.mark.parametrize("mode", [OFFBOARD, LANDING])
def test_after_a_flight_of_ours_no_mode_is_changed_until_somebody_asks_to_arm(mode: int) -> None:
    harness = Harness()
    harness.receive(heartbeat(OFFBOARD, armed=True))
    harness.setpoints.sent_for_s = 1.0
    harness.run(1.0)
    harness.setpoints.sent_for_s = 0.0
    harness.receive(heartbeat(LANDING, armed=True), heartbeat(mode))
    harness.run(10.0)
    assert harness.commands(SET_MODE) == []
    harness.receive(heartbeat(mode))
    future = harness.submit(PX4.arm(harness.snapshot()))
    assert [(sent.param2, sent.param3) for sent in harness.commands(SET_MODE)] == [LOITER]
    harness.receive(ack(SET_MODE, ACCEPTED), ack(SET_MODE, ACCEPTED))
    assert len(harness.commands(ARM)) == 1
    assert not future.done()
    harness.receive(ack(ARM, ACCEPTED))
    assert future.result(0) is None


@pytest.mark.parametrize("mode", [3 << 16, 4 << 16 | 3 << 24, 1 << 16])
def test_in_a_mode_in_which_it_can_be_armed_px4_is_armed_as_it_is(mode: int) -> None:
    harness = Harness()
    harness.receive(heartbeat(mode))
    harness.submit(PX4.arm(harness.snapshot()))
    harness.run(0.1)
    assert len(harness.commands(ARM)) == 1
    assert PX4.arm(harness.snapshot()).then is None


def test_where_the_mode_cannot_be_left_nothing_is_armed_and_the_error_says_so() -> None:
    harness = Harness()
    harness.receive(heartbeat(OFFBOARD))
    future = harness.submit(PX4.arm(harness.snapshot()))
    harness.receive(ack(SET_MODE, REJECTED))
    harness.run(0.2)
    assert str(future.exception(0)) == "PX4 refused to leave OFFBOARD, to be armed: TEMPORARILY_REJECTED"
    assert harness.commands(ARM) == []


EVENT = b"\xfd\x01\x00\x00\x00\x01\x01" + (410).to_bytes(3, "little") + b"\x00\x48\xf5"
ANSWERS = [
    mavlink.MAVLink_autopilot_version_message(0, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0),
    mavlink.MAVLink_gps_global_origin_message(1, 1, 1),
    mavlink.MAVLink_home_position_message(1, 1, 1, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0),
]


def _heartbeats_requested(harness: Harness) -> int:
    return len([sent for sent in harness.commands(mavlink.MAV_CMD_REQUEST_MESSAGE) if sent.param1 == 0.0])


def test_a_withdrawn_command_that_waits_for_setpoints_is_never_sent() -> None:
    harness = Harness()
    harness.submit(PX4.take_control()).cancel()
    harness.setpoints.sent_for_s = 1.0
    _run_received(harness, 10.0, heartbeat())
    assert harness.commands(SET_MODE) == []


def test_nothing_is_sent_first_into_a_silence_nor_before_the_mode_is_known_after_it() -> None:
    harness = Harness()
    harness.run(0.3)
    harness.link.sent.clear()
    harness.submit(PX4.hold())
    harness.run(0.5)
    assert harness.commands(SET_MODE) == []
    harness.receive(SOMETHING)
    harness.run(0.1)
    requests = harness.link.take("COMMAND_LONG")
    assert [sent.param1 for sent in requests if sent.command == mavlink.MAV_CMD_REQUEST_MESSAGE][:1] == [0.0]
    assert [sent for sent in requests if sent.command == SET_MODE] == []
    harness.receive(heartbeat(IN_POSCTL, armed=True))
    harness.run(0.05)
    assert len(harness.commands(SET_MODE)) == 0  # others have chosen POSCTL since
    harness.submit(PX4.hold())
    assert len(harness.commands(SET_MODE)) == 1


def test_a_reboot_ends_what_was_sent_to_the_boot_before() -> None:
    harness = Harness()
    harness.receive(attitude(boot_ms=60_000))
    harness.submit(PX4.arm(Snapshot(0.0)))
    harness.commands(ARM)
    harness.now_s += 1.0
    for boot_ms in (500, 520, 540):
        harness.receive(attitude(boot_ms=boot_ms), heartbeat())
    assert harness.supervision.watch.reboots_count == 1
    _run_received(harness, 3.0, heartbeat())
    assert harness.commands(ARM) == []


def test_a_command_withdrawn_before_its_turn_is_not_sent_and_replaces_none() -> None:
    harness = Harness()
    holding = harness.submit(PX4.hold())
    withdrawn: Future[None] = Future()
    withdrawn.cancel()
    harness.session.submit(PX4.land(), harness.now_s, withdrawn)
    assert harness.commands(LAND) == []
    harness.receive(ack(SET_MODE, ACCEPTED), ack(SET_MODE, ACCEPTED))
    assert holding.done()


def _run_received(harness: Harness, duration_s: float, *messages: Message) -> None:
    """Time passes while the autopilot sends something."""
    for _ in range(round(duration_s / 0.05)):
        harness.run(0.05)
        harness.receive(*messages)


SOMETHING = mavlink.MAVLink_ping_message(0, 0, 0, 0)
IN_POSCTL = 3 << 16


def test_what_was_armed_and_disarmed_within_one_batch_is_not_armed_again() -> None:
    harness = Harness()
    future = harness.submit(PX4.arm(Snapshot(0.0)))
    harness.now_s += 0.01
    harness.receive(heartbeat(armed=True), heartbeat(armed=False))
    harness.commands(ARM)
    _run_received(harness, 2.0, heartbeat(armed=False))
    assert harness.commands(ARM) == []
    assert future.done()


IN_RTL, IN_LOITER = 4 << 16 | 5 << 24, 4 << 16 | 3 << 24


@pytest.mark.parametrize("make", [PX4.take_control, PX4.land, PX4.hold], ids=["take_control", "land", "hold"])
def test_what_was_sent_is_not_sent_again_once_another_mode_was_chosen(make: Callable[[], LongCommand]) -> None:
    harness = Harness()
    harness.setpoints.sent_for_s = 1.0
    harness.receive(heartbeat(IN_POSCTL, armed=True))
    command = make()
    harness.submit(command)
    _run_received(harness, 0.1, heartbeat(IN_POSCTL, armed=True))
    assert len(harness.commands(command.request.id)) == 1
    harness.receive(heartbeat(IN_RTL, armed=True), heartbeat(IN_POSCTL, armed=True))  # in one batch
    _run_received(harness, 3.0, heartbeat(IN_POSCTL, armed=True))
    assert harness.commands(command.request.id) == []


def test_what_follows_a_change_of_the_mode_is_not_sent_once_another_mode_was_chosen() -> None:
    """ArduPilot takes off in other modes than GUIDED, too."""
    harness = Harness()
    harness.receive(heartbeat(IN_POSCTL, armed=True))
    climb = replace(command_of(mavlink.MAV_CMD_NAV_TAKEOFF, (), "climb", FLYING), mode="AUTO.LOITER")
    harness.submit(replace(PX4.hold(), then=climb))
    harness.receive(ack(SET_MODE, ACCEPTED), heartbeat(IN_RTL, armed=True), ack(SET_MODE, ACCEPTED))
    _run_received(harness, 3.0, heartbeat(IN_RTL, armed=True))
    assert harness.commands(climb.request.id) == []


def test_the_mode_of_the_command_before_may_still_be_observed_first() -> None:
    harness = Harness()
    harness.receive(heartbeat(IN_POSCTL, armed=True))
    harness.submit(PX4.hold())
    landing = harness.submit(PX4.land())
    _run_received(harness, 0.2, heartbeat(IN_LOITER, armed=True))
    harness.commands(LAND)
    _run_received(harness, 0.5, heartbeat(IN_LOITER, armed=True))
    assert len(harness.commands(LAND)) >= 1
    harness.receive(heartbeat(LANDING, armed=True))
    assert landing.done()
