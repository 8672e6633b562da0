"""Subscriptions of the client: threads take turns in reading a stream and calling back with what they read.

While one calls back the next reads already: a stream that is read only as fast as the callbacks return would fill
gRPC's buffers with old samples, and the subscriber see the UAV as it was seconds ago. One stream for all subscriptions
of a rate, because each costs the daemon: docs/decisions/0011.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Generator
from dataclasses import replace

from typing_extensions import Self

from ual import _calls, _convert
from ual._callbacks import Callbacks, Listener
from ual._calls import QUICK_S
from ual._connection import Connection, TelemetryStream
from ual.errors import UalError, UalTimeoutError
from ual.types import Telemetry
from ual.v1 import ual_pb2 as pb

_log = logging.getLogger(__name__)

RETRY_S = 0.25
_AVAILABLE_COUNT = 2
"""One thread that reads, and one that reads when the first has something to call back with."""


class Subscriptions:
    """All subscriptions of one client. May be used from any thread."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._lock = threading.Lock()
        self._feeds: dict[float, _Feed] = {}
        self._is_closed = False
        self._callbacks = Callbacks()

    def open(self, callback: Callable[[Telemetry], None], rate_hz: float) -> Subscription:
        """A subscription that has begun. Raises where there is no daemon, or it refuses."""
        with self._lock:
            if self._is_closed:
                raise _calls.closed()
            subscription = Subscription(self._callbacks.open(callback), lambda ended: self._leave(feed, ended))
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
        if self._is_closed:  # meanwhile, and this subscription with it
            raise _calls.closed()
        return subscription

    def close(self) -> None:
        """Closes them all, also those that are being opened, and opens no more."""
        with self._lock:
            self._is_closed = True
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
        self.listener = listener
        self._on_close = on_close

    def close(self) -> None:
        """Ends it. Called from no callback of this client: once it has returned, the callback runs no more."""
        self.listener.close()
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
        self._is_closing = threading.Event()
        self._is_answered = threading.Event()
        self._refusal: UalError | None = None
        self._stream: TelemetryStream | None = None
        self._responses: Generator[pb.StreamTelemetryResponse, None, None] | None = None
        self._reported = ""
        """The reason, as it was told, by which the stream is interrupted."""
        self._turn = threading.Lock()
        """Of the thread that reads."""
        self._reading_id: int | None = None
        self._available_count = 0
        """How many threads read, or wait for their turn; the others call back."""
        self._has_ended = threading.Event()
        """Whether the stream is read no more."""
        self._has_ended.set()

    def start(self) -> None:
        """Begins to read."""
        self._has_ended.clear()
        try:
            self._add_thread()
        except RuntimeError:  # the system has none left
            self._has_ended.set()
            raise
        for _ in range(1, _AVAILABLE_COUNT):
            self._add_thread()

    def wait(self) -> None:
        """Returns once the first sample has come. Raises what the daemon refuses it by, or by which none come now."""
        if not self._is_answered.wait(QUICK_S):
            raise UalTimeoutError(f"the daemon sent no telemetry within {QUICK_S:g} s")
        if self._refusal is not None:
            raise self._refusal

    def join(self, subscription: Subscription) -> None:
        """From now on it gets the samples, the newest at once."""
        with self._lock:
            self.subscriptions = (*self.subscriptions, subscription)
            if self._sample is not None:
                subscription.listener.put(replace(self._sample, missed_count=0))

    def leave(self, subscription: Subscription) -> None:
        """It gets no more."""
        with self._lock:
            self.subscriptions = tuple(each for each in self.subscriptions if each is not subscription)

    def close(self) -> None:
        """Ends the stream."""
        self._is_closing.set()
        self._is_answered.set()  # nothing more comes that could be waited for
        if self._stream is not None:
            self._stream.close()
        if self._reading_id != threading.get_ident():  # else what it logs has led here
            self._has_ended.wait()

    def _add_thread(self) -> None:
        threading.Thread(target=self._take_turns, name="ual telemetry", daemon=True).start()

    def _replace(self) -> None:
        try:
            self._add_thread()
        except RuntimeError as error:
            _log.warning("telemetry is not read while callbacks run: %s", error)

    def _take_turns(self) -> None:
        """Reads, lets the next one read, and calls back meanwhile."""
        while True:
            with self._lock:
                if self._available_count == _AVAILABLE_COUNT:  # others came while this one called back
                    return
                self._available_count += 1
            with self._turn:
                self._reading_id = threading.get_ident()
                subscriptions = None
                try:
                    subscriptions = self._read()
                finally:
                    self._reading_id = None
                    with self._lock:
                        self._available_count -= 1
                        is_last = not self._available_count
                    if subscriptions is None:
                        self._is_closing.set()
                        self._has_ended.set()
                if subscriptions is None:
                    return
                if is_last:
                    self._replace()
            for subscription in subscriptions:
                subscription.listener.call()

    def _read(self) -> tuple[Subscription, ...] | None:
        """Waits for the next sample, however long that takes: who is to be called back. None once it is closed, or
        where it is refused.
        """
        while not self._is_closing.is_set():
            try:
                if (sample := self._next()) is not None:
                    return self._hand_out(sample)
            except UalError as error:
                has_begun = self._is_answered.is_set()
                with self._lock:
                    self._sample, self._refusal = None, error  # what came last is old for who joins now
                self._is_answered.set()
                if not has_begun:
                    break
                if not self._is_closing.is_set() and error.reason != self._reported:
                    self._reported = error.reason
                    _log.warning("telemetry is interrupted: %s: %s", error.reason, error.message)
            self._responses = None
            self._is_closing.wait(RETRY_S)
        if self._responses is not None:
            self._responses.close()  # only then does gRPC give back what it holds
        return None

    def _next(self) -> Telemetry | None:
        """The next sample of the stream, of a new one where there is none; None where it has ended."""
        if self._responses is None:
            self._stream = stream = self._connection.stream_telemetry(self.rate_hz)
            if self._is_closing.is_set():  # closed before it could see the stream
                stream.close()
            self._responses = stream.read()
        response = next(self._responses, None)
        return None if response is None else _convert.telemetry_from_proto(response.telemetry, response.missed_count)

    def _hand_out(self, sample: Telemetry) -> tuple[Subscription, ...]:
        with self._lock:
            self._sample, self._refusal = sample, None
            subscriptions = self.subscriptions
        for subscription in subscriptions:
            subscription.listener.offer(sample)
        if not self._is_answered.is_set():
            self._is_answered.set()
        if self._reported:
            self._reported = ""
            _log.info("telemetry is back")
        return subscriptions
