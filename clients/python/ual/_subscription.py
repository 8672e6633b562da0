"""Subscriptions of the client: one thread drains a stream, another calls back with the newest sample (`callbacks`).

Two threads, because a stream that is read only as fast as the callbacks return fills gRPC's buffers with old samples:
the subscriber would see the UAV as it was seconds ago. One stream for all subscriptions of a rate, because each costs
the daemon: docs/decisions/0011.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import replace

from typing_extensions import Self

from ual import convert
from ual._calls import QUICK_S
from ual._connection import Connection, TelemetryStream
from ual.callbacks import Callbacks, Listener
from ual.errors import UalError, UalTimeoutError
from ual.types import Telemetry

_log = logging.getLogger(__name__)

RETRY_S = 0.25


class Subscriptions:
    """All subscriptions of one client. May be used from any thread."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._lock = threading.Lock()
        self._feeds: dict[float, _Feed] = {}
        self._callbacks = Callbacks()

    def open(self, callback: Callable[[Telemetry], None], rate_hz: float) -> Subscription:
        """A subscription that has begun. Raises where there is no daemon, or it refuses."""
        subscription = Subscription(self._callbacks.open(callback), lambda closed: self._leave(feed, closed))
        with self._lock:
            known = self._feeds.get(rate_hz)
            feed = known or _Feed(self._connection, rate_hz)
            self._feeds[rate_hz] = feed
            feed.join(subscription)
        try:
            if known is None:
                feed.start()
            feed.wait()
        except BaseException:  # refused, or Ctrl-C
            subscription.close()
            raise
        return subscription

    def close(self) -> None:
        """Closes them all."""
        with self._lock:
            subscriptions = [each for feed in self._feeds.values() for each in feed.subscriptions]
        for subscription in subscriptions:
            subscription.close()

    def _leave(self, feed: _Feed, subscription: Subscription) -> None:
        with self._lock:
            feed.leave(subscription)
            is_last = not feed.subscriptions
            if is_last and self._feeds.get(feed.rate_hz) is feed:
                del self._feeds[feed.rate_hz]
        if is_last:
            feed.close()


class Subscription:
    """Calls back with new samples until it is closed."""

    def __init__(self, listener: Listener, on_close: Callable[[Subscription], None]) -> None:
        self._listener = listener
        self._on_close = on_close

    def put(self, sample: Telemetry) -> None:
        """Takes a new sample, in place of one that still waits."""
        self._listener.put(sample)

    def close(self) -> None:
        """Ends it. From another thread than the callback's: once it has returned, the callback runs no more."""
        self._listener.close()
        self._on_close(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


class _Feed:
    """One stream of telemetry, for all subscriptions of its rate; goes on by itself when the daemon comes back.

    `join` and `leave` are called one at a time.
    """

    def __init__(self, connection: Connection, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self.subscriptions: tuple[Subscription, ...] = ()
        self._connection = connection
        self._lock = threading.Lock()
        self._sample: Telemetry | None = None
        self._closing = threading.Event()
        self._answered = threading.Event()
        self._refusal: UalError | None = None
        self._stream: TelemetryStream | None = None
        self._thread = threading.Thread(target=self._drain, name="ual telemetry", daemon=True)

    def start(self) -> None:
        """Begins to read."""
        self._thread.start()

    def wait(self) -> None:
        """Returns once the first sample has come. Raises what the daemon refuses it by, or by which none come now."""
        if not self._answered.wait(QUICK_S):
            raise UalTimeoutError(f"the daemon sent no telemetry within {QUICK_S:g} s")
        if self._refusal is not None:
            raise self._refusal

    def join(self, subscription: Subscription) -> None:
        """From now on it gets the samples, the newest at once."""
        with self._lock:
            self.subscriptions = (*self.subscriptions, subscription)
            if self._sample is not None:
                subscription.put(replace(self._sample, missed_count=0))

    def leave(self, subscription: Subscription) -> None:
        """It gets no more."""
        with self._lock:
            self.subscriptions = tuple(each for each in self.subscriptions if each is not subscription)

    def close(self) -> None:
        """Ends the stream."""
        self._closing.set()
        if self._stream is not None:
            self._stream.close()
        if self._thread.is_alive():
            self._thread.join()

    def _drain(self) -> None:
        reported = ""
        while not self._closing.is_set():
            try:
                reported = self._drain_once(reported)
            except UalError as error:
                has_begun = self._answered.is_set()
                with self._lock:
                    self._sample, self._refusal = None, error  # what came last is old for who joins now
                self._answered.set()
                if not has_begun:
                    return
                if not self._closing.is_set() and error.reason != reported:
                    reported = error.reason
                    _log.warning("telemetry is interrupted: %s: %s", error.reason, error.message)
            self._closing.wait(RETRY_S)

    def _drain_once(self, reported: str) -> str:
        """Reads one stream to its end."""
        self._stream = stream = self._connection.stream_telemetry(self.rate_hz)
        if self._closing.is_set():  # closed before it could see the stream
            stream.close()
        for response in stream.read():
            self._hand_out(convert.telemetry_from_proto(response.telemetry, response.missed_count))
            self._answered.set()
            if reported:
                reported = ""
                _log.info("telemetry is back")
        return reported

    def _hand_out(self, sample: Telemetry) -> None:
        with self._lock:
            self._sample, self._refusal = sample, None
            subscriptions = self.subscriptions
        for subscription in subscriptions:
            subscription.put(sample)
