"""Subscriptions of the client: one thread drains the stream, another calls back with the newest sample.

Two threads, because a stream that is read only as fast as the callback returns fills gRPC's buffers with old samples:
the subscriber would see the UAV as it was seconds ago.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

import grpc
from typing_extensions import Self

from ual import convert
from ual._calls import QUICK_S
from ual._connection import Connection
from ual.errors import UalError, UalTimeoutError
from ual.types import Telemetry
from ual.v1 import ual_pb2 as pb

_log = logging.getLogger(__name__)

RETRY_S = 0.25


class Subscription:
    """Calls back with new samples until it is closed; goes on by itself when the daemon comes back."""

    def __init__(
        self,
        connection: Connection,
        callback: Callable[[Telemetry], None],
        rate_hz: float,
        on_close: Callable[[Subscription], None],
    ) -> None:
        self._connection = connection
        self._callback = callback
        self._rate_hz = rate_hz
        self._on_close = on_close
        self._newest = _Newest()
        self._closing = threading.Event()
        self._answered = threading.Event()
        self._refusal: UalError | None = None
        self._call: Any = None
        self._threads = (
            threading.Thread(target=self._drain, name="ual telemetry", daemon=True),
            threading.Thread(target=self._call_back, name="ual telemetry callback", daemon=True),
        )

    def open(self) -> None:
        """Begins; returns with the first sample on its way. Raises where there is no daemon, or it refuses."""
        for thread in self._threads:
            thread.start()
        try:
            is_answered = self._answered.wait(QUICK_S)
        except BaseException:  # Ctrl-C
            self.close()
            raise
        refusal = self._refusal
        if not is_answered:
            refusal = UalTimeoutError(f"the daemon sent no telemetry within {QUICK_S:g} s")
        if refusal is not None:
            self.close()
            raise refusal

    def close(self) -> None:
        """Ends it. From another thread than the callback's: once it has returned, the callback runs no more."""
        self._closing.set()
        self._newest.close()
        if self._call is not None:
            self._call.cancel()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()
        self._on_close(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def _drain(self) -> None:
        reported = ""
        while not self._closing.is_set():
            try:
                reported = self._drain_once(reported)
            except UalError as error:
                if not self._answered.is_set():
                    self._refusal = error
                    self._answered.set()
                    return
                if not self._closing.is_set() and error.reason != reported:
                    reported = error.reason
                    _log.warning("telemetry is interrupted: %s: %s", error.reason, error.message)
            self._closing.wait(RETRY_S)

    def _drain_once(self, reported: str) -> str:
        """Reads one stream to its end."""
        self._call = call = self._connection.stream_telemetry(self._rate_hz)
        if self._closing.is_set():  # closed before it could see the call
            call.cancel()
        try:
            for response in call:
                self._newest.put(response)
                self._answered.set()
                if reported:
                    reported = ""
                    _log.info("telemetry is back")
        except grpc.RpcError as error:
            raise self._connection.error(error) from error
        return reported

    def _call_back(self) -> None:
        while True:
            taken = self._newest.take()
            if taken is None:
                return
            try:
                self._callback(convert.telemetry_from_proto(*taken))
            except Exception:  # noqa: BLE001 (whatever it is, it is the callback's)
                _log.exception("the callback of a telemetry subscription failed; the subscription goes on")


class _Newest:
    """Holds the newest sample until it is taken, and counts those that were lost before it."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._response: pb.StreamTelemetryResponse | None = None
        self._missed_count = 0
        self._is_closed = False

    def put(self, response: pb.StreamTelemetryResponse) -> None:
        with self._changed:
            self._missed_count += response.missed_count + (self._response is not None)
            self._response = response
            self._changed.notify()

    def take(self) -> tuple[pb.Telemetry, int] | None:
        """The newest sample and how many were missed before it, once there is one; None once closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._response is not None or self._is_closed)
            if self._is_closed or self._response is None:
                return None
            response, self._response = self._response, None
            missed_count, self._missed_count = self._missed_count, 0
            return response.telemetry, missed_count

    def close(self) -> None:
        with self._changed:
            self._is_closed = True
            self._changed.notify()
