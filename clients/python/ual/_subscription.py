"""Subscriptions of the client: threads alternate between reading a stream and calling back with what they read.

This is the leader/follower pattern: the leader reads one sample, hands the lead to the next thread, and then calls back
while the next thread reads. So the stream is read even while callbacks run. Otherwise gRPC's buffers would fill with
old samples, and the subscriber would see the UAV as it was seconds ago. All subscriptions with the same rate share one
stream, because each stream costs the daemon: docs/evidence/decisions/0011.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Generator
from dataclasses import replace

from typing_extensions import Self, override

from ual import _calls, _forks, _gevent, interface
from ual._connection import Connection, TelemetryStream
from ual._interruption_log import InterruptionLog
from ual.contract.method import QUICK_S
from ual.errors import UalError, UalTimeoutError
from ual.shared import views
from ual.shared.callbacks import Callbacks, Listener
from ual.types import Telemetry
from ual.v1 import ual_pb2 as pb
from ual.wire import samples

_log = logging.getLogger(__name__)

RETRY_S = 0.25
_READERS_COUNT = 2
"""The leader, which reads, and a follower, which takes the lead when the leader has a sample to call back with."""


class Subscriptions:
    """All subscriptions of one client. May be used from any thread."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._lock = threading.Lock()
        self._feeds: dict[float, _Feed] = {}
        self._is_closed = False
        self._callbacks = Callbacks()
        _forks.renew_in_child(self)

    def begin_anew(self) -> None:
        """Leaves the parent's subscriptions to it in a forked process: the threads that serve them are not here."""
        for feed in self._feeds.values():
            for subscription in feed.subscriptions:
                subscription.leave_to_parent()
        self._lock, self._feeds, self._callbacks = threading.Lock(), {}, Callbacks()

    def open(self, callback: Callable[[Telemetry], None], rate_hz: float) -> Subscription:
        """Returns a subscription once its first sample has come.

        Raises:
            UalError: The client is closed, or the daemon refuses the subscription.
            UalTimeoutError: The daemon sent no telemetry in time.
            DaemonUnreachableError: No daemon answers.
        """
        _gevent.prepare()
        with self._lock:
            if self._is_closed:
                raise _calls.closed()
            subscription = Subscription(self._callbacks.open(callback), lambda ended: self._leave(feed, ended))
            known = self._feeds.get(rate_hz)
            subscription.feed = feed = known or _Feed(self._connection, rate_hz)
            self._feeds[rate_hz] = feed
            feed.join(subscription)
        try:
            if known is None:
                feed.start()
            feed.wait()
        except BaseException:  # also Ctrl-C
            subscription.close()
            raise
        if self._is_closed:  # the client was closed meanwhile, and this subscription with it
            raise _calls.closed()
        return subscription

    def close(self) -> None:
        """Closes all subscriptions, also those that are being opened, and refuses new ones."""
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


