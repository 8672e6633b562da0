from __future__ import annotations

import itertools
import logging
import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import ual
import ual.aio
from tests.ual import fake_daemon
from tests.ual.fake_daemon import FakeDaemon, sample
from tests.waiting import LIMIT_S, until
from ual.errors import DaemonUnreachableError, InvalidArgumentError, UalError
from ual.shared.callbacks import SLOW_CALL_S
from ual.types import Telemetry
from ual.v1 import ual_pb2 as pb


@pytest.fixture
def daemon() -> Iterator[FakeDaemon]:
    with fake_daemon.running() as running:
        yield running


@pytest.fixture
def uav(daemon: FakeDaemon) -> Iterator[ual.Uav]:
    with ual.Uav("uav_1", address=daemon.address) as uav:
        yield uav


def no_thread_is_left() -> None:
    """One that calls back ends by itself, once there is nobody left to call."""
    for thread in threading.enumerate():
        if thread.name.startswith("ual telemetry"):
            thread.join(LIMIT_S)
            assert not thread.is_alive()


class Received:
    def __init__(self) -> None:
        self.samples: list[Telemetry] = []
        self.changed = threading.Condition()

    def __call__(self, telemetry: Telemetry) -> None:
        with self.changed:
            self.samples.append(telemetry)
            self.changed.notify_all()

    def wait_for(self, sequence: int) -> None:
        with self.changed:
            assert self.changed.wait_for(lambda: any(each.sequence == sequence for each in self.samples), LIMIT_S), (
                self.samples
            )


def test_samples_come_on_another_thread(daemon: FakeDaemon, uav: ual.Uav) -> None:
    source = daemon.script()
    threads: list[threading.Thread] = []
    received = Received()

    def callback(telemetry: Telemetry) -> None:
        threads.append(threading.current_thread())
        received(telemetry)

    source.put(sample(1))
    with uav.subscribe(callback):
        received.wait_for(1)
    assert threading.main_thread() not in threads


