"""The backend's one thread: receives, does what is due, and publishes snapshots."""

from __future__ import annotations

import dataclasses
import logging
import math
import threading
from collections import deque
from collections.abc import Callable

from ual.geometry import Pose
from ual_daemon import logs
from ual_daemon.backends.base import UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.engine.scheduling_gap import SchedulingGap
from ual_daemon.backends.mavlink.links import Address, Chunk, Connection
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.session import Session
from ual_daemon.backends.mavlink.session.supervision import LinkStatistics
from ual_daemon.backends.values import Freshness, Sample, Snapshot, VehicleInfo

_log = logging.getLogger(__name__)

TICK_S = 0.05
"""The longest interval between two ticks, and between two updates."""
FAST_TICK_S = 0.01
"""The shortest interval between two ticks: after a pose, and while an answer of the autopilot is awaited."""


class ReceiveLoop:
    """Runs on one thread until it is closed; `post`, `snapshot` and `info` are for any thread.

    `on_freshness` is called before the first update that is about an autopilot, and when its limits have changed;
    `on_update` as `Backend.open` describes.
    """

    def __init__(
        self,
        connection: Connection,
        discovery: Discovery,
        clock: MonotonicClock,
        on_freshness: Callable[[Freshness], None],
        on_update: UpdateCallback,
    ) -> None:
        self.snapshot = Snapshot(time_s=clock.now_s())
        self.info = VehicleInfo()
        self.on_received: Callable[[bytes, Address | None, float, float], None] | None = None
        """Called with what is received, from where, when, and when in UTC, before it is decoded; never blocks. Empty:
        what had arrived, and what was known before, was discarded after a pause of this thread."""
        self._connection = connection
        self._discovery = discovery
        self._clock = clock
        self._on_freshness = on_freshness
        self._on_update = on_update
        self._posted: deque[Callable[[float], None]] = deque()
        self._closing = threading.Event()
        self._session: Session | None = None
        """The session that `info` is about."""
        self._freshness: Freshness | None = None
        self._scheduling_gap = SchedulingGap()
        self._pose: Sample[Pose] | None
        self._reset_schedule()

    def post(self, request: Callable[[float], None]) -> None:
        """Has a request called on the loop's thread, with the time, as soon as possible."""
        self._posted.append(request)
        self._connection.wake()

    def retry(self, request: Callable[[float], None]) -> None:
        """Has a request called at the next tick. To be called by a request that cannot do its work yet."""
        self._posted.append(request)

    def close(self) -> None:
        """Ends the loop; returns at once."""
        self._closing.set()
        self._connection.wake()

    def run(self) -> None:
        """Receives until the loop is closed. A defect does not end it: the link is opened anew."""
        try:
            while not self._closing.is_set():
                self._receive_until_defect()
            self._discovery.release()
        finally:
            self._connection.close()
            _log_statistics(self._discovery.link_statistics(self._clock.now_s()))

    def _receive_until_defect(self) -> None:
        try:
            self._receive_until_closed()
        except Exception:  # noqa: BLE001 - the callers must see a lost link that comes back: this thread goes on
            _log.exception("receiving from the autopilot failed; this is a defect of UAL, please report it")
            now_s = self._clock.now_s()
            self._discovery.discard_state()
            self._connection.restart(now_s)
            self._publish(now_s)
            self._closing.wait(TICK_S)

    def _receive_until_closed(self) -> None:
        self._reset_schedule()
        while not self._closing.is_set():
            self._receive()
            now_s = self._clock.now_s()
            has_moved = self._publish_if_due(now_s)
            self._tick_if_due(now_s, has_moved=has_moved)

    def _reset_schedule(self) -> None:
        self._next_full_tick_s = self._ticked_s = self._updated_s = self._scheduling_gap.woke_s = self._clock.now_s()
        self._has_news = False
        self._connections_count = 0
        self._pose = None

    def _receive(self) -> None:
        connection, clock = self._connection, self._clock
        now_s = clock.now_s()
        chunks = connection.receive(self._next_full_tick_s - now_s, now_s)
        woke_s = clock.now_s()
        pause_s = self._scheduling_gap.woke(
            woke_s, math.inf if self._session is None else self._session.freshness.link_s
        )
        if pause_s:
            chunks = self._discard_old(woke_s, pause_s)
        if connection.connections_count != self._connections_count:
            self._connections_count = connection.connections_count
            self._discovery.reconnected()
        for data, address in chunks:
            now_s, utc_s = clock.now_s(), clock.utc_s()
            if self.on_received is not None:
                self.on_received(data, address, now_s, utc_s)
            self._discovery.receiver.receive(data, address, now_s, utc_s)

    def _publish_if_due(self, now_s: float) -> bool:
        """Publishes a new pose at once, and otherwise every `TICK_S`. Returns whether the pose is new."""
        session = self._discovery.session
        if session is not self._session and session is not None:
            self._session = session
            self._freshness = session.freshness
            self._on_freshness(session.freshness)
            self.info = session.info()
        newest = None if session is None else session.telemetry.pose
        has_moved = newest is not self._pose
        if has_moved or now_s - self._updated_s >= TICK_S:
            self._pose, self._updated_s = newest, now_s
            self._publish(now_s)
        return has_moved

    def _tick_if_due(self, now_s: float, *, has_moved: bool) -> None:
        session = self._discovery.session
        self._has_news = self._has_news or has_moved or (session is not None and session.is_urgent)
        is_due = now_s - self._ticked_s >= (FAST_TICK_S if self._has_news else TICK_S)
        # After a new pose the rest waits for the next round: the thread that was just notified needs the GIL now.
        if (has_moved or not is_due) and now_s < self._next_full_tick_s and not self._posted:
            return
        self._ticked_s, self._has_news = now_s, False
        self._tick(now_s)
        if now_s >= self._next_full_tick_s:
            self._next_full_tick_s = now_s + TICK_S
            self._refresh_info(session)

    def _discard_old(self, now_s: float, pause_s: float) -> list[Chunk]:
        _log.warning("this thread was not scheduled for %.1f s: requesting the autopilot's state anew", pause_s)
        self._connection.discard(now_s)
        self._discovery.discard_state()
        if self.on_received is not None:
            self.on_received(b"", None, now_s, self._clock.utc_s())
        return []

    def _tick(self, now_s: float) -> None:
        heard_s = self._discovery.supervision.heard_s
        if heard_s is not None:
            self._connection.on_heard(heard_s)
        self._connection.tick(now_s)
        for _ in range(len(self._posted)):  # those that are retried wait for the next tick
            self._posted.popleft()(now_s)
        self._discovery.tick(now_s)

    def _refresh_info(self, session: Session | None) -> None:
        info = self.info if session is None else session.info()
        if session is not None and session.freshness is not self._freshness:
            self._freshness = session.freshness
            self._on_freshness(session.freshness)
        if info != self.info:  # the same object while nothing is new, so that its users need not compare it
            self.info = info

    def _publish(self, now_s: float) -> None:
        session = self._discovery.session
        # What came after the last batch was received is not in it, however long the batch has taken.
        updated_s, scheduling_gap = self._scheduling_gap.woke_s, self._scheduling_gap.why(now_s)
        if session is None:
            snapshot = Snapshot(now_s, updated_s=updated_s, scheduling_gap=scheduling_gap)
        else:
            snapshot = session.snapshot(now_s, updated_s, scheduling_gap)
        trouble = self._connection.trouble or self._discovery.why_silent(now_s)
        if trouble:
            snapshot = snapshot._replace(link_trouble=trouble)
        self.snapshot = snapshot
        try:
            self._on_update(snapshot)
        except Exception:  # noqa: BLE001 - a defect of the layers above must not end the session with the autopilot
            _log.exception("an update failed")


def _log_statistics(statistics: LinkStatistics) -> None:
    """Logs the quality of the link at the end."""
    numbers = {
        name: round(value, 3) if isinstance(value, float) else value
        for name, value in dataclasses.asdict(statistics).items()
    }
    logs.event(_log, logging.INFO, "link_statistics", **{**numbers, "state": statistics.state.value})