class Subscription(interface.Subscription):
    """Calls back with new samples until it is closed."""

    def __init__(self, listener: Listener, on_close: Callable[[Subscription], None]) -> None:
        self.listener = listener
        self.feed: _Feed | None = None
        self._on_close = on_close
        self._is_closed = self._is_parents = False

    def __repr__(self) -> str:
        feed = self.feed
        ns, rate_hz = ("", 0.0) if feed is None else (feed.ns, feed.rate_hz)
        return views.subscription_text(ns, rate_hz, is_closed=self._is_closed)

    def leave_to_parent(self) -> None:
        """Ends it in a forked process, where nothing serves it."""
        self._is_closed = self._is_parents = True

    @override
    def close(self) -> None:
        """Ends it. Waits for the callback to return, unless it is called from a callback of this client; after that the
        callback does not run again.
        """
        if self._is_parents:
            return
        self._is_closed = True
        self.listener.close()
        self._on_close(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


class _Feed:
    """One stream of telemetry for all subscriptions with its rate. Reconnects when the daemon comes back.

    The caller serializes `join` and `leave`.
    """

    def __init__(self, connection: Connection, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self.subscriptions: tuple[Subscription, ...] = ()
        self._connection = connection
        self._lock = threading.Lock()
        self._sample: Telemetry | None = None
        self._is_closing = threading.Event()
        self._is_answered = threading.Event()
        self._is_flowing = False
        """Whether the present stream has given a sample. Belongs to the leader."""
        self._refusal: UalError | None = None
        self._stream: TelemetryStream | None = None
        self._responses: Generator[pb.StreamTelemetryResponse, None, None] | None = None
        self._interruptions = InterruptionLog(_log)
        self._lead = threading.Lock()
        """Held by the leader while it reads."""
        self._leader_id: int | None = None
        self._readers_count = 0
        """Threads that are the leader or wait for the lead. The other threads are calling back."""
        self._has_ended = threading.Event()
        """Set while no thread reads the stream: before the start and after the end."""
        self._has_ended.set()

    @property
    def ns(self) -> str:
        """The namespace of the UAV, as far as it is known."""
        return self._connection.target.shown_ns

    def start(self) -> None:
        """Starts the threads that read."""
        self._has_ended.clear()
        try:
            self._start_reader()
        except RuntimeError:  # the system allows no more threads
            self._has_ended.set()
            raise
        for _ in range(1, _READERS_COUNT):
            self._start_reader()

    def wait(self) -> None:
        """Blocks until the first sample has come.

        Raises:
            UalTimeoutError: No sample came within `QUICK_S`.
            UalError: The daemon refused the stream, or the stream is interrupted now.
        """
        if not self._is_answered.wait(QUICK_S):
            raise UalTimeoutError(f"the daemon sent no telemetry within {QUICK_S:g} s")
        if self._refusal is not None:
            raise self._refusal

    def join(self, subscription: Subscription) -> None:
        """Adds a subscription. It gets the newest sample at once, and every new one from now on."""
        with self._lock:
            self.subscriptions = (*self.subscriptions, subscription)
            if self._sample is not None:
                subscription.listener.put(replace(self._sample, missed_count=0))

    def leave(self, subscription: Subscription) -> None:
        """Removes a subscription."""
        with self._lock:
            self.subscriptions = tuple(each for each in self.subscriptions if each is not subscription)

    def close(self) -> None:
        """Ends the stream, and waits until no thread reads it any more."""
        self._is_closing.set()
        self._is_answered.set()  # releases `wait`: no sample will come
        if self._stream is not None:
            self._stream.close()
        if self._leader_id != threading.get_ident():  # else a log handler, run by the leader, has called this
            self._has_ended.wait()

    def _start_reader(self) -> None:
        threading.Thread(target=self._read_and_call, name="ual telemetry", daemon=True).start()

    def _start_replacement(self) -> None:
        try:
            self._start_reader()
        except RuntimeError as error:
            _log.warning("telemetry is not read while callbacks run: %s", error)

    def _read_and_call(self) -> None:
        """Waits for the lead, reads a sample, hands over the lead, and calls back; repeatedly."""
        while True:
            with self._lock:
                if self._readers_count == _READERS_COUNT:  # replaced while this thread called back
                    return
                self._readers_count += 1
            with self._lead:
                self._leader_id = threading.get_ident()
                subscriptions = None
                try:
                    subscriptions = self._read()
                finally:
                    self._leader_id = None
                    with self._lock:
                        self._readers_count -= 1
                        has_no_follower = not self._readers_count
                    if subscriptions is None:
                        self._is_closing.set()
                        self._has_ended.set()
                if subscriptions is None:
                    return
                if has_no_follower:
                    self._start_replacement()
            for subscription in subscriptions:
                subscription.listener.call()

    def _read(self) -> tuple[Subscription, ...] | None:
        """Blocks until the next sample comes, and returns the subscriptions to call back. Returns None once the feed is
        closed, or if the daemon refuses the stream at its beginning.
        """
        while not self._is_closing.is_set():
            try:
                if (sample := self._next()) is not None:
                    return self._hand_out(sample)
            except UalError as error:
                has_begun = self._is_answered.is_set()
                with self._lock:
                    self._sample, self._refusal = (
                        None,
                        error,
                    )  # a subscription that joins now must not get an old sample
                self._is_answered.set()
                if not has_begun:
                    break
                if not self._is_closing.is_set():
                    self._interruptions.interrupted(error)
            self._responses, self._is_flowing = None, False
            self._is_closing.wait(RETRY_S)
        if self._responses is not None:
            self._responses.close()  # else gRPC keeps what the call holds
        return None

    def _next(self) -> Telemetry | None:
        """Returns the next sample, from a new stream if there is none. Returns None when the stream has ended."""
        if self._responses is None:
            self._stream = stream = self._connection.stream_telemetry(self.rate_hz)
            if self._is_closing.is_set():  # `close` may have run before the stream was there
                stream.close()
            self._responses = stream.read()
        response = next(self._responses, None)
        return None if response is None else samples.telemetry_from_proto(response.telemetry, response.missed_count)

    def _hand_out(self, sample: Telemetry) -> tuple[Subscription, ...]:
        with self._lock:
            self._sample, self._refusal = sample, None
            subscriptions = self.subscriptions
        for subscription in subscriptions:
            subscription.listener.offer(sample)
        if not self._is_flowing:
            self._is_flowing = True
            self._connection.note_answer()
            self._is_answered.set()
            self._interruptions.resumed()
        return subscriptions
