"""Commands to a component of the vehicle beside the autopilot: what is sent, and which answers count."""

from __future__ import annotations

from concurrent.futures import Future

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import Harness, ack, heartbeat, packer
from ual.errors import (
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    TaskAbortedError,
    UalTimeoutError,
)
from ual_daemon.backends.mavlink.dialects.command_long import AGAIN, CommandLong
from ual_daemon.backends.mavlink.protocols.camera_exchanges import BUSY_TIMEOUT_S
from ual_daemon.backends.mavlink.protocols.component_commands import LATE_ANSWER_S, LOST_COMPONENT_S
from ual_daemon.backends.mavlink.wire.messages import Message

PARACHUTE: int = mavlink.MAV_COMP_ID_PARACHUTE
COMMAND: int = mavlink.MAV_CMD_DO_PARACHUTE
RELEASE = CommandLong(COMMAND, (2.0,))


class Bench(Harness):
    """A vehicle with a component that is heard; nothing answers but the test."""

    def __init__(self) -> None:
        super().__init__()
        self.receive(heartbeat())
        self.say(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_PARACHUTE, 8, 0, 0, 4, 3))

    def say(self, message: Message, component_id: int = PARACHUTE) -> None:
        """A component of the vehicle sends a message."""
        self.receive(data=packer(component_id=component_id)(message))

    def order(self, command: CommandLong = RELEASE) -> Future[None]:
        future: Future[None] = Future()
        self.discovery.protocols.components.order(PARACHUTE, command, "release it", future)
        self.run(0.05)
        return future

    def has_component(self) -> bool:
        future: Future[bool] = Future()
        self.discovery.protocols.components.ask(PARACHUTE, future)
        self.run(0.05)
        return future.result(0)

    def sent(self) -> list[tuple[float, int, int]]:
        """The parameter, target and confirmation of what was sent since the last call."""
        return [(each.param1, each.target_component, each.confirmation) for each in self.commands(COMMAND)]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_component_is_there_while_its_heartbeat_comes(bench: Bench) -> None:
    assert bench.has_component()
    bench.now_s += LOST_COMPONENT_S
    assert not bench.has_component()


def test_a_command_is_sent_again_until_the_component_acknowledges(bench: Bench) -> None:
    future = bench.order()
    bench.run(AGAIN.every_s)
    assert bench.sent() == [(2.0, PARACHUTE, 0), (2.0, PARACHUTE, 1)]
    bench.receive(ack(COMMAND, mavlink.MAV_RESULT_ACCEPTED))  # the autopilot's, which was not asked
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_ACCEPTED, (1, 190)))  # for another program
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_ACCEPTED), component_id=PARACHUTE + 1)
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_IN_PROGRESS))
    assert not future.done()
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_ACCEPTED))
    assert future.result(0) is None
    bench.sent()
    bench.run(2.0 * AGAIN.every_s)
    assert bench.sent() == []


@pytest.mark.parametrize(
    ("result", "error"),
    [
        (mavlink.MAV_RESULT_DENIED, RejectedByAutopilotError),
        (mavlink.MAV_RESULT_TEMPORARILY_REJECTED, RejectedByAutopilotError),
        (mavlink.MAV_RESULT_UNSUPPORTED, NotSupportedError),
    ],
)
def test_a_refusal_ends_it(bench: Bench, result: int, error: type[Exception]) -> None:
    future = bench.order()
    bench.say(ack(COMMAND, result))
    assert isinstance(future.exception(0), error)


def test_without_an_answer_it_is_not_known_whether_it_was_obeyed(bench: Bench) -> None:
    future = bench.order()
    bench.run(2.0 * AGAIN.every_s * AGAIN.most)
    assert len(bench.sent()) == AGAIN.most
    assert isinstance(future.exception(0), UalTimeoutError)


def test_one_that_is_in_progress_is_not_sent_again_and_waited_for(bench: Bench) -> None:
    """It was sent on, and ended as TIMEOUT after 5 s, though the component was busy with it."""
    future = bench.order()
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_IN_PROGRESS))
    bench.sent()
    bench.run(0.9 * BUSY_TIMEOUT_S)
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_IN_PROGRESS))
    bench.run(0.9 * BUSY_TIMEOUT_S)
    assert bench.sent() == []
    assert not future.done()
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_ACCEPTED))
    assert future.result(0) is None
    future = bench.order()
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_IN_PROGRESS))
    bench.run(1.1 * BUSY_TIMEOUT_S)
    assert isinstance(future.exception(0), UalTimeoutError)


def test_late_answers_to_the_one_before_do_not_count(bench: Bench) -> None:
    first = bench.order(CommandLong(COMMAND, (1.0,)))
    bench.run(AGAIN.every_s)
    second = bench.order()
    assert isinstance(first.exception(0), TaskAbortedError)
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_ACCEPTED))
    assert [value for value, _, _ in bench.sent()] == [1.0, 1.0]
    assert not second.done()
    bench.run(LATE_ANSWER_S)
    assert {value for value, _, _ in bench.sent()} == {2.0}
    bench.say(ack(COMMAND, mavlink.MAV_RESULT_ACCEPTED))
    assert second.result(0) is None


def test_a_withdrawn_one_does_not_leave_any_more(bench: Bench) -> None:
    future = bench.order()
    bench.sent()
    future.cancel()
    bench.run(1.0)
    assert bench.sent() == []


def test_the_end_of_the_daemon_ends_it(bench: Bench) -> None:
    future = bench.order()
    bench.discovery.release()
    assert isinstance(future.exception(0), LinkLostError)
