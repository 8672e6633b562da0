"""The thread of a backend: looks for data, does what is due, publishes snapshots. Nothing but `close` ends it."""

from __future__ import annotations

import logging
import math
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Protocol, TypeVar

from ual.errors import UalError
from ual.shared.renamed import renamed
from ual_daemon.backends import futures
from ual_daemon.backends.base import Clock, UpdateCallback
from ual_daemon.backends.engine.contained import ErrorBarrier, defect
from ual_daemon.backends.engine.limits import BLIND_SILENCE_S, CATCH_UP_S
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.scheduling_gap import SchedulingGap
from ual_daemon.backends.values import LinkReport, Snapshot

_log = logging.getLogger(__name__)

T = TypeVar("T")

TICK_S = 0.05
"""The longest interval between two ticks, and between two updates."""
FAST_TICK_S = 0.01
"""The shortest interval between two ticks: after a pose, and while an answer of the autopilot is awaited."""

Posted = Callable[[float], None]
"""Callback on the loop's thread, with the time. A defect of it is logged, and ends nothing."""


class Driven(Protocol):
    """Session of a backend that the loop's thread drives."""

    @property
    def is_urgent(self) -> bool:
        """Whether `tick` should be called often, as an answer is awaited."""
        ...

    def discard(self, now_s: float, pause_s: float) -> None:
        """Discards all that may have changed in a pause of this computer, and what waits unread, where it can."""
        ...

    def tick(self, now_s: float) -> None:
        """Does what is due: the link's watch, commands, requests."""
        ...

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        """Returns the newest data, with two fields of the snapshot that the loop knows."""
        ...


def _ignore(_: Snapshot) -> None:
    """No layer above has opened the backend yet."""


def _nothing() -> None:
    """Nothing has to be woken."""


class Loop:
    """Loop of one vehicle on a thread. Any thread may call `post`, `run_on_loop`, `newest` and `looked_s`; all else
    belongs to the loop's thread.

    The thread waits for data by itself. In each round it calls `woke`, has the data taken, and calls `step`. A thread
    with many vehicles does so for each of them.

    `wake` ends the thread's wait early. `watched_s` is the clock by which pauses of this computer are assessed: that of
    the backend, unless its time may leap (a simulation). `settle` does what waited until a pose was published, where
    nothing else is due so soon after a pose; without it `Driven.tick` does.
    """

    def __init__(
        self,
        driven: Driven,
        clock: Clock,
        watch: LinkWatch,
        on_update: UpdateCallback = _ignore,
        *,
        wake: Callable[[], None] = _nothing,
        watched_s: Callable[[], float] | None = None,
        settle: Callable[[float], object] | None = None,
    ) -> None:
        self.newest = Snapshot(clock.now_s())
        """The snapshot that was published last."""
        self._driven = driven
        self._clock = clock
        self.on_update = on_update
        """Gets each snapshot. May be set until the thread begins."""
        self._watch = watch
        self._wake = wake
        self._watched_s = watched_s
        self._settle = driven.tick if settle is None else settle
        self._posted: deque[Posted] = deque()
        self._open = futures.OpenFutures()
        self._gap = SchedulingGap()
        self._failures = OnceLog("an update failed")
        self._contained = ErrorBarrier("a request")
        self.restart(clock.now_s())

    # --- From any thread ----------------------------------------------------------------------------------------------

    def post(self, request: Posted) -> None:
        """Has a request called on the loop's thread, with the time, as soon as possible."""
        self._posted.append(request)
        self._wake()

    def run_on_loop(self, what: str, begin: Callable[[Future[T], float], object]) -> Future[T]:
        """Returns a future that `begin` has something end. It is posted; an error that it raises ends the future.

        Where the loop has ended, so has the future. `what` is human-readable: "take a photo".
        """
        return self._open.give(what, lambda future: self.post(lambda now_s: _begin(what, begin, future, now_s)))

    give = renamed(run_on_loop, "Loop.give")

    def end(self) -> None:
        """Ends all futures that are open. To be called once the thread has ended."""
        self._open.close()

    # --- On the thread ------------------------------------------------------------------------------------------------

    def restart(self, now_s: float) -> None:
        """Begins again, as if it had looked just now: at the start, and after a defect."""
        self.looked_s = now_s
        """Up to when all that came has been read (`Snapshot.updated_s`), on the backend's clock."""
        self._gap.woke_s = now_s if self._watched_s is None else self._watched_s()
        self._late_s = -math.inf
        self._next_tick_s = self._ticked_s = self._published_s = now_s
        self._has_moved = False

    def retry(self, request: Posted) -> None:
        """Has a request called at the next tick. To be called by a request that cannot do its work yet."""
        self._posted.append(request)

    def link(self) -> LinkReport:
        """Returns what the watch of its link has counted. From any thread."""
        return self._watch.report()

    def timeout_s(self, now_s: float) -> float:
        """Returns for how long the thread may wait for data: until something is due, also to publish what time does."""
        tick_s, publish_s = self._next_tick_s - now_s, self._published_s + TICK_S - now_s
        due_s = tick_s if tick_s < publish_s else publish_s  # noqa: FURB136  each turn asks, and `min` costs more
        return due_s if due_s > 0.0 else 0.0  # noqa: FURB136

    def woke(self, now_s: float) -> float:
        """Notes that the thread looks for data now, before it takes any. Returns how long it had paused, in seconds.

        After a pause everything is discarded; the caller drops what it has just received, too. 0: there was none. After
        a shorter time of not looking nothing is believed until all that waited was read.
        """
        gap, is_own_clock = self._gap, self._watched_s is None
        watched_s = now_s if self._watched_s is None else self._watched_s()
        blind_s = watched_s - gap.woke_s
        if 0.0 <= blind_s <= BLIND_SILENCE_S and not (is_own_clock and blind_s > self._watch.lost_s):
            gap.woke_s = watched_s  # the usual case: as below, where it has not paused
            if now_s >= self._late_s:
                self.looked_s = now_s
            return 0.0
        pause_s = gap.woke(watched_s, self._watch.lost_s if is_own_clock else math.inf)
        if blind_s > BLIND_SILENCE_S:
            self._late_s = now_s + CATCH_UP_S
            self._watch.on_blind(self._late_s)
        if pause_s:
            _log.warning("this thread was not scheduled for %.1f s: what was known is discarded", pause_s)
            self._driven.discard(now_s, pause_s)
        if now_s >= self._late_s:
            self.looked_s = now_s
        return pause_s

    def step(self, now_s: float, *, has_news: bool = False) -> None:
        """Publishes what is new (a pose) at once, and otherwise every `TICK_S`; then does what is due."""
        if has_news or now_s >= self._published_s + TICK_S:
            self.publish(now_s)
        self._has_moved = self._has_moved or has_news
        since_s = now_s - self._ticked_s
        is_due = since_s >= FAST_TICK_S and (since_s >= TICK_S or self._has_moved or self._driven.is_urgent)
        # After a new pose the rest waits for the next round: the thread that was just notified needs the GIL now.
        if (has_news or not is_due) and now_s < self._next_tick_s and not self._posted:
            return
        tick_s = self._clock.now_s()
        if tick_s - now_s <= BLIND_SILENCE_S:  # else this thread was kept: what came meanwhile is read first
            self._tick(tick_s)

    def publish(self, now_s: float) -> None:
        """Publishes the newest data. An error of the layers above does not end the exchange with the autopilot."""
        self._published_s = now_s
        gap_s = now_s if self._watched_s is None else self._gap.woke_s
        snapshot = self.newest = self._driven.snapshot(now_s, self.looked_s, self._gap.why(gap_s))
        try:
            self.on_update(snapshot)
        except Exception as error:  # noqa: BLE001 - a defect of the layers above
            self._failures.log(error)

    def _tick(self, now_s: float) -> None:
        self._ticked_s, self._has_moved = now_s, False
        is_next = now_s >= self._next_tick_s
        is_whole = is_next or bool(self._posted) or self._driven.is_urgent
        if is_next:
            self._next_tick_s = now_s + TICK_S
        for _ in range(len(self._posted)):  # those that are retried wait for the next tick
            self._contained.call(self._posted.popleft(), now_s)
        (self._driven.tick if is_whole else self._settle)(now_s)


