"""Work of the backend's thread: it receives, has the engine's loop publish snapshots, and keeps the vehicle's
description.
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable

from ual.geometry import Pose
from ual_daemon import logs
from ual_daemon.backends.base import UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.engine.loop import TICK_S, Loop, LoopThread
from ual_daemon.backends.mavlink.links import Address, LinkConnection
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.session import MavlinkSession
from ual_daemon.backends.mavlink.session.supervision import LinkStatistics
from ual_daemon.backends.values import Freshness, Sample, Snapshot, VehicleInfo

_log = logging.getLogger(__name__)


class ReceiveLoop:
    """Runs on the `thread` until that is closed; `loop` is the engine's. `info` is for any thread.

    `on_freshness` is called before the first update that is about an autopilot, and when its limits have changed;
    `on_update` as `Backend.open` describes. `name` is the thread's.
    """

    def __init__(
        self,
        connection: LinkConnection,
        discovery: Discovery,
        clock: MonotonicClock,
        on_freshness: Callable[[Freshness], None],
        on_update: UpdateCallback,
        name: str = "mavlink",
    ) -> None:
        self.info = VehicleInfo()
        self.on_received: Callable[[bytes, Address | None, float, float], None] | None = None
        """Called with what is received, from where, when, and when in UTC, before it is decoded; never blocks. Empty:
        what had arrived, and what was known before, was discarded after a pause of this thread."""
        self._connection = connection
        self._discovery = discovery
        self._clock = clock
        self._on_freshness = on_freshness
        self._session: MavlinkSession | None = None
        """The session that `info` is about."""
        self._freshness: Freshness | None = None
        self._next_info_s = clock.now_s()
        self._connections_count = 0
        self._pose: Sample[Pose] | None = None
        self.loop = Loop(self, clock, discovery.watch, on_update, wake=connection.wake, settle=self._settle)
        self.thread = LoopThread(self.loop, clock, name, self._receive, self._on_defect, self._end)

    def close(self) -> None:
        """Ends the thread; waits for it, unless it is this one."""
        self.thread.close(self._connection.wake)

    # --- What the engine calls ----------------------------------------------------------------------------------------

    @property
    def is_urgent(self) -> bool:
        """Whether a command is in progress, a heartbeat is wanted at once, or a protocol awaits an answer."""
        session = self._discovery.session
        return session is not None and (session.is_urgent or self._discovery.protocols.is_urgent)

    def discard(self, now_s: float, pause_s: float) -> None:
        """Discards what has arrived, and what may have changed, in a pause of this computer."""
        del pause_s
        self._connection.discard(now_s)
        self._discovery.discard_state()
        if self.on_received is not None:
            self.on_received(b"", None, now_s, self._clock.utc_s())

    def tick(self, now_s: float) -> None:
        """Keeps the link open, and does what is due."""
        heard_s = self._discovery.watch.heard_s
        if heard_s is not None:
            self._connection.on_received(heard_s)
        self._connection.tick(now_s)
        self._discovery.tick(now_s)
        if now_s >= self._next_info_s:
            self._next_info_s = now_s + TICK_S
            self._refresh_info()

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        """Returns the newest data, and what is wrong with the link."""
        session = self._discovery.session
        if session is None:
            snapshot = Snapshot(now_s, updated_s=updated_s, scheduling_gap=scheduling_gap)
        else:
            snapshot = session.snapshot(now_s, updated_s, scheduling_gap)
        trouble = self._connection.trouble or self._discovery.why_silent(now_s)
        return snapshot._replace(link=snapshot.link._replace(trouble=trouble)) if trouble else snapshot

    # --- On the thread ------------------------------------------------------------------------------------------------

    def _receive(self, timeout_s: float) -> None:
        connection, clock, loop = self._connection, self._clock, self.loop
        chunks = connection.receive(timeout_s, clock.now_s())
        if loop.woke(clock.now_s()):
            chunks = []
        if connection.connections_count != self._connections_count:
            self._connections_count = connection.connections_count
            self._discovery.reconnected()
        receive, on_received = self._discovery.receiver.receive, self.on_received
        for data, address in chunks:  # each with a time of its own: a replay keeps their order by it
            now_s, utc_s = clock.now_s(), clock.utc_s()
            if on_received is not None:
                on_received(data, address, now_s, utc_s)
            receive(data, address, now_s, utc_s)
        session = self._discovery.session
        if session is not self._session and session is not None:
            self._session = session
            session.on_mode = self.loop.publish
            self.info = session.info()
            self._use_freshness(session)
        newest = None if session is None else session.telemetry.pose.sample
        has_moved, self._pose = newest is not self._pose, newest
        loop.step(clock.now_s(), has_news=has_moved)

    def _settle(self, now_s: float) -> None:
        """Learns from the newest position."""
        del now_s
        if self._discovery.session is not None:
            self._discovery.session.learn()

    def _refresh_info(self) -> None:
        session = self._discovery.session
        if session is None:
            return
        if session.freshness is not self._freshness:
            self._use_freshness(session)
        self.info = session.info()

    def _use_freshness(self, session: MavlinkSession) -> None:
        self._freshness = session.freshness
        self._on_freshness(session.freshness)

    def _on_defect(self, error: Exception, now_s: float) -> None:
        """Opens the link again: the callers must see a lost link that comes back."""
        del error
        self._discovery.discard_state()
        self._connection.restart(now_s)
        self._connections_count, self._pose = 0, None

    def _end(self) -> None:
        try:
            self._discovery.release()
        finally:
            self._connection.close()
            _log_statistics(self._discovery.link_statistics(self._clock.now_s()))


def _log_statistics(statistics: LinkStatistics) -> None:
    """Logs the quality of the link at the end."""
    numbers = {
        name: round(value, 3) if isinstance(value, float) else value
        for name, value in dataclasses.asdict(statistics).items()
    }
    logs.event(_log, logging.INFO, "link_statistics", **{**numbers, "state": statistics.state.value})
