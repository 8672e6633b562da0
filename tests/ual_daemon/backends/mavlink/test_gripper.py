"""Messages that move a payload, and the trust in the answers: late ones, doubled ones, none at all."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import Harness, ack, attitude, heartbeat, position
from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError, UalError, UalTimeoutError
from ual.gripper import GripperState, WinchAction, WinchStatus
from ual_daemon.backends.firmwares.gripper_codec import ANSWER_S, UNSENT_ORDER_S
from ual_daemon.backends.futures import OpenFutures
from ual_daemon.backends.mavlink.dialects.command_long import LongCommand
from ual_daemon.backends.mavlink.offers.gripper import MavlinkGripper
from ual_daemon.backends.mavlink.offers.protocol_access import Orders, ProtocolAccess
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.payload_messages import PayloadMessages
from ual_daemon.backends.mavlink.session.session import MavlinkSession
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.offers.gripper import ServoOrder, WinchOrder

T = TypeVar("T")
GRIPPER, WINCH = mavlink.MAV_CMD_DO_GRIPPER, mavlink.MAV_CMD_DO_WINCH
SERVO, RELAY, ACTUATOR = mavlink.MAV_CMD_DO_SET_SERVO, mavlink.MAV_CMD_DO_SET_RELAY, mavlink.MAV_CMD_DO_SET_ACTUATOR
MOVING = (GRIPPER, WINCH, SERVO, RELAY, ACTUATOR)
ACCEPTED, IN_PROGRESS = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS
DENIED, CANCELLED = mavlink.MAV_RESULT_DENIED, 6  # which pymavlink calls no name
BUSY = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
NAN = math.nan


class Bench(Harness):
    """An autopilot that is heard, and what it is ordered; nothing answers but the test."""

    def __init__(self, autopilot: int) -> None:
        super().__init__()
        messages = PayloadMessages()
        self.discovery = Discovery(MavlinkSettings(), self.link, "test", self.setpoints, None, messages)
        reach = ProtocolAccess(
            lambda: self.discovery.session, self._require_session, lambda act: act(self.discovery), self._give
        )
        self.gripper = MavlinkGripper(Orders(reach, self._command, messages))
        self.autopilot = autopilot
        self.orders: list[tuple[float, ...]] = []
        self.requests: list[float] = []

    def fly(self, duration_s: float) -> None:
        """Time passes while the autopilot is heard."""
        for _ in range(round(duration_s / 0.05)):
            self.receive(heartbeat(autopilot=self.autopilot), attitude(), position(self.now_s))
            self.run(0.05)
            self.note()

    def note(self) -> None:
        """Notes what was sent."""
        for each in self.link.take("COMMAND_LONG"):
            params = (each.param1, each.param2, each.param3, each.param4, each.param5, each.param6, each.param7)
            if each.command in MOVING:
                self.orders.append((each.command, *params))
            elif each.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
                self.requests.append(each.param1)

    def answer(self, command: int, result: int) -> None:
        """The autopilot acknowledges."""
        self.receive(ack(command, result))

    def _require_session(self, what: str) -> MavlinkSession | UalError:
        if self.discovery.session is None or not self.discovery.watch.is_up(self.now_s):
            return LinkLostError(f"cannot {what}: not heard")
        return self.session

    def _give(self, what: str, begin: Callable[[Discovery, Future[T]], object]) -> Future[T]:
        return OpenFutures().give(what, lambda future: begin(self.discovery, future))

    def _command(self, what: str, command: LongCommand) -> Future[None]:
        session, result = self._require_session(what), Future[None]()
        if isinstance(session, UalError):
            result.set_exception(session)
            return result
        return session.submit(command, self.now_s, result)


def bench_of(autopilot: int) -> Bench:
    bench = Bench(autopilot)
    bench.fly(3.0)
    return bench


@pytest.fixture
def copter() -> Bench:
    return bench_of(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)


@pytest.fixture
def px4() -> Bench:
    return bench_of(mavlink.MAV_AUTOPILOT_PX4)


def failed(future: Future[Any], kind: type[UalError]) -> UalError:
    error = future.exception(0)
    assert isinstance(error, kind), error
    return error


# --- What is sent -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("order", "sent"),
    [
        (lambda it: it.grip(1), (GRIPPER, 1, 1, 0, 0, 0, 0, 0)),
        (lambda it: it.release(1), (GRIPPER, 1, 0, 0, 0, 0, 0, 0)),
        (lambda it: it.order_winch(1, WinchOrder(WinchAction.RELAX)), (WINCH, 1, 0, 0, 0, 0, 0, 0)),
        (lambda it: it.order_winch(1, WinchOrder(WinchAction.LENGTH, -2.5)), (WINCH, 1, 1, -2.5, 0, 0, 0, 0)),
        (lambda it: it.order_winch(1, WinchOrder(WinchAction.RATE, None, 0.5)), (WINCH, 1, 2, 0, 0.5, 0, 0, 0)),
        (lambda it: it.order_winch(1, WinchOrder(WinchAction.HOLD)), (WINCH, 1, 2, 0, 0, 0, 0, 0)),
        (lambda it: it.set_servo(ServoOrder(9, 1100, 1000, 2000)), (SERVO, 9, 1100, 0, 0, 0, 0, 0)),
        (lambda it: it.set_relay(1, is_on=True), (RELAY, 0, 1, 0, 0, 0, 0, 0)),
        (lambda it: it.set_relay(6, is_on=False), (RELAY, 5, 0, 0, 0, 0, 0, 0)),
    ],
)
def test_what_arducopter_is_sent(
    copter: Bench, order: Callable[[MavlinkGripper], Future[None]], sent: tuple[float, ...]
) -> None:
    ordered = order(copter.gripper)
    copter.fly(0.05)
    assert copter.orders == [sent]
    copter.answer(int(sent[0]), ACCEPTED)
    assert ordered.result(0) is None


def test_px4_gets_the_actuators_of_its_set_and_leaves_the_others(px4: Bench) -> None:
    px4.gripper.set_servo(ServoOrder(2, 1250, 1000, 2000))
    px4.fly(0.05)
    [sent] = px4.orders
    assert sent[0] == ACTUATOR
    assert [value if math.isfinite(value) else None for value in sent[1:]] == [None, -0.5, None, None, None, None, 0.0]


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (lambda it: it.order_winch(1, WinchOrder(WinchAction.HOLD)), "PX4 has no winch"),
        (lambda it: it.set_relay(1, is_on=True), "PX4 has no relays"),
        (lambda it: it.set_servo(ServoOrder(7, 1500, 1000, 2000)), "PX4 has the actuators 1 to 6"),
        (lambda it: it.grip(2), "PX4 has one gripper: its instance is 1, and not 2"),
        (lambda it: it.gripper_state(1), "PX4 does not say in which state"),
        (lambda it: it.servo_pwm_us(1), "PX4 says nothing of its servos"),
        (lambda it: it.relay_is_on(1), "PX4 says nothing of its relays"),
        (lambda it: it.winch_status(1), "PX4 says nothing of its winch"),
    ],
)
def test_what_px4_cannot_is_refused_before_it_is_sent(
    px4: Bench, order: Callable[[MavlinkGripper], Future[Any]], words: str
) -> None:
    with pytest.raises(NotSupportedError, match=words):
        order(px4.gripper)
    px4.fly(0.5)
    assert px4.orders == []


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (
            lambda it: it.order_winch(1, WinchOrder(WinchAction.DELIVER)),
            "ArduPilot's winch cannot DELIVER; it can RELAX",
        ),
        (lambda it: it.order_winch(1, WinchOrder(WinchAction.LENGTH, 1.0, 0.5)), "takes no rate for a length"),
        (lambda it: it.order_winch(2, WinchOrder(WinchAction.HOLD)), "ArduPilot has one winch: its instance is 1"),
        (lambda it: it.release(2), "ArduPilot has one gripper: its instance is 1, and not 2"),
    ],
)
def test_what_arducopter_cannot_is_refused_before_it_is_sent(
    copter: Bench, order: Callable[[MavlinkGripper], Future[None]], words: str
) -> None:
    with pytest.raises(NotSupportedError, match=words):
        order(copter.gripper)
    copter.fly(0.5)
    assert copter.orders == []


def test_nothing_is_moved_unasked(copter: Bench) -> None:
    copter.fly(5.0)
    copter.run(10.0)  # the link is lost
    copter.note()
    copter.fly(2.0)
    copter.discovery.release()
    copter.note()
    assert copter.orders == []


# --- Answers ----------------------------------------------------------------------------------------------------------

LETTING_GO: list[Callable[[MavlinkGripper], Future[None]]] = [
    lambda it: it.release(1),
    lambda it: it.set_servo(ServoOrder(9, 1100, 1000, 2000)),
    lambda it: it.set_relay(1, is_on=False),
    lambda it: it.order_winch(1, WinchOrder(WinchAction.RELAX)),
    lambda it: it.order_winch(1, WinchOrder(WinchAction.LENGTH, 2.0)),
    lambda it: it.order_winch(1, WinchOrder(WinchAction.RATE, None, 0.5)),
]
HOLDING: list[Callable[[MavlinkGripper], Future[None]]] = [
    lambda it: it.grip(1),
    lambda it: it.order_winch(1, WinchOrder(WinchAction.HOLD)),
    lambda it: it.order_winch(1, WinchOrder(WinchAction.RATE, None, 0.0)),
]


@pytest.mark.parametrize("order", LETTING_GO)
def test_what_may_let_go_is_sent_once_and_a_lost_answer_is_reported(
    copter: Bench, order: Callable[[MavlinkGripper], Future[None]]
) -> None:
    ordered = order(copter.gripper)
    copter.fly(ANSWER_S - 0.1)
    assert not ordered.done()
    copter.fly(0.2)
    assert "has not answered the command to" in failed(ordered, UalTimeoutError).message
    assert "which may still be executed" in failed(ordered, UalTimeoutError).message
    copter.fly(5.0)
    assert len(copter.orders) == 1


@pytest.mark.parametrize("order", HOLDING)
def test_what_holds_is_sent_until_it_is_acknowledged(
    copter: Bench, order: Callable[[MavlinkGripper], Future[None]]
) -> None:
    ordered = order(copter.gripper)
    copter.fly(1.1)
    sent = copter.orders[0]
    assert copter.orders in ([sent] * 4, [sent] * 5)
    copter.answer(int(sent[0]), ACCEPTED)
    assert ordered.result(0) is None
    copter.orders.clear()
    copter.fly(2.0)
    assert copter.orders == []


def test_what_holds_is_abandoned_in_the_end_also_into_a_silence(copter: Bench) -> None:
    ordered = copter.gripper.grip(1)
    copter.fly(ANSWER_S + 0.4)
    failed(ordered, UalTimeoutError)
    assert 10 <= len(copter.orders) <= 12
    copter.orders.clear()
    silent = copter.gripper.grip(1)
    copter.run(ANSWER_S + 0.4)
    failed(silent, UalTimeoutError)
    copter.note()
    assert len(copter.orders) == 1


def test_a_refusal_is_reported_in_the_autopilots_words(copter: Bench) -> None:
    ordered = copter.gripper.set_servo(ServoOrder(1, 1100, 1000, 2000))
    copter.fly(0.05)
    said = mavlink.MAVLink_statustext_message(6, b"ServoRelayEvent: Channel 1 is already in use")
    copter.receive(said, ack(SERVO, mavlink.MAV_RESULT_FAILED))
    copter.fly(0.3)
    error = failed(ordered, RejectedByAutopilotError)
    assert "ArduPilot refused to move servo 1: FAILED; it said: ServoRelayEvent: Channel 1 is already" in error.message
    assert len(copter.orders) == 1


def test_px4_says_in_progress_first(px4: Bench) -> None:
    ordered = px4.gripper.release(1)
    px4.fly(0.05)
    px4.answer(GRIPPER, IN_PROGRESS)
    px4.fly(5.0)
    assert not ordered.done()
    px4.answer(GRIPPER, ACCEPTED)
    assert ordered.result(0) is None
    px4.answer(GRIPPER, ACCEPTED)  # doubled
    assert len(px4.orders) == 1


def test_px4_that_never_ends_is_reported(px4: Bench) -> None:
    ordered = px4.gripper.release(1)
    px4.fly(0.05)
    px4.answer(GRIPPER, IN_PROGRESS)
    px4.fly(11.0)
    failed(ordered, UalTimeoutError)
    assert len(px4.orders) == 1


def test_px4_that_is_at_it_already_has_not_refused(px4: Bench) -> None:
    """The first answer was lost; PX4 rejects the repetition while its gripper moves."""
    ordered = px4.gripper.grip(1)
    px4.fly(0.3)
    px4.answer(GRIPPER, BUSY)
    px4.fly(1.0)
    assert not ordered.done()
    px4.answer(GRIPPER, ACCEPTED)
    assert ordered.result(0) is None
    assert len(px4.orders) == 2


def test_px4_that_tells_the_end_of_what_was_replaced_has_not_refused(px4: Bench) -> None:
    px4.gripper.release(1)
    px4.fly(0.05)
    px4.answer(GRIPPER, IN_PROGRESS)
    ordered = px4.gripper.grip(1)
    px4.fly(0.05)
    px4.answer(GRIPPER, CANCELLED)
    px4.answer(GRIPPER, IN_PROGRESS)
    px4.fly(1.1)
    assert not ordered.done()
    px4.answer(GRIPPER, ACCEPTED)
    assert ordered.result(0) is None


def test_px4_that_tells_the_end_of_what_has_timed_out_has_not_refused(px4: Bench) -> None:
    """With PD_GRIPPER_TO above 4 s its gripper still moved, and the grip that was done was told as refused."""
    released = px4.gripper.release(1)
    px4.fly(ANSWER_S + 1.0)  # its first answer was lost
    failed(released, UalTimeoutError)
    ordered = px4.gripper.grip(1)
    px4.fly(1.5)
    px4.answer(GRIPPER, CANCELLED)
    px4.answer(GRIPPER, IN_PROGRESS)
    px4.fly(5.0)
    assert not ordered.done()
    px4.answer(GRIPPER, ACCEPTED)
    assert ordered.result(0) is None


def test_px4_whose_order_in_progress_is_replaced_by_others_tells_it(px4: Bench) -> None:
    ordered = px4.gripper.release(1)
    px4.fly(0.05)
    px4.answer(GRIPPER, IN_PROGRESS)
    px4.fly(1.0)
    px4.answer(GRIPPER, CANCELLED)
    px4.fly(1.0)
    assert "result 6" in failed(ordered, RejectedByAutopilotError).message


def test_a_late_answer_is_not_taken_for_that_of_the_next_order(copter: Bench) -> None:
    withdrawn = copter.gripper.grip(1)
    copter.fly(0.05)
    withdrawn.cancel()
    copter.fly(0.05)
    release = copter.gripper.release(1)
    copter.answer(GRIPPER, ACCEPTED)  # of the grip
    copter.fly(0.5)
    assert len(copter.orders) == 1
    copter.fly(0.6)
    assert copter.orders[1:] == [(GRIPPER, 1, 0, 0, 0, 0, 0, 0)]
    assert not release.done()
    copter.answer(GRIPPER, DENIED)
    copter.fly(0.3)
    failed(release, RejectedByAutopilotError)


def test_a_doubled_answer_is_not_taken_for_that_of_the_next_order(copter: Bench) -> None:
    copter.gripper.set_servo(ServoOrder(9, 1100, 1000, 2000))
    copter.fly(0.05)
    copter.answer(SERVO, ACCEPTED)
    second = copter.gripper.set_servo(ServoOrder(10, 1100, 1000, 2000))
    copter.fly(0.05)
    copter.answer(SERVO, ACCEPTED)  # again of the first
    copter.fly(0.1)
    assert not second.done()
    copter.fly(0.3)
    assert len(copter.orders) == 2
    copter.answer(SERVO, ACCEPTED)
    assert second.result(0) is None


def test_what_may_let_go_never_leaves_late(copter: Bench) -> None:
    copter.run(0.5)  # a silence that is too short to lose the link
    release = copter.gripper.release(1)
    copter.run(UNSENT_ORDER_S + 0.1)
    assert "was not sent: nothing was heard" in failed(release, UalTimeoutError).message
    copter.fly(3.0)
    assert copter.orders == []


def test_without_a_link_nothing_is_ordered(copter: Bench) -> None:
    copter.run(10.0)
    failed(copter.gripper.release(1), LinkLostError)
    failed(copter.gripper.gripper_state(1), LinkLostError)
    failed(copter.gripper.relay_is_on(1), LinkLostError)
    copter.fly(3.0)
    assert copter.orders == []


def test_an_autopilot_that_boots_ends_what_is_in_progress(copter: Bench) -> None:
    release, relay = copter.gripper.release(1), copter.gripper.relay_is_on(1)
    copter.fly(0.05)
    copter.discovery.protocols.drop("the autopilot has booted")
    message = failed(release, LinkLostError).message
    assert (
        message
        == "it is not known whether the autopilot obeyed the order to release the gripper: the autopilot has booted"
    )
    failed(relay, LinkLostError)


SOMETHING = st.one_of(
    st.tuples(st.just("answer"), st.integers(0, 9)),
    st.tuples(st.just("fly"), st.floats(0.05, 2.0)),
    st.tuples(st.just("silence"), st.floats(0.05, 2.0)),
)


@settings(max_examples=25)
@given(
    kind=st.sampled_from([mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4]),
    is_closing=st.booleans(),
    events=st.lists(SOMETHING, max_size=8),
)
def test_whatever_is_answered_an_order_ends_and_a_release_leaves_once(
    kind: int, is_closing: bool, events: list[tuple[str, float]]
) -> None:
    bench = bench_of(kind)
    begun_s = bench.now_s
    ordered = bench.gripper.grip(1) if is_closing else bench.gripper.release(1)
    for what, value in events:
        if what == "answer":
            bench.answer(GRIPPER, int(value))
        elif what == "fly":
            bench.fly(value)
        else:
            bench.run(value)
    while not ordered.done() and bench.now_s - begun_s < 60.0:
        bench.fly(0.5)
    assert ordered.done()
    bench.fly(2.0)
    assert len(bench.orders) <= (12 if is_closing else 1)


@given(st.lists(st.floats(width=32), min_size=5, max_size=5), st.integers(-32768, 32767), st.integers(0, 2**32 - 1))
def test_a_winch_tells_no_number_that_is_none(values: list[float], temperature: int, flags: int) -> None:
    bench = bench_of(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    asked = bench.gripper.winch_status(1)
    bench.receive(mavlink.MAVLink_winch_status_message(0, *values, temperature, flags))
    status = asked.result(0)
    told = (status.length_m, status.speed_m_s, status.tension_n, status.voltage_v, status.current_a)
    assert all(each is None or math.isfinite(each) for each in told)


# --- What is known ----------------------------------------------------------------------------------------------------


def text(words: str) -> Message:
    return mavlink.MAVLink_statustext_message(6, words.encode())


def state(bench: Bench) -> GripperState | None:
    asked = bench.gripper.gripper_state(1)
    return None if asked.exception(0) else asked.result(0)


def test_the_gripper_is_what_arducopter_says_since_the_last_order(copter: Bench) -> None:
    assert state(copter) is None
    for words, said in (
        ("Gripper load grabbing", GripperState.CLOSING),
        ("Gripper load grabbed", GripperState.CLOSED),
        ("Something else", GripperState.CLOSED),
        ("Gripper load releasing", GripperState.OPENING),
        ("Gripper load released", GripperState.OPEN),
    ):
        copter.receive(text(words))
        assert state(copter) is said
    copter.gripper.grip(1)
    assert state(copter) is None
    copter.fly(0.05)
    copter.answer(GRIPPER, ACCEPTED)
    assert state(copter) is None  # it was ordered, and not said to be so
    copter.receive(text("Gripper load grabbed"))
    assert state(copter) is GripperState.CLOSED
    copter.run(10.0)  # what was said meanwhile is not known
    copter.fly(1.0)
    assert state(copter) is None
    assert "since the last order, boot or silence" in failed(copter.gripper.gripper_state(1), UalError).message


def outputs(port: int, first: int, ninth: int) -> Message:
    return mavlink.MAVLink_servo_output_raw_message(0, port, first, *[0] * 7, ninth)


def test_a_servo_is_where_the_output_of_its_channel_says(copter: Bench) -> None:
    ninth, off, high = (copter.gripper.servo_pwm_us(channel) for channel in (9, 2, 17))
    copter.fly(0.6)
    assert copter.requests.count(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW) >= 2
    copter.receive(outputs(0, 1000, 1100))
    assert ninth.result(0) == 1100
    assert not high.done()
    copter.receive(outputs(1, 1700, 0))
    assert high.result(0) == 1700
    assert "puts out nothing at channel 2" in failed(off, UalError).message
    silent = copter.gripper.servo_pwm_us(9)
    copter.fly(3.0)
    assert "the pulse of servo 9 is not known" in failed(silent, UalTimeoutError).message


def test_a_relay_is_what_the_autopilot_says_of_it(copter: Bench) -> None:
    first, second, absent = (copter.gripper.relay_is_on(number) for number in (1, 2, 3))
    copter.receive(mavlink.MAVLink_relay_status_message(0, 0b01, 0b11))
    assert (first.result(0), second.result(0)) == (True, False)
    assert "the autopilot has no relay 3" in failed(absent, NotSupportedError).message


def test_a_winch_says_what_it_knows(copter: Bench) -> None:
    asked = copter.gripper.winch_status(1)
    copter.receive(mavlink.MAVLink_winch_status_message(0, 2.5, -0.5, NAN, NAN, NAN, 32767, 1))
    assert asked.result(0) == WinchStatus(length_m=2.5, speed_m_s=-0.5, is_healthy=True)
    asked = copter.gripper.winch_status(1)
    copter.receive(mavlink.MAVLink_winch_status_message(0, 0.0, 0.0, 2.0, 12.5, 1.5, 40, 0b1110))
    assert asked.result(0) == WinchStatus(0.0, 0.0, 2.0 * 9.80665, 12.5, 1.5, 40.0, False, True, True, True)


def test_a_request_that_is_refused_ends_the_question(copter: Bench) -> None:
    asked = copter.gripper.winch_status(1)
    copter.fly(0.05)
    copter.answer(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_RESULT_UNSUPPORTED)
    copter.fly(0.5)
    assert "UNSUPPORTED" in failed(asked, RejectedByAutopilotError).message
