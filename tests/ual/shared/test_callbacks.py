from __future__ import annotations

import random
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from tests.waiting import LIMIT_S
from ual.errors import InvalidArgumentError
from ual.shared import callbacks
from ual.shared.callbacks import SLOW_CALL_S, Callbacks, Listener
from ual.types import State, Telemetry


def sample(sequence: int, missed_count: int = 0) -> Telemetry:
    return Telemetry(State.FLYING_AUTO, sequence=sequence, missed_count=missed_count)


def workers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "ual telemetry callback"]


@pytest.fixture(autouse=True)
def no_worker_is_left() -> Iterator[None]:
    yield
    for thread in workers():  # each ends once its last listener is closed
        thread.join(LIMIT_S)
    assert not workers()


class Subscriber:
    """Notes what it is called back with; while `may_return` is not set a call does not return."""

    def __init__(self, group: Callbacks) -> None:
        self.came: list[tuple[int, int]] = []
        self.threads: set[int] = set()
        self.may_return = threading.Event()
        self.may_return.set()
        self.changed = threading.Condition()
        self.running_count = 0
        self.listener: Listener = group.open(self)

    def __call__(self, telemetry: Telemetry) -> None:
        self.running_count += 1
        assert self.running_count == 1, "called from two threads"
        with self.changed:
            self.came.append((telemetry.sequence, telemetry.missed_count))
            self.threads.add(threading.get_ident())
            self.changed.notify_all()
        assert self.may_return.wait(LIMIT_S)
        self.running_count -= 1

    def wait_for(self, sequence: int) -> None:
        with self.changed:
            assert self.changed.wait_for(lambda: any(number == sequence for number, _ in self.came), LIMIT_S), self.came

    def close(self) -> None:
        self.may_return.set()
        self.listener.close()


def test_quick_callbacks_share_a_thread_and_get_each_sample() -> None:
    group = Callbacks()
    subscribers = [Subscriber(group) for _ in range(20)]
    for sequence in range(5):
        for each in subscribers:
            each.listener.put(sample(sequence))
        for each in subscribers:
            each.wait_for(sequence)
    assert all(each.came == [(sequence, 0) for sequence in range(5)] for each in subscribers)
    for each in subscribers:
        each.close()


def test_one_that_does_not_return_holds_up_no_other_when_the_next_sample_comes() -> None:
    group = Callbacks()
    stuck = Subscriber(group)
    others = [Subscriber(group) for _ in range(5)]
    stuck.may_return.clear()
    for each in (stuck, *others):
        each.listener.put(sample(1))
    stuck.wait_for(1)
    time.sleep(2.0 * SLOW_CALL_S)  # only then does a worker count as delayed
    for number in (2, 3):
        for each in (stuck, *others):
            each.listener.put(sample(number))
        for each in others:
            each.wait_for(number)
    for each in others:
        # The first of them waited behind it: it came, or was counted.
        assert sum(1 + missed for _, missed in each.came) == 3
        assert not each.threads & stuck.threads
    assert stuck.came == [(1, 0)]
    stuck.may_return.set()
    stuck.wait_for(3)
    assert stuck.came == [(1, 0), (3, 1)]
    for each in (stuck, *others):
        each.close()


def test_a_thread_that_offers_a_sample_calls_back_itself_while_that_is_quick() -> None:
    group = Callbacks()
    subscriber = Subscriber(group)
    for number in range(1, 4):
        subscriber.listener.offer(sample(number))
        subscriber.listener.call()
    assert subscriber.came == [(number, 0) for number in range(1, 4)]
    assert subscriber.threads == {threading.get_ident()}
    subscriber.listener.call()  # there is nothing new
    assert len(subscriber.came) == 3
    subscriber.close()


def test_a_callback_that_took_long_has_a_worker_until_it_was_quick_for_a_while() -> None:
    group = Callbacks()
    threads: list[int] = []
    called = threading.Semaphore(0)

    def callback(telemetry: Telemetry) -> None:
        threads.append(threading.get_ident())
        if telemetry.sequence == 0:
            time.sleep(2.0 * SLOW_CALL_S)  # only then does a worker count as delayed
        called.release()

    listener = group.open(callback)
    # A quick call that the machine holds up for as long as that counts as slow, too: so it may take more than ten.
    for number in range(200):
        listener.offer(sample(number))
        listener.call()
        assert called.acquire(timeout=LIMIT_S)
        if len(threads) > 10 and threads[-1] == threads[0]:
            break
    assert threads[0] == threading.get_ident() == threads[-1]
    assert threading.get_ident() not in threads[1:11]
    listener.close()


def test_what_is_available_to_one_that_waits_behind_another_in_a_worker_frees_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    group = Callbacks()
    stuck, waiting = Subscriber(group), Subscriber(group)
    stuck.may_return.clear()
    stuck.listener.put(sample(1))
    stuck.wait_for(1)
    with monkeypatch.context() as patched:  # on a busy computer it could count as delayed before the put
        patched.setattr(callbacks, "SLOW_CALL_S", LIMIT_S)
        waiting.listener.put(sample(1))
    time.sleep(2.0 * SLOW_CALL_S)  # only then does the worker count as delayed
    waiting.listener.offer(sample(2))
    waiting.listener.call()
    waiting.wait_for(2)
    assert waiting.came == [(2, 1)]
    stuck.close()
    waiting.close()


