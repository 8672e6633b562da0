"""The thread of a backend: what it publishes, what it believes after it did not look, and what does not end it."""

from __future__ import annotations

import threading
from concurrent.futures import Future

import pytest

from tests.ual_daemon.backends.engine.scripted import Clock, Scripted
from ual.errors import InvalidArgumentError, LinkLostError
from ual_daemon.backends import futures
from ual_daemon.backends.engine.limits import BLIND_SILENCE_S, CATCH_UP_S, PAUSE_GRACE_S, READER_PAUSE_S
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.loop import FAST_TICK_S, TICK_S, Loop, LoopThread
from ual_daemon.backends.values import Snapshot


class Vehicle:
    """Counts what the loop asks of it."""

    is_urgent = False

    def __init__(self) -> None:
        self.ticks_s: list[float] = []
        self.pauses_s: list[float] = []

    def discard(self, now_s: float, pause_s: float) -> None:
        del now_s
        self.pauses_s.append(pause_s)

    def tick(self, now_s: float) -> None:
        self.ticks_s.append(now_s)

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        return Snapshot(now_s, updated_s=updated_s, scheduling_gap=scheduling_gap)


class Setup:
    def __init__(self) -> None:
        self.clock, self.vehicle = Clock(), Vehicle()
        self.updates: list[Snapshot] = []
        self.watch = LinkWatch("loop", 2.0)
        self.loop = Loop(self.vehicle, self.clock, self.watch, self.updates.append)

    def round(self, after_s: float, *, has_news: bool = False) -> float:
        self.clock.now += after_s
        pause_s = self.loop.woke(self.clock.now)
        self.loop.step(self.clock.now, has_news=has_news)
        return pause_s


@pytest.fixture
def setup() -> Setup:
    return Setup()


def test_a_snapshot_is_there_before_anything_was_received(setup: Setup) -> None:
    assert setup.loop.newest.motion.pose is None


def test_what_is_new_is_published_at_once_and_otherwise_each_twentieth_of_a_second(setup: Setup) -> None:
    for _ in range(10):
        setup.round(0.01, has_news=True)
    assert len(setup.updates) == 10
    for _ in range(50):
        setup.round(0.01)
    assert len(setup.updates) == 10 + 10
    assert setup.loop.newest is setup.updates[-1]
    assert setup.updates[-1].updated_s == setup.clock.now


def test_without_news_the_thread_wakes_when_it_has_to_publish_and_not_a_tick_later(setup: Setup) -> None:
    setup.round(TICK_S)  # ticks
    setup.round(0.6 * TICK_S, has_news=True)
    published_s = setup.clock.now
    while len(setup.updates) < 4:
        setup.round(setup.loop.timeout_s(setup.clock.now))
    assert [each.time_s - published_s for each in setup.updates[2:]] == pytest.approx([TICK_S, 2.0 * TICK_S])


def test_it_ticks_seldom_unless_that_is_urgent_or_something_was_posted(setup: Setup) -> None:
    for _ in range(100):
        setup.round(0.01)
    assert len(setup.vehicle.ticks_s) == pytest.approx(1.0 / TICK_S, abs=1)
    setup.vehicle.is_urgent = True
    setup.vehicle.ticks_s.clear()
    for _ in range(100):
        setup.round(0.01)
    assert len(setup.vehicle.ticks_s) == pytest.approx(1.0 / FAST_TICK_S, abs=2)
    setup.vehicle.is_urgent = False
    setup.round(0.001)
    called_s: list[float] = []
    setup.loop.post(called_s.append)
    setup.round(0.001, has_news=True)
    assert called_s == [setup.clock.now]


def test_after_a_pose_only_what_waited_for_it_is_done_where_a_backend_says_what() -> None:
    setup, settled_s = Setup(), list[float]()
    setup.loop = Loop(setup.vehicle, setup.clock, setup.watch, setup.updates.append, settle=settled_s.append)
    for number in range(200):
        setup.round(0.01, has_news=number % 3 == 0)
    assert len(setup.updates) >= 66
    assert len(settled_s) == pytest.approx(66 * 0.7, abs=10)
    assert len(setup.vehicle.ticks_s) == pytest.approx(2.0 / TICK_S, abs=4)
    setup.vehicle.is_urgent = True
    settled_s.clear()
    setup.round(0.01, has_news=True)
    setup.round(0.01)
    assert setup.vehicle.ticks_s[-1] == setup.clock.now
    assert not settled_s


