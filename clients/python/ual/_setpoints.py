"""`set_velocity` and `set_pose` of the client: the first setpoint is sent by a call, those that follow by a stream.

Poses from outside (`set_external_pose`) are sent in the same way, by a stream of their own.

The first setpoint waits for the daemon's answer (a millisecond), so that the caller that began to fly gets the refusal.
Setpoints that follow within `STREAM_S` only hand over the newest one and return. If the daemon refuses one of
these, the next setpoint raises the refusal.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, NamedTuple, TypeAlias

import grpc

from ual import _calls, _direct, _forks
from ual._connection import Connection
from ual._direct import Send
from ual.errors import DaemonUnreachableError, UalError

_log = logging.getLogger(__name__)

Element: TypeAlias = Any
"""A message of the stream: which one depends on its `StreamKind`."""

STREAM_S = 0.5
"""A setpoint that comes later than this after the last one is sent by a call again. The daemon stops a UAV that gets no
velocity for this long.
"""
STALE_SETPOINT_S = 0.2
"""A setpoint that waits for longer than this is dropped, because it is out of date."""
CLOSE_TIMEOUT_S = 2.0
"""Seconds that the daemon may take to read the last setpoints of a stream."""


class StreamKind(NamedTuple):
    """Kind of stream: its name in the plural, the call of a single value, and the method of the stream. The last field
    says what is unknown about values that the daemon did not take.
    """

    name: str
    single: Callable[[Any], _calls.Call[None]]
    method: str
    doubt: str


SETPOINTS = StreamKind("setpoints", _calls.single_setpoint, "StreamSetpoints", "whether the UAV follows them")
EXTERNAL_POSES = StreamKind(
    "poses from outside", _calls.single_external_pose, "StreamExternalPoses", "whether the autopilot got them"
)


class Setpoints:
    """Sends setpoints; skips those that a newer one has replaced. May be used from any thread."""

    def __init__(
        self, connection: Connection, clock: Callable[[], float] = time.monotonic, kind: StreamKind = SETPOINTS
    ) -> None:
        self._kind = kind
        self._connection = connection
        self._clock = clock
        self._lock = threading.Lock()
        self._stream: _Stream | None = None
        self._failure: UalError | None = None
        self._accepted_s: float | None = None
        self._of_parent: list[_Stream] = []
        _forks.renew_in_child(self)

    def begin_anew(self) -> None:
        """Leaves the parent's stream to it in a forked process: the first setpoint here is sent by a call again."""
        self._lock = threading.Lock()
        self._of_parent += filter(None, [self._stream])
        self._stream, self._failure, self._accepted_s = None, None, None

    def send(self, setpoint: Element) -> None:
        """Sends a setpoint. Raises the `UalError` by which the daemon refused this one or an earlier one."""
        try:
            self._send(setpoint)
        except KeyboardInterrupt:  # between any two steps: how far the stream has come is not known
            self._cancel()
            self._connection.abandon()
            raise

    def _send(self, setpoint: Element) -> None:
        with self._lock:
            failure, self._failure = self._failure, None
            now_s = self._clock()
            continues = failure is None and self._accepted_s is not None and now_s - self._accepted_s < STREAM_S
            self._accepted_s = now_s if continues else None
            stream, is_new = self._stream, False
            if continues and stream is None:
                stream, is_new = _Stream(self._connection, self._on_end, self._clock, self._kind), True
                self._stream = stream
        if failure is not None:
            raise failure
        if not continues or stream is None:
            self._connection.run(self._kind.single(setpoint))
            with self._lock:
                self._accepted_s = self._clock()
            return
        stream.put(setpoint)
        if is_new:
            stream.open()

    def _cancel(self) -> None:
        """Cancels the stream: the next setpoint is sent by a call."""
        with self._lock:
            stream, self._stream, self._accepted_s = self._stream, None, None
        if stream is not None:
            stream.cancel()

    def settle(self) -> bool:
        """Sends the setpoint that waits and ends the stream, so that the next call reaches the daemon after it.

        Returns whether the daemon took all setpoints. Otherwise logs it, as well as a refusal, which no later setpoint
        can raise any more.
        """
        with self._lock:
            stream, self._accepted_s = self._stream, None
        is_taken = stream is None or stream.close(CLOSE_TIMEOUT_S)
        with self._lock:
            failure, self._failure = self._failure, None
        return log_settled(is_taken, failure, self._kind)

    def _on_end(self, stream: _Stream, failure: UalError | None) -> None:
        with self._lock:
            if self._stream is stream:
                self._stream = None
                self._failure = failure