def test_what_was_missed_before_adds_up() -> None:
    group = Callbacks()
    slow = Subscriber(group)
    slow.may_return.clear()
    slow.listener.put(sample(1))
    slow.wait_for(1)
    slow.listener.put(sample(4, missed_count=2))
    slow.listener.put(sample(6, missed_count=1))
    slow.listener.put(sample(7))
    slow.may_return.set()
    slow.wait_for(7)
    assert slow.came == [(1, 0), (7, 5)]
    slow.close()


def test_close_waits_for_the_call_that_runs_and_no_other_comes() -> None:
    group = Callbacks()
    slow = Subscriber(group)
    slow.may_return.clear()
    slow.listener.put(sample(1))
    slow.wait_for(1)
    slow.listener.put(sample(2))
    closing = threading.Thread(target=slow.listener.close)
    closing.start()
    closing.join(0.05)
    assert closing.is_alive()
    slow.may_return.set()
    closing.join(LIMIT_S)
    assert not closing.is_alive()
    assert slow.came == [(1, 0)]


def test_a_callback_may_close_itself_and_another() -> None:
    group = Callbacks()
    other = Subscriber(group)
    closed = threading.Event()

    def callback(_: Telemetry) -> None:
        other.close()
        listener.close()
        closed.set()

    listener = group.open(callback)
    listener.put(sample(1))
    assert closed.wait(LIMIT_S)


def test_two_callbacks_that_close_each_other_at_the_same_time_both_return() -> None:
    group = Callbacks()
    both_run = threading.Barrier(2)
    closed = threading.Semaphore(0)

    def callback(_: Telemetry) -> None:
        both_run.wait(LIMIT_S)
        for each in listeners:
            each.close()
        closed.release()

    listeners = [group.open(callback), group.open(callback)]
    callers = []
    for each in listeners:  # each on a thread of its own, as the client's readers call back
        each.offer(sample(1))
        callers.append(threading.Thread(target=each.call, daemon=True))
        callers[-1].start()
    for _ in listeners:
        assert closed.acquire(timeout=LIMIT_S)
    for caller in callers:
        caller.join(LIMIT_S)


def test_slow_ones_and_quick_ones_that_come_and_go_never_run_twice_at_a_time_and_all_get_the_last() -> None:
    group = Callbacks()
    generator = random.Random(7)
    subscribers = [Subscriber(group) for _ in range(8)]
    for sequence in range(200):
        for each in subscribers:
            if generator.random() < 0.05:
                (each.may_return.clear if each.may_return.is_set() else each.may_return.set)()
        for each in subscribers:
            each.listener.put(sample(sequence))
        if generator.random() < 0.1:
            time.sleep(SLOW_CALL_S)  # only then does a worker count as delayed
        if generator.random() < 0.1:
            subscribers.pop(generator.randrange(len(subscribers))).close()
            subscribers.append(Subscriber(group))
    for each in subscribers:
        each.may_return.set()
    for each in subscribers:
        each.listener.put(sample(1000))
        each.wait_for(1000)
        numbers = [number for number, _ in each.came]
        assert numbers == sorted(set(numbers))
    for each in subscribers:
        each.close()


def test_a_callback_that_ends_the_thread_ends_nobody_elses(caplog: pytest.LogCaptureFixture) -> None:
    group = Callbacks()

    def exits(_: Telemetry) -> None:
        raise SystemExit(3)

    leaving, staying = group.open(exits), Subscriber(group)
    for number in (1, 2):
        leaving.put(sample(number))
        staying.listener.put(sample(number))
        staying.wait_for(number)
    assert "the subscription goes on" in caplog.text
    leaving.close()
    staying.close()


def test_closing_does_not_wait_for_a_callback_that_closed_itself_and_goes_on() -> None:
    group = Callbacks()
    has_closed_itself, may_return = threading.Event(), threading.Event()

    def callback(_: Telemetry) -> None:
        first.close()
        has_closed_itself.set()
        assert may_return.wait(LIMIT_S)

    first, second = group.open(callback), group.open(lambda _: None)
    first.put(sample(1))
    assert has_closed_itself.wait(LIMIT_S)
    second.close()
    may_return.set()


def test_a_failure_that_comes_again_and_again_is_logged_once_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    group = Callbacks()
    called = threading.Semaphore(0)

    def fail(telemetry: Telemetry) -> None:
        called.release()
        raise ValueError("another one" if telemetry.sequence == 50 else "the same")

    listener = group.open(fail)
    for number in range(1, 51):
        listener.put(sample(number))
        assert called.acquire(timeout=LIMIT_S)
    listener.close()
    texts = [record.getMessage() for record in caplog.records]
    assert sum("the subscription goes on" in text for text in texts) == 2  # one for each error
    assert texts[-1] == "the callback of a telemetry subscription failed 50 times"


async def _coroutine(telemetry: Telemetry) -> None: ...


@pytest.mark.parametrize(
    ("callback", "why"),
    [(None, "callback: None cannot be called"), (_coroutine, "callback: a coroutine function is never")],
)
def test_what_cannot_be_called_with_samples_is_refused_at_once(callback: Any, why: str) -> None:
    with pytest.raises(InvalidArgumentError, match=why) as refused:
        Callbacks().open(callback)
    assert refused.value.metadata == {"field": "callback"}