def test_a_slow_callback_gets_the_newest_and_the_count_of_what_it_missed(
    daemon: FakeDaemon, uav: ual.Uav, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = daemon.script()
    received = Received()
    is_busy, all_came, may_go_on = threading.Event(), threading.Event(), threading.Event()

    def callback(telemetry: Telemetry) -> None:
        if telemetry.sequence == 1:
            is_busy.set()
            assert may_go_on.wait(LIMIT_S)
        received(telemetry)

    source.put(sample(1))
    with uav.subscribe(callback) as subscription:
        assert is_busy.wait(LIMIT_S)
        listener = subscription.listener
        monkeypatch.setattr(listener, "offer", offer_and_tell(listener.offer, 6, all_came))
        for number, missed_count in ((2, 0), (5, 2), (6, 0)):
            source.put(sample(number, missed_count))
        assert all_came.wait(LIMIT_S)
        may_go_on.set()
        received.wait_for(6)
    assert [(each.sequence, each.missed_count) for each in received.samples] == [(1, 0), (6, 4)]


def offer_and_tell(
    offer: Callable[[Telemetry], None], sequence: int, came: threading.Event
) -> Callable[[Telemetry], None]:
    def offer_reported(telemetry: Telemetry) -> None:
        offer(telemetry)
        if telemetry.sequence == sequence:
            came.set()

    return offer_reported


def test_the_stream_is_read_and_others_called_back_however_many_callbacks_do_not_return(
    daemon: FakeDaemon, uav: ual.Uav
) -> None:
    source = daemon.script()
    may_return = threading.Event()
    stuck_count = threading.Semaphore(0)

    def stuck(_: Telemetry) -> None:
        stuck_count.release()
        assert may_return.wait(LIMIT_S)

    received = Received()
    source.put(sample(1))
    with uav.subscribe(stuck), uav.subscribe(stuck), uav.subscribe(stuck), uav.subscribe(received):
        numbers = itertools.count(2)
        # A sample may find one of them, which keeps it from those behind it until the next one comes.
        for _ in range(3):
            while not stuck_count.acquire(timeout=2.0 * SLOW_CALL_S):
                source.put(sample(next(numbers)))
        for _ in range(30):
            time.sleep(2.0 * SLOW_CALL_S)  # only then does a worker count as delayed
            source.put(sample(number := next(numbers)))
        received.wait_for(number)
        may_return.set()
        # The threads that came in the place of those that were stuck end.
        for _ in range(30):
            source.put(sample(number := next(numbers)))
            received.wait_for(number)
    assert sum(each.missed_count + 1 for each in received.samples) == number


def test_what_closes_itself_gives_its_connection_back(daemon: FakeDaemon, uav: ual.Uav) -> None:
    def open_count() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    def close_itself(_: Telemetry) -> None:
        may_close.wait(LIMIT_S)
        subscriptions[-1].close()
        has_closed.set()

    daemon.script().put(sample(1))
    with uav.subscribe(print):
        pass
    no_thread_is_left()
    before_count, subscriptions = open_count(), []
    for _ in range(10):
        may_close, has_closed = threading.Event(), threading.Event()
        daemon.script().put(sample(1))
        subscriptions.append(uav.subscribe(close_itself))
        may_close.set()
        assert has_closed.wait(LIMIT_S)
    no_thread_is_left()
    # The sockets' other ends are here, too.
    until(lambda: open_count() <= before_count + 5, seen=open_count)


def test_a_system_without_threads_is_reported(uav: ual.Uav, monkeypatch: pytest.MonkeyPatch) -> None:
    start = threading.Thread.start

    def refuse(thread: threading.Thread) -> None:
        if thread.name == "ual telemetry":
            raise RuntimeError("can't start new thread")
        start(thread)

    monkeypatch.setattr(threading.Thread, "start", refuse)
    with pytest.raises(RuntimeError, match="new thread"):
        uav.subscribe(print)


def test_a_callback_runs_never_twice_at_a_time_and_gets_the_samples_in_their_order(
    daemon: FakeDaemon, uav: ual.Uav
) -> None:
    source = daemon.script()
    running, received = threading.Lock(), Received()

    def callback(telemetry: Telemetry) -> None:
        assert running.acquire(blocking=False)
        time.sleep(0.002 * (telemetry.sequence % 5))  # some are slow, some quick
        running.release()
        received(telemetry)

    source.put(sample(1))
    with uav.subscribe(callback):
        for number in range(2, 300):
            source.put(sample(number))
            if number % 7 == 0:
                received.wait_for(number)
        source.put(sample(300))
        received.wait_for(300)
    numbers = [each.sequence for each in received.samples]
    assert numbers == sorted(set(numbers))
    assert sum(each.missed_count + 1 for each in received.samples) == 300


def test_subscriptions_of_one_rate_share_a_stream_and_the_latest_gets_the_newest_sample_at_once(
    daemon: FakeDaemon, uav: ual.Uav
) -> None:
    streams = open_streams(daemon, sample(1, missed_count=3))
    first, second = Received(), Received()
    with uav.subscribe(first), uav.subscribe(second), uav.subscribe(print, rate_hz=5.0):
        second.wait_for(1)
        assert len(streams) == 2
        streams[0].put(sample(2))
        first.wait_for(2)
        second.wait_for(2)
    assert [each.missed_count for each in second.samples] == [0, 0]


def test_one_of_two_subscriptions_ends_without_the_other(daemon: FakeDaemon, uav: ual.Uav) -> None:
    streams = open_streams(daemon, sample(1))
    first, second = Received(), Received()
    with uav.subscribe(first):
        with uav.subscribe(second):
            second.wait_for(1)
        streams[0].put(sample(2))
        first.wait_for(2)
        assert [each.sequence for each in second.samples] == [1]
    no_thread_is_left()
    with uav.subscribe(second):
        assert len(streams) == 2


def test_what_is_refused_to_one_can_be_queried_again(daemon: FakeDaemon, uav: ual.Uav) -> None:
    daemon.refusal = InvalidArgumentError("not now", {})
    with pytest.raises(InvalidArgumentError):
        uav.subscribe(print)
    daemon.refusal = None
    daemon.script().put(sample(1))
    received = Received()
    with uav.subscribe(received):
        received.wait_for(1)


def open_streams(
    daemon: FakeDaemon, first: pb.StreamTelemetryResponse
) -> list[queue.Queue[pb.StreamTelemetryResponse]]:
    """Returns the queue of samples of each stream, from the first sample on; grows with each stream that is opened."""
    streams: list[queue.Queue[pb.StreamTelemetryResponse]] = []

    def telemetry() -> Iterator[pb.StreamTelemetryResponse | None]:
        source: queue.Queue[pb.StreamTelemetryResponse] = queue.Queue()
        source.put(first)
        streams.append(source)
        while True:
            try:
                yield source.get(timeout=0.02)
            except queue.Empty:
                yield None

    daemon.telemetry = telemetry
    return streams


def test_a_failing_callback_is_logged_and_the_subscription_goes_on(
    daemon: FakeDaemon, uav: ual.Uav, caplog: pytest.LogCaptureFixture
) -> None:
    source = daemon.script()
    received, has_failed = Received(), threading.Event()

    def callback(telemetry: Telemetry) -> None:
        if telemetry.sequence == 1:
            has_failed.set()
            raise ZeroDivisionError("the user's mistake")
        received(telemetry)

    source.put(sample(1))
    with caplog.at_level(logging.ERROR), uav.subscribe(callback):
        assert has_failed.wait(LIMIT_S)  # else the next one may take its place
        source.put(sample(2))
        source.put(sample(3))
        received.wait_for(3)
    assert "the user's mistake" in caplog.text


def test_what_the_daemon_refuses_is_raised_at_once(daemon: FakeDaemon, uav: ual.Uav) -> None:
    daemon.refusal = InvalidArgumentError("rate_hz: -1.0 is no rate", {"field": "rate_hz"})
    with pytest.raises(InvalidArgumentError, match="rate_hz"):
        uav.subscribe(print, rate_hz=-1.0)
    no_thread_is_left()


@pytest.mark.parametrize("rate_hz", ["10", None, b"5", [1.0]])
def test_a_rate_that_is_no_number_is_refused_before_it_leaves(uav: ual.Uav, rate_hz: Any) -> None:
    with pytest.raises(InvalidArgumentError, match="is not a number"):
        uav.subscribe(print, rate_hz=rate_hz)
    with pytest.raises(InvalidArgumentError, match="is not a number"):
        ual.aio.Uav("uav_1").subscribe(rate_hz=rate_hz)
    no_thread_is_left()


def test_a_rate_that_no_float_can_be_is_refused_as_too_much(daemon: FakeDaemon, uav: ual.Uav) -> None:
    daemon.refusal = InvalidArgumentError("rate_hz: inf is not a rate", {"field": "rate_hz"})
    with pytest.raises(InvalidArgumentError, match="inf"):
        uav.subscribe(print, rate_hz=10**400)


def test_no_daemon_is_raised_at_once() -> None:
    with ual.Uav("uav_1", address="127.0.0.1:1") as uav, pytest.raises(DaemonUnreachableError):
        uav.subscribe(print)


def test_it_goes_on_after_the_stream_broke_and_says_so_once(
    daemon: FakeDaemon, uav: ual.Uav, caplog: pytest.LogCaptureFixture
) -> None:
    streams = iter([[sample(1)], None, None, [sample(2)]])
    hold = threading.Event()

    def telemetry() -> Iterator[pb.StreamTelemetryResponse]:
        samples = next(streams)
        if samples is None:
            raise RuntimeError("the daemon fails")
        yield from samples
        if samples[0].telemetry.sequence == 2:
            hold.wait(LIMIT_S)

    daemon.telemetry = telemetry
    received = Received()
    with caplog.at_level(logging.INFO, "ual"), uav.subscribe(received):
        received.wait_for(2)
        hold.set()
    messages = [record.getMessage() for record in caplog.records if record.name.startswith("ual")]
    assert [message.partition(":")[0] for message in messages] == ["telemetry is interrupted", "telemetry is back"]


def test_who_joins_while_the_stream_is_broken_gets_no_old_sample_but_why(daemon: FakeDaemon, uav: ual.Uav) -> None:
    is_broken, is_back = threading.Event(), threading.Event()
    sequences = iter([1, 2])

    def telemetry() -> Iterator[pb.StreamTelemetryResponse | None]:
        if is_broken.is_set() and not is_back.is_set():
            raise RuntimeError("the daemon fails")
        yield sample(next(sequences))
        while not is_broken.wait(0.02) or is_back.is_set():
            yield None  # lets the server see whether anybody still listens
        raise RuntimeError("the daemon fails")

    daemon.telemetry = telemetry
    first, second = Received(), Received()
    with uav.subscribe(first):
        first.wait_for(1)
        is_broken.set()
        with suppress(UalError):
            while True:  # until it is noticed
                uav.subscribe(lambda _: None).close()
        with pytest.raises(UalError):
            uav.subscribe(second)
        assert second.samples == []
        is_back.set()
        first.wait_for(2)
        with uav.subscribe(second):
            second.wait_for(2)


def test_it_can_be_closed_from_its_own_callback(daemon: FakeDaemon, uav: ual.Uav) -> None:
    source = daemon.script()
    closed = threading.Event()
    opened: queue.Queue[ual._client.Subscription] = queue.Queue()  # type: ignore[name-defined]

    def callback(_: Telemetry) -> None:
        opened.get().close()
        closed.set()

    source.put(sample(1))
    opened.put(uav.subscribe(callback))
    assert closed.wait(LIMIT_S)


def test_closing_the_client_closes_its_subscriptions(daemon: FakeDaemon) -> None:
    source = daemon.script()
    source.put(sample(1))
    uav = ual.Uav("uav_1", address=daemon.address)
    uav.subscribe(lambda _: None)
    uav.close()
    no_thread_is_left()
    with pytest.raises(UalError, match="this client is closed"):
        uav.state()
    with pytest.raises(UalError, match="this client is closed"):
        uav.subscribe(print)


def test_a_client_that_is_being_closed_opens_no_subscription(daemon: FakeDaemon) -> None:
    open_streams(daemon, sample(1))
    is_called, may_return = threading.Event(), threading.Event()

    def slow(_: Telemetry) -> None:
        is_called.set()
        assert may_return.wait(LIMIT_S)

    uav = ual.Uav("uav_1", address=daemon.address)
    uav.subscribe(slow)
    assert is_called.wait(LIMIT_S)
    closing = threading.Thread(target=uav.close)
    closing.start()
    refusals: list[str] = []

    def subscribe() -> None:
        try:
            uav.subscribe(print, rate_hz=10.0).close()
        except UalError as error:
            refusals.append(error.message)

    until(lambda: refusals, between=subscribe)  # until it has begun
    may_return.set()
    closing.join(LIMIT_S)
    assert refusals == ["this client is closed"]
    no_thread_is_left()


def test_who_waits_for_a_first_sample_learns_that_the_client_was_closed(daemon: FakeDaemon) -> None:
    daemon.script()
    telemetry, has_begun = daemon.telemetry, threading.Event()
    refusals: list[str] = []
    uav = ual.Uav("uav_1", address=daemon.address)

    def begin() -> Iterator[pb.StreamTelemetryResponse | None]:
        has_begun.set()
        return telemetry()

    def subscribe() -> None:
        try:
            uav.subscribe(print)
        except UalError as error:
            refusals.append(error.message)

    daemon.telemetry = begin
    opening = threading.Thread(target=subscribe)
    opening.start()
    assert has_begun.wait(LIMIT_S)
    uav.close()
    opening.join(LIMIT_S)
    assert refusals == ["this client is closed"]
    no_thread_is_left()