def log_settled(is_taken: bool, failure: UalError | None, kind: StreamKind = SETPOINTS) -> bool:
    """Logs what went wrong with the last setpoints of a stream; returns whether all of them were taken."""
    if not is_taken:
        _log.warning(
            "the daemon did not take the last %s within %g s: it is not known %s",
            kind.name,
            CLOSE_TIMEOUT_S,
            kind.doubt,
        )
    if failure is not None:
        _log.warning("the last %s were refused: %s: %s", kind.name, failure.reason, failure.message)
    return is_taken and failure is None


class _Stream:
    """One stream of setpoints. One setpoint at a time is being sent, the newest waits, those between are dropped.

    A setpoint is sent from the caller's thread if this gRPC allows it (`_direct`). Otherwise gRPC's sending thread
    takes it by iterating over this object. In both cases the end of the iteration ends the stream.
    """

    def __init__(
        self,
        connection: Connection,
        on_end: Callable[[_Stream, UalError | None], None],
        clock: Callable[[], float],
        kind: StreamKind = SETPOINTS,
    ) -> None:
        self._kind = kind
        self._connection = connection
        self._on_end = on_end
        self._clock = clock
        self._lock = threading.Lock()
        self._newest: tuple[Element, float] | None = None
        self._is_sending = True
        """Whether a setpoint is being sent, or the stream is not open yet."""
        self._is_ending = False
        self._ended = threading.Event()
        self._iterated: SimpleQueue[tuple[Element, Callable[[], None]] | None] = SimpleQueue()
        self._on_sent: Callable[[], None] | None = None
        self._send: Send = self._send_by_iterator
        self._call: Any = None

    def put(self, setpoint: Element) -> None:
        """Sends a setpoint, or lets it wait in place of the one that waits."""
        with self._lock:
            if self._is_sending:
                self._newest = (setpoint, self._clock())
                return
            self._is_sending = True
        self._send(setpoint, self._send_next)

    def open(self) -> None:
        """Opens the stream and begins to send. Raises `UalError` if the daemon cannot be called."""
        try:
            self._call = self._connection.stream(self._kind.method, self)
        except UalError:
            self._ended.set()
            self._on_end(self, None)
            raise
        self._call.add_done_callback(self._end)
        self._send = _direct.sender(self._call) or self._send_by_iterator
        self._send_next()

    def close(self, timeout_s: float) -> bool:
        """Ends the stream once the waiting setpoint is sent. Returns whether the daemon took all of them in time;
        otherwise the stream is cancelled.
        """
        with self._lock:
            self._is_ending = True
            is_sending = self._is_sending
        if not is_sending:
            self._iterated.put(None)
        if self._ended.wait(timeout_s):
            return True
        if self._call is not None:
            self._call.cancel()
            self._ended.wait(timeout_s)
        return False

    def cancel(self) -> None:
        """Ends the stream at once, whether or not it is open. Nothing more is sent."""
        self._is_ending = True
        self._iterated.put(None)  # ends gRPC's sending thread, too
        if self._call is not None:
            self._call.cancel()

    def __iter__(self) -> _Stream:
        return self

    def __next__(self) -> Element:
        if self._on_sent is not None:  # gRPC requests the next one: the one before is sent
            self._on_sent()
        taken = self._iterated.get()
        if taken is None:
            self._on_sent = None
            self._iterated.put(None)  # further calls must end the iteration, too
            raise StopIteration
        setpoint, self._on_sent = taken
        return setpoint

    def _send_next(self) -> None:
        """Sends the waiting setpoint; ends the stream if none waits and `close` was called. Also runs on gRPC's
        threads.
        """
        while True:
            with self._lock:
                newest, self._newest = self._newest, None
                if newest is None:
                    self._is_sending = False
                    is_ending = self._is_ending
                    break
            setpoint, put_s = newest
            if self._clock() - put_s <= STALE_SETPOINT_S:
                self._send(setpoint, self._send_next)
                return
        if is_ending:
            self._iterated.put(None)

    def _send_by_iterator(self, setpoint: Any, then: Callable[[], None]) -> None:  # noqa: ANN401 (as any message)
        self._iterated.put((setpoint, then))

    def _end(self, call: Any) -> None:  # noqa: ANN401 (gRPC's future)
        was_ending, self._is_ending = self._is_ending, True
        self._iterated.put(None)  # ends gRPC's sending thread, too
        failure: UalError | None = None
        if call.code() is not grpc.StatusCode.OK:
            failure = None if call.cancelled() else self._connection.error(call)
        elif not was_ending:
            failure = DaemonUnreachableError(f"the daemon ended the stream of {self._kind.name}")
        self._on_end(self, failure)
        self._ended.set()