class LoopThread:
    """Runs a loop on a thread of its own until it is closed. A defect does not end it: the link is opened again.

    `receive` waits for data for so long at most, in seconds, and has the loop woken and stepped. `on_defect` opens the
    link again and discards what was known. `on_end` is called at the end, on the thread.
    """

    def __init__(
        self,
        loop: Loop,
        clock: Clock,
        name: str,
        receive: Callable[[float], None],
        on_defect: Callable[[Exception, float], None],
        on_end: Callable[[], None] = _nothing,
    ) -> None:
        self._loop = loop
        self._clock = clock
        self._receive = receive
        self._on_defect = on_defect
        self._on_end = on_end
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self.run, name=name, daemon=True)
        self._failures = OnceLog("the exchange with the autopilot failed; this is a defect of UAL, please report it")

    def open(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self, wake: Callable[[], None] = _nothing) -> None:
        """Ends the thread, and waits for that unless the thread itself calls. `wake` ends its wait for data."""
        self._closing.set()
        wake()
        if threading.current_thread() is self._thread:
            return
        if self._thread.is_alive():
            self._thread.join()
        self._loop.end()

    def run(self) -> None:
        """Runs until it is closed."""
        try:
            while not self._closing.is_set():
                self.turn()
        finally:
            try:
                self._on_end()
            finally:
                self._loop.end()

    def turn(self) -> None:
        """Waits for data once, and does what follows."""
        try:
            self._receive(self._loop.timeout_s(self._clock.now_s()))
        except Exception as error:  # noqa: BLE001 - the callers must see a lost link that comes back
            self._failures.log(error)
            now_s = self._clock.now_s()
            self._on_defect(error, now_s)
            self._publish(now_s)
            self._closing.wait(TICK_S)
            self._loop.restart(self._clock.now_s())

    def _publish(self, now_s: float) -> None:
        try:
            self._loop.publish(now_s)
        except Exception as error:  # noqa: BLE001 - the defect may be in what makes the snapshot
            self._failures.log(error)


def _begin(what: str, begin: Callable[[Future[T], float], object], future: Future[T], now_s: float) -> None:
    if future.done():
        return  # withdrawn
    try:
        begin(future, now_s)
    except Exception as error:  # noqa: BLE001  logged, and raised to the caller: the link goes on
        why = error if isinstance(error, UalError) else defect(what, error)
        if not future.done():
            futures.fail(future, why)


class OnceLog:
    """Logs an error with its traceback, unless it is the same as the last one."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._last = ""

    def log(self, error: Exception) -> None:
        """Logs an error. To be called where it is handled."""
        text = repr(error)
        if text != self._last:
            self._last = text
            _log.error("%s", self._what, exc_info=error)