def test_what_is_retried_waits_for_the_next_tick(setup: Setup) -> None:
    tries: list[float] = []

    def request(now_s: float) -> None:
        tries.append(now_s)
        if len(tries) < 3:
            setup.loop.retry(request)

    setup.loop.post(request)
    setup.round(0.001)
    assert len(tries) == 1
    setup.round(0.001)
    setup.round(0.001)
    setup.round(0.001)
    assert len(tries) == 3


def test_after_a_moment_of_not_looking_nothing_counts_as_read_until_what_waited_was_read(setup: Setup) -> None:
    setup.round(0.05)
    read_s = setup.clock.now
    assert setup.round(BLIND_SILENCE_S + 0.01) == 0.0
    assert setup.loop.looked_s == setup.updates[-1].updated_s == read_s
    assert setup.watch.spoken_s == pytest.approx(setup.clock.now + CATCH_UP_S)
    setup.round(0.06)
    assert setup.loop.looked_s == read_s
    setup.round(0.05)
    assert setup.loop.looked_s == setup.clock.now
    assert setup.vehicle.pauses_s == []


def test_a_pause_discards_and_is_reported_for_a_while(setup: Setup) -> None:
    assert setup.round(READER_PAUSE_S + 0.5) == pytest.approx(READER_PAUSE_S + 0.5)
    assert setup.vehicle.pauses_s == [pytest.approx(READER_PAUSE_S + 0.5)]
    assert setup.updates[-1].scheduling_gap == "this computer did not run UAL for 1.5 s"
    for _ in range(round(PAUSE_GRACE_S / 0.05) + 3):
        setup.round(0.05)
    assert setup.updates[-1].scheduling_gap == ""


def test_where_a_lost_link_is_noticed_sooner_a_pause_is_shorter(setup: Setup) -> None:
    setup.watch.lost_s = 0.5
    assert setup.round(0.6) == pytest.approx(0.6)


def test_time_that_leaps_is_no_pause_where_another_clock_watches() -> None:
    clock, vehicle, watching = Clock(), Vehicle(), Clock()
    loop = Loop(vehicle, clock, LinkWatch("", 1.0), watched_s=watching.now_s)
    clock.now += 100.0
    assert loop.woke(clock.now) == 0.0
    assert loop.looked_s == clock.now
    watching.now += 2.0
    assert loop.woke(clock.now) == 2.0


def test_an_error_of_the_layers_above_ends_nothing_and_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    scripted = Scripted()

    def fail(_: Snapshot) -> None:
        raise RuntimeError("above")

    scripted.loop.on_update = fail
    scripted.wait(1.0)
    order = scripted.ask("hold")
    scripted.wait(0.1)
    assert order.sent_s
    assert [record.message for record in caplog.records if record.exc_info] == ["an update failed"]


def test_a_defect_is_logged_once_and_does_not_end_the_thread(setup: Setup, caplog: pytest.LogCaptureFixture) -> None:
    told: list[tuple[str, float]] = []
    ended = threading.Event()

    def receive(timeout_s: float) -> None:
        assert timeout_s >= 0.0
        if len(told) < 3:
            raise ValueError("a damaged packet")
        thread.close()

    def on_defect(error: Exception, now_s: float) -> None:
        told.append((str(error), now_s))

    thread = LoopThread(setup.loop, setup.clock, "test", receive, on_defect, ended.set)
    thread.open()
    assert ended.wait(60.0)
    thread.close()
    assert told == [("a damaged packet", setup.clock.now)] * 3
    assert len(setup.updates) == 3
    assert len([record for record in caplog.records if record.exc_info]) == 1


