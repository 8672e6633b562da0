"""`set_velocity` and `set_pose` of the client: the first of a motion is answered, those that follow are streamed.

A call that begins a motion waits for the daemon's answer (a millisecond), so that a refusal is raised where it belongs.
Calls that follow within `CONTINUES_S` only hand over the newest setpoint and return; if the daemon refuses one of
those, the next call raises it.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

import grpc

from ual import _calls, _direct
from ual._connection import Connection
from ual._direct import Send
from ual.errors import DaemonUnreachableError, UalError
from ual.v1 import ual_pb2 as pb

_log = logging.getLogger(__name__)

# The daemon stops a UAV that gets no velocity for this long: what comes later begins a new motion.
CONTINUES_S = 0.5
# A setpoint that could not be sent for this long is not sent at all: the world has moved on.
STALE_S = 0.2
CLOSE_S = 2.0


class Setpoints:
    """Sends setpoints, the newest only. May be used from any thread."""

    def __init__(self, connection: Connection, clock: Callable[[], float] = time.monotonic) -> None:
        self._connection = connection
        self._clock = clock
        self._lock = threading.Lock()
        self._stream: _Stream | None = None
        self._failure: UalError | None = None
        self._accepted_s: float | None = None

    def send(self, setpoint: pb.StreamSetpointsRequest) -> None:
        """Sends a setpoint; raises the refusal of this one, or of one before."""
        with self._lock:
            failure, self._failure = self._failure, None
            now_s = self._clock()
            continues = failure is None and self._accepted_s is not None and now_s - self._accepted_s < CONTINUES_S
            self._accepted_s = now_s if continues else None
            stream, is_new = self._stream, False
            if continues and stream is None:
                stream, is_new = _Stream(self._connection, self._on_end, self._clock), True
                self._stream = stream
        if failure is not None:
            raise failure
        if not continues or stream is None:
            self._connection.run(_calls.single_setpoint(setpoint))
            with self._lock:
                self._accepted_s = self._clock()
            return
        stream.put(setpoint)
        if is_new:
            stream.open()

    def settle(self) -> bool:
        """Sends what waits and ends the stream, so that what is called next comes after it. Returns whether the daemon
        took it all. If not, that is logged, as is a refusal that no setpoint is left to raise.
        """
        with self._lock:
            stream, self._accepted_s = self._stream, None
        is_taken = stream is None or stream.close(CLOSE_S)
        with self._lock:
            failure, self._failure = self._failure, None
        return tell(is_taken, failure)

    def _on_end(self, stream: _Stream, failure: UalError | None) -> None:
        with self._lock:
            if self._stream is stream:
                self._stream = None
                self._failure = failure


def tell(is_taken: bool, failure: UalError | None) -> bool:
    """Logs what is wrong with the setpoints that nobody will ask for any more; returns whether nothing is."""
    if not is_taken:
        _log.warning(
            "the daemon did not take the last setpoints within %g s: what the UAV makes of them is not known", CLOSE_S
        )
    if failure is not None:
        _log.warning("the last setpoints were refused: %s: %s", failure.reason, failure.message)
    return is_taken and failure is None


class _Stream:
    """One stream of setpoints: one is under way at a time, the newest waits, those between are never sent.

    It is sent from the caller's thread where gRPC lets us (`_direct`). Else gRPC's own sending thread takes it by
    iterating over this, as it does in any case to learn of the end.
    """

    def __init__(
        self,
        connection: Connection,
        on_end: Callable[[_Stream, UalError | None], None],
        clock: Callable[[], float],
    ) -> None:
        self._connection = connection
        self._on_end = on_end
        self._clock = clock
        self._lock = threading.Lock()
        self._newest: tuple[pb.StreamSetpointsRequest, float] | None = None
        self._is_under_way = True
        """Whether a setpoint is, or none can be sent yet."""
        self._is_ending = False
        self._ended = threading.Event()
        self._iterated: SimpleQueue[tuple[pb.StreamSetpointsRequest, Callable[[], None]] | None] = SimpleQueue()
        self._tell_out: Callable[[], None] | None = None
        self._send: Send = self._send_by_iterator
        self._call: Any = None

    def put(self, setpoint: pb.StreamSetpointsRequest) -> None:
        """Sends it, or lets it wait in place of the one that waits."""
        with self._lock:
            if self._is_under_way:
                self._newest = (setpoint, self._clock())
                return
            self._is_under_way = True
        self._send(setpoint, self._go_on)

    def open(self) -> None:
        """Begins to send."""
        try:
            self._call = self._connection.stream_setpoints(self)
        except UalError:
            self._ended.set()
            self._on_end(self, None)
            raise
        self._call.add_done_callback(self._end)
        self._send = _direct.sender(self._call) or self._send_by_iterator
        self._go_on()

    def close(self, timeout_s: float) -> bool:
        """Ends the stream once what waits is sent; cancels it where the daemon has not taken that in time. Returns
        whether it has.
        """
        with self._lock:
            self._is_ending = True
            is_under_way = self._is_under_way
        if not is_under_way:
            self._iterated.put(None)
        if self._ended.wait(timeout_s):
            return True
        if self._call is not None:
            self._call.cancel()
            self._ended.wait(timeout_s)
        return False

    def __iter__(self) -> _Stream:
        return self

    def __next__(self) -> pb.StreamSetpointsRequest:
        if self._tell_out is not None:  # the one before is out
            self._tell_out()
        taken = self._iterated.get()
        if taken is None:
            self._tell_out = None
            self._iterated.put(None)  # it stays ended, whoever asks again
            raise StopIteration
        setpoint, self._tell_out = taken
        return setpoint

    def _go_on(self) -> None:
        """Sends the newest, when none is under way; the end, when there is none left. On threads of gRPC, too."""
        while True:
            with self._lock:
                newest, self._newest = self._newest, None
                if newest is None:
                    self._is_under_way = False
                    is_ending = self._is_ending
                    break
            setpoint, put_s = newest
            if self._clock() - put_s <= STALE_S:
                self._send(setpoint, self._go_on)
                return
        if is_ending:
            self._iterated.put(None)

    def _send_by_iterator(self, setpoint: Any, then: Callable[[], None]) -> None:  # noqa: ANN401 (as any message)
        self._iterated.put((setpoint, then))

    def _end(self, call: Any) -> None:  # noqa: ANN401 (gRPC's future)
        was_asked, self._is_ending = self._is_ending, True
        self._iterated.put(None)  # lets gRPC's sending thread end, too
        failure: UalError | None = None
        if call.code() is not grpc.StatusCode.OK:
            failure = None if call.cancelled() else self._connection.error(call)
        elif not was_asked:
            failure = DaemonUnreachableError("the daemon ended the stream of setpoints")
        self._on_end(self, failure)
        self._ended.set()
