"""The exchanges of parameters, message by message: what is sent, again, or not any more, and how each ends."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import received
from tests.ual_daemon.backends.mavlink.fakes import Harness, heartbeat, position
from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
    UalError,
    UalTimeoutError,
    WrongStateError,
)
from ual.parameters.values import Parameter, ParameterType
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.dialects.unknown import Unknown
from ual_daemon.backends.mavlink.protocols.parameter_exchanges import (
    CONTRARY_COUNT,
    LIST_SILENCE_S,
    LONGEST_LIST_S,
    MOST_PARAMETERS,
    MOST_PENDING_REQUESTS,
    PROGRESS_TIMEOUT_S,
    RETRY_S,
    TRIES_COUNT,
)
from ual_daemon.backends.mavlink.protocols.parameter_transfers import MOST_WAITING_EXCHANGES, ParameterTransfers
from ual_daemon.backends.mavlink.wire import checksum
from ual_daemon.backends.mavlink.wire.frames import MessageSource

REAL32, INT32 = ParameterType.REAL32, ParameterType.INT32
X5 = Parameter("X", 5.0, REAL32)


class Bench:
    """The transfers with a PX4, and what they have sent."""

    def __init__(self, dialect: Dialect | None = None) -> None:
        self.sent: list[Any] = []
        self.now_s = 100.0
        self.is_up = True
        self.refusal: UalError | None = None
        """Why nothing may be written now."""
        self.transfers = ParameterTransfers(self.sent.append, lambda _: self.is_up)
        self.transfers.attach(MessageSource(7, 1), dialect or Px4())

    def tick(self, count: int = 0, every_s: float = RETRY_S + 0.01) -> None:
        """Ticks now, or so many times later."""
        for _ in range(count or 1):
            self.now_s += every_s if count else 0.0
            self.transfers.tick(self.now_s)

    def value(self, name: str, value: float, place: int = 65535, total: int = 3, kind: int = 9) -> None:
        """A PARAM_VALUE comes."""
        message = mavlink.MAVLink_param_value_message(name.encode(), value, kind, total, place)
        self.transfers.on_value(received(message), self.now_s)

    def read(self, name: str = "X") -> Future[Parameter]:
        future: Future[Parameter] = Future()
        self.transfers.read(name, future)
        self.tick()
        return future

    def write(self, wanted: Parameter = X5) -> Future[Parameter]:
        future: Future[Parameter] = Future()
        self.transfers.write(wanted, lambda: self.refusal, future)
        self.tick()
        return future

    def read_all(self) -> Future[list[Parameter]]:
        future: Future[list[Parameter]] = Future()
        self.transfers.read_all(future)
        self.tick()
        return future

    def requests(self) -> list[Any]:
        """Returns what was sent since the last call: names that are read, places, values that are written, the list."""
        sent, self.sent[:] = [received(each) for each in self.sent], []
        assert all((each.target_system, each.target_component) == (7, 1) for each in sent)
        shown: dict[str, Any] = {
            "PARAM_REQUEST_LIST": lambda _: "list",
            "PARAM_REQUEST_READ": lambda each: each.param_id if each.param_index < 0 else each.param_index,
            "PARAM_SET": lambda each: (each.param_id, each.param_value),
        }
        return [shown[each.get_type()](each) for each in sent]


def error_of(future: Future[Any]) -> UalError:
    assert future.done()
    error = future.exception()
    assert isinstance(error, UalError)
    return error


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_one_is_read_by_name_and_others_are_not_taken_for_it(bench: Bench) -> None:
    future = bench.read()
    bench.value("Y", 1.0)
    assert not future.done()
    bench.value("X", 2.5)
    assert future.result(0) == Parameter("X", 2.5, REAL32)
    assert bench.requests() == ["X"]
    bench.tick(5)
    assert bench.requests() == []


def test_what_was_received_before_the_request_is_no_answer(bench: Bench) -> None:
    future: Future[Parameter] = Future()
    bench.transfers.read("X", future)
    bench.value("X", 1.0)
    bench.tick()
    assert not future.done()


def test_a_lost_request_is_repeated_and_its_silence_ends(bench: Bench) -> None:
    future = bench.read()
    bench.tick(TRIES_COUNT)
    assert bench.requests() == ["X"] * TRIES_COUNT
    error = error_of(future)
    assert isinstance(error, UalTimeoutError)
    assert "no parameter of this name" in error.message


def test_silence_of_a_lost_link_is_reported_as_such(bench: Bench) -> None:
    future = bench.read()
    bench.is_up = False
    bench.tick(TRIES_COUNT)
    assert isinstance(error_of(future), LinkLostError)


def test_a_name_that_the_last_list_lacked_is_known_not_to_be_there(bench: Bench) -> None:
    listed = bench.read_all()
    bench.value("MPC_XY_CRUISE", 5.0, 0, 1)
    assert len(listed.result(0)) == 1
    future = bench.read("MPC_XY_CRUSE")
    bench.tick(TRIES_COUNT)
    assert isinstance(error_of(future), InvalidArgumentError)
    assert "did you mean MPC_XY_CRUISE?" in str(future.exception())


def test_what_the_autopilot_says_of_a_name_is_quoted(bench: Bench) -> None:
    for number, kind in (
        (mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST, InvalidArgumentError),
        (mavlink.MAV_PARAM_ERROR_READ_ONLY, RejectedByAutopilotError),
        (99, RejectedByAutopilotError),
    ):
        future = bench.read()
        for name in (b"Y", b"X"):
            assert not future.done()
            message = mavlink.MAVLink_param_error_message(7, 191, name, -1, number)
            bench.transfers.on_error(received(message))
        assert isinstance(error_of(future), kind)


def test_a_write_is_read_back(bench: Bench) -> None:
    future = bench.write()
    assert bench.requests() == [("X", 5.0)]
    bench.value("X", 5.0)
    assert bench.requests() == ["X"]
    assert not future.done()
    bench.value("X", 5.0)
    assert future.result(0) == X5


def test_a_late_answer_of_a_request_before_is_no_refusal(bench: Bench) -> None:
    future = bench.write()
    bench.value("X", 4.0)
    bench.tick(1)
    bench.value("X", 5.0)
    bench.value("X", 5.0)
    assert future.result(0) == X5
    assert bench.requests() == [("X", 5.0), ("X", 5.0), "X"]


def test_a_write_that_does_not_stick_is_an_error_with_what_is_kept(bench: Bench) -> None:
    future = bench.write()
    for _ in range(CONTRARY_COUNT):
        assert not future.done()
        bench.value("X", 4.0)
        bench.tick(1)
    error = error_of(future)
    assert isinstance(error, RejectedByAutopilotError)
    assert error.metadata == {"name": "X", "kept": "4", "wanted": "5"}
    assert bench.requests() == [("X", 5.0)] * CONTRARY_COUNT


def test_a_write_that_is_confirmed_and_then_gone_is_an_error(bench: Bench) -> None:
    future = bench.write()
    for _ in range(CONTRARY_COUNT):
        bench.value("X", 5.0)
        bench.value("X", 4.0)
        bench.tick(1)
    assert isinstance(error_of(future), RejectedByAutopilotError)


def test_a_write_without_an_answer_says_that_nothing_is_known(bench: Bench) -> None:
    future = bench.write()
    bench.tick(TRIES_COUNT)
    assert "it is not known whether it is 5 now" in error_of(future).message
    future = bench.write()
    bench.value("X", 5.0)
    bench.tick(TRIES_COUNT)
    assert "not read back" in error_of(future).message


def test_a_write_is_not_sent_again_once_it_may_not_be_any_more(bench: Bench) -> None:
    future = bench.write()
    bench.refusal = WrongStateError("set a parameter: the UAV is armed", {"needed": "disarmed"})
    bench.tick(3)
    assert bench.requests() == [("X", 5.0)]
    error = error_of(future)
    assert isinstance(error, WrongStateError)
    assert "it is not known whether X is 5 now" in error.message
    assert error_of(bench.write()) is bench.refusal
    assert bench.requests() == []


def test_a_write_that_arrived_before_is_read_back_all_the_same(bench: Bench) -> None:
    future = bench.write()
    bench.refusal = WrongStateError("set a parameter: the UAV is armed")
    bench.value("X", 5.0)
    bench.value("X", 5.0)
    assert future.result(0) == X5


@pytest.mark.parametrize(
    ("dialect", "wanted", "on_wire"),
    [
        (Px4(), Parameter("I", 2, INT32), 2.802596928649634e-45),
        (ArduCopter(), Parameter("I", 2, INT32), 2.0),
        (ArduCopter(), Parameter("I", -3, ParameterType.INT8), -3.0),
        (Px4(), Parameter("I", -1, INT32), float("nan")),
    ],
)
def test_integers_are_sent_as_each_autopilot_takes_them(dialect: Dialect, wanted: Parameter, on_wire: float) -> None:
    bench = Bench(dialect)
    future = bench.write(wanted)
    [(name, sent)] = bench.requests()
    assert (name, sent) == ("I", pytest.approx(on_wire, rel=1e-9, nan_ok=True))
    for _ in range(2):
        bench.value("I", sent, kind=wanted.type.value)
    assert future.result(0) == wanted


def test_what_the_wire_cannot_say_exactly_is_refused_before_anything_is_sent() -> None:
    bench = Bench(ArduCopter())
    assert isinstance(error_of(bench.write(Parameter("I", 2**24 + 1, INT32))), InvalidArgumentError)
    assert isinstance(error_of(bench.write(Parameter("I", 300, ParameterType.INT8))), InvalidArgumentError)
    assert isinstance(error_of(bench.write(Parameter("F", float("nan"), REAL32))), InvalidArgumentError)
    assert bench.requests() == []


def test_exchanges_of_single_ones_take_turns_and_their_number_is_limited(bench: Bench) -> None:
    first, second = bench.read("A"), bench.read("B")
    bench.value("B", 1.0)
    assert bench.requests() == ["A"]
    bench.value("A", 1.0)
    bench.tick()
    bench.value("B", 2.0)
    assert (first.result(0).value, second.result(0).value) == (1.0, 2.0)
    many = [bench.read(f"N{count}") for count in range(MOST_WAITING_EXCHANGES + 2)]
    assert isinstance(error_of(many[-1]), ResourceExhaustedError)
    assert not many[0].done()


def test_one_that_is_not_waited_for_any_more_costs_the_next_no_time(bench: Bench) -> None:
    first, second = bench.read("A"), bench.read("B")
    first.cancel()
    bench.tick()
    bench.value("B", 2.0)
    assert second.result(0).value == 2.0


def test_the_list_is_in_the_order_of_the_autopilot_and_serves_all_who_ask(bench: Bench) -> None:
    one, two = bench.read_all(), bench.read_all()
    for place in (2, 0, 1, 0):
        bench.value("ABC"[place], float(place), place)
    assert [each.name for each in one.result(0)] == ["A", "B", "C"]
    assert two.result(0) == one.result(0)
    assert bench.requests() == ["list"]


def test_one_that_comes_of_its_own_accord_is_none_of_the_list(bench: Bench) -> None:
    future = bench.read_all()
    bench.value("_HASH_CHECK", 1.0, 65535, 3)  # one of its own accord
    assert not future.done()


def test_what_is_not_known_is_reported_and_not_listed(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    future = bench.read_all()
    bench.value("A", 1.0, 0, 2)
    bench.value("B", 1.0, 1, 2, kind=10)
    assert [each.name for each in future.result(0)] == ["A"]
    assert "not listed: B" in caplog.text


def test_missing_ones_are_requested_a_few_at_a_time(bench: Bench) -> None:
    future = bench.read_all()
    bench.value("N0", 0.0, 0, 30)
    bench.requests()
    bench.tick(1, LIST_SILENCE_S - 0.1)
    assert bench.requests() == []
    bench.tick(1, 0.2)
    assert bench.requests() == list(range(1, 1 + MOST_PENDING_REQUESTS))
    bench.tick(1, 0.1)
    assert bench.requests() == []
    for place in (1, 2):
        bench.value(f"N{place}", 0.0, place, 30)
    bench.tick(1, 0.1)
    assert bench.requests() == [11, 12]
    bench.tick(1, RETRY_S - 0.05)
    assert bench.requests() == list(range(3, 11))  # 11 and 12 are still awaited
    for place in range(30):
        bench.value(f"N{place}", 0.0, place, 30)
    assert len(future.result(0)) == 30


def test_a_list_of_which_some_never_come_says_how_many(bench: Bench) -> None:
    future = bench.read_all()
    bench.value("A", 0.0, 0)
    bench.tick(200, PROGRESS_TIMEOUT_S / 100)
    assert error_of(future).metadata == {"missing": "2", "count": "3"}


def test_a_list_that_is_not_answered_ends(bench: Bench) -> None:
    future = bench.read_all()
    bench.tick(200, PROGRESS_TIMEOUT_S / 100)
    assert isinstance(error_of(future), UalTimeoutError)
    assert 5 <= bench.requests().count("list") <= 7


def test_a_list_whose_length_changes_begins_anew_but_not_for_ever(bench: Bench) -> None:
    future = bench.read_all()
    bench.value("A", 0.0, 0, 2)
    bench.value("Z", 0.0, 0, 3)
    for place in range(1, 3):
        bench.value("ABC"[place], 0.0, place, 3)
    assert [each.name for each in future.result(0)] == ["Z", "B", "C"]
    future = bench.read_all()
    for total in (2, 3, 4, 5, 6):
        bench.value("A", 0.0, 0, total)
    assert isinstance(error_of(future), UalTimeoutError)


def test_a_list_that_drips_for_ever_ends(bench: Bench) -> None:
    future = bench.read_all()
    for place in range(MOST_PARAMETERS):
        bench.value("A", 0.0, place, MOST_PARAMETERS)
        bench.tick(1, PROGRESS_TIMEOUT_S / 2)
        if future.done():
            break
    assert isinstance(error_of(future), UalTimeoutError)
    assert bench.now_s - 100.0 == pytest.approx(LONGEST_LIST_S, abs=PROGRESS_TIMEOUT_S)


def test_too_many_are_not_read(bench: Bench) -> None:
    future = bench.read_all()
    bench.value("A", 0.0, 0, MOST_PARAMETERS + 1)
    assert isinstance(error_of(future), NotSupportedError)


def test_another_autopilot_or_another_boot_ends_everything(bench: Bench) -> None:
    def begun() -> list[Future[Any]]:
        return [bench.read("A"), bench.write(), bench.read_all()]

    ends: list[Callable[[], None]] = [
        lambda: bench.transfers.drop("it has booted"),
        lambda: bench.transfers.attach(MessageSource(8, 1), Px4()),
    ]
    for end in ends:
        futures = begun()
        end()
        assert all(isinstance(error_of(each), LinkLostError) for each in futures)


def test_an_autopilot_that_is_only_watched_is_not_queried() -> None:
    bench = Bench(Unknown(0))
    for future in (bench.read(), bench.write(), bench.read_all()):
        assert isinstance(error_of(future), NotSupportedError)
    assert bench.requests() == []


@pytest.mark.parametrize("seed", range(20))
def test_each_exchange_ends_whatever_comes(seed: int) -> None:
    """Ends within its time, by one result or error, and raises nothing on the thread that receives."""
    noise = random.Random(seed)
    bench = Bench(noise.choice((Px4(), ArduCopter())))
    futures: list[Future[Any]] = [bench.read(), bench.write(), bench.read_all(), bench.write(Parameter("I", 3, INT32))]
    for _ in range(20_000):
        if all(each.done() for each in futures):
            break
        value = noise.choice((0.0, 5.0, 3.0, float("nan"), float("inf"), -1e38, noise.uniform(-9.0, 9.0)))
        total = noise.choice((0, 1, 3, 3, 3, 65535, noise.randrange(65536)))
        place = noise.choice((0, 1, 2, 65535, noise.randrange(65536)))
        bench.value(noise.choice("XXIYZ"), value, place, total, noise.randrange(12))
        bench.tick(1, noise.choice((0.0, 0.0, 0.05, 0.5)))
    bench.tick(2000, 0.5)
    assert all(each.done() for each in futures)


# --- With the session -------------------------------------------------------------------------------------------------


@pytest.fixture
def harness() -> Harness:
    harness = Harness()
    harness.receive(heartbeat(), position(0.0))
    return harness


def begin(harness: Harness) -> Future[Parameter]:
    future: Future[Parameter] = Future()
    harness.discovery.protocols.parameters.read("X", future)
    harness.run(0.1)
    return future


def test_a_request_leaves_through_the_session_and_its_answer_comes_back(harness: Harness) -> None:
    future = begin(harness)
    assert [each.param_id for each in harness.link.take("PARAM_REQUEST_READ") if each.param_id == "X"] == ["X"]
    harness.receive(mavlink.MAVLink_param_value_message(b"X", 2.5, mavlink.MAV_PARAM_TYPE_REAL32, 3, 0))
    assert future.result(0).value == 2.5


def test_a_refusal_for_another_ground_station_is_none_for_us(harness: Harness) -> None:
    future = begin(harness)
    missing = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
    harness.receive(mavlink.MAVLink_param_error_message(255, 190, b"X", -1, missing))
    assert not future.done()
    harness.receive(mavlink.MAVLink_param_error_message(1, 191, b"X", -1, missing))
    assert isinstance(error_of(future), InvalidArgumentError)


def test_a_boot_ends_what_is_in_progress(harness: Harness) -> None:
    harness.now_s = 60.0
    harness.receive(heartbeat(), position(60.0))
    future = begin(harness)
    for boot_ms in (1000, 1100, 1200, 1300):  # a boot is believed when several messages agree
        harness.receive(mavlink.MAVLink_local_position_ned_message(boot_ms, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        harness.run(0.1)
    assert isinstance(error_of(future), LinkLostError)
    assert "has booted" in str(future.exception())


def test_the_end_of_the_daemon_ends_what_is_in_progress(harness: Harness) -> None:
    future = begin(harness)
    harness.discovery.release()
    assert isinstance(error_of(future), LinkLostError)


@pytest.mark.parametrize("value", [-5_000_000, -8_388_607, 2_139_095_041, -1])
def test_an_integer_whose_bytes_are_those_of_a_signalling_nan_is_read_as_it_is(harness: Harness, value: int) -> None:
    """Python makes a quiet one of it, as the processor does: -5,000,000 was read as -805,696."""
    future = begin(harness)
    told = mavlink.MAVLink_param_value_message(b"X", 1.0, mavlink.MAV_PARAM_TYPE_INT32, 3, 0)
    frame = harness.pack(told)
    covered = frame[1:10] + struct.pack("<i", value) + frame[14:-2]
    harness.receive(data=frame[:1] + covered + checksum.compute(covered, told.crc_extra))
    assert future.result(0) == Parameter("X", value, INT32)