def test_a_defect_of_what_was_posted_ends_no_link_and_keeps_nothing_else_back(
    setup: Setup, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(_: float) -> None:
        raise ValueError("posted")

    done: list[float] = []
    setup.loop.post(fail)
    setup.loop.post(done.append)
    setup.round(TICK_S)
    setup.loop.post(fail)
    setup.round(TICK_S)
    assert done == [setup.clock.now - TICK_S]
    assert setup.vehicle.ticks_s == [setup.clock.now - TICK_S, setup.clock.now]
    assert [str(record.exc_info[1]) for record in caplog.records if record.exc_info] == ["posted"]


def test_a_turn_needs_no_thread(setup: Setup) -> None:
    timeouts_s: list[float] = []
    thread = LoopThread(setup.loop, setup.clock, "test", timeouts_s.append, lambda *_: None)
    thread.turn()
    thread.close()
    assert timeouts_s == [0.0]


def test_what_is_posted_in_an_update_that_takes_long_waits_until_what_came_meanwhile_was_read() -> None:
    """Else a command would leave by what was known before: the safety pilot may have taken over in that time."""
    clock, done, updates = Clock(), list[float](), list[Snapshot]()
    watch = LinkWatch("loop", 2.0)

    def take_long(snapshot: Snapshot) -> None:
        updates.append(snapshot)
        if len(updates) == 1:
            clock.now += 2.0 * BLIND_SILENCE_S
            loop.post(done.append)

    loop = Loop(Vehicle(), clock, watch, take_long)
    clock.now += 2.0 * TICK_S
    loop.woke(clock.now)
    loop.step(clock.now)
    assert done == []
    loop.woke(clock.now)
    assert watch.spoken_s == clock.now + CATCH_UP_S
    loop.step(clock.now)
    assert done == [clock.now]


def test_a_snapshot_that_cannot_be_made_does_not_end_the_thread(caplog: pytest.LogCaptureFixture) -> None:
    class Broken(Vehicle):
        def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
            raise RuntimeError("a defect in what makes it")

    def receive(_: float) -> None:
        clock.now += TICK_S
        loop.woke(clock.now)
        loop.step(clock.now)

    clock = Clock()
    loop = Loop(Broken(), clock, LinkWatch("loop", 2.0))
    thread = LoopThread(loop, clock, "loop", receive, lambda _, __: None)
    thread.turn()
    thread.turn()
    assert sum("a defect in what makes it" in str(record.exc_info) for record in caplog.records) == 1


def test_what_is_open_at_the_end_and_what_is_passed_after_it_ends_with_an_error(setup: Setup) -> None:
    begun: list[Future[int]] = []
    waits: Future[int] = setup.loop.run_on_loop("land", lambda future, _: begun.append(future))
    ended: Future[int] = setup.loop.run_on_loop("hold", lambda future, _: futures.finish(future, 7))
    setup.round(0.05)
    unbegun: Future[int] = setup.loop.run_on_loop("arm", lambda future, _: begun.append(future))
    assert (begun, ended.result(0)) == ([waits], 7)
    setup.loop.end()
    setup.loop.end()
    with pytest.raises(LinkLostError, match=r"^cannot land: this UAV was closed meanwhile, and it may still be done"):
        waits.result(0)
    with pytest.raises(LinkLostError, match=r"^cannot arm: this UAV was closed"):
        unbegun.result(0)
    with pytest.raises(LinkLostError, match=r"^cannot take a photo: this UAV is closed"):
        setup.loop.run_on_loop("take a photo", lambda future, _: begun.append(future)).result(0)
    setup.round(0.05)
    assert begun == [waits]


def test_what_is_withdrawn_does_not_begin_and_what_fails_ends(setup: Setup) -> None:
    def fail(_: object, __: float) -> None:
        raise InvalidArgumentError("no such log")

    begun: list[Future[int]] = []
    setup.loop.run_on_loop("land", lambda future, _: begun.append(future)).cancel()
    failed: Future[None] = setup.loop.run_on_loop("read its logs", fail)
    setup.round(0.05)
    assert not begun
    with pytest.raises(InvalidArgumentError, match="no such log"):
        failed.result(0)


def test_a_thread_that_ends_or_never_began_leaves_no_future_open(setup: Setup) -> None:
    for does_begin in (True, False):
        loop = Loop(setup.vehicle, setup.clock, setup.watch)
        thread = LoopThread(loop, setup.clock, "test", lambda _: None, lambda _, __: None)
        if does_begin:
            thread.open()
        open_one: Future[None] = loop.run_on_loop("land", lambda _, __: None)
        thread.close()
        with pytest.raises(LinkLostError, match="this UAV was closed"):
            open_one.result(0)
