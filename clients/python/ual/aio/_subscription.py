"""Subscriptions of the asyncio client: a task reads the stream, and the iteration takes the newest sample."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from typing_extensions import Self

from ual._interruption_log import InterruptionLog
from ual._subscription import RETRY_S
from ual.aio._connection import Connection
from ual.errors import UalError
from ual.shared import views
from ual.types import Telemetry
from ual.v1 import ual_pb2 as pb
from ual.wire import samples

_log = logging.getLogger(__name__)


class Subscription:
    """An asynchronous iterator over new samples. It skips samples that it is too slow for, and reconnects when the
    daemon comes back.

    Ends by `close`, on leaving its ``async with`` block, or with its `Uav`. The iteration raises a `UalError` if the
    daemon refuses the subscription at its beginning.
    """

    def __init__(self, connection: Connection, rate_hz: float, on_close: Callable[[Subscription], None]) -> None:
        self._connection = connection
        self._rate_hz = rate_hz
        self._on_close = on_close
        self._changed = asyncio.Event()
        self._newest: pb.StreamTelemetryResponse | None = None
        self._missed_count = 0
        self._refusal: Exception | None = None
        self._interruption: UalError | None = None
        self._is_closed = False
        self._reading: asyncio.Task[None] | None = None

    def __repr__(self) -> str:
        return views.subscription_text(self._connection.target.shown_ns, self._rate_hz, is_closed=self._is_closed)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Telemetry:
        self._connection.require_own_loop()
        if self._reading is None and not self._is_closed:
            self._reading = asyncio.create_task(self._read())
        while self._newest is None:
            if self._refusal is not None:
                raise self._refusal
            if self._is_closed:
                raise StopAsyncIteration
            self._changed.clear()
            await self._changed.wait()
        response, self._newest = self._newest, None
        missed_count, self._missed_count = self._missed_count, 0
        return samples.telemetry_from_proto(response.telemetry, missed_count)

    @property
    def interruption(self) -> UalError | None:
        """Why no samples come, while the daemon is away or refuses them; None while they come."""
        return self._interruption

    async def close(self) -> None:
        """Ends it, and with it the iteration."""
        self._is_closed = True
        self._newest = None
        self._changed.set()
        self._on_close(self)
        if self._reading is not None:
            self._reading.cancel()
            await asyncio.wait((self._reading,))

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()

    async def _read(self) -> None:
        """Reads samples until it is closed. If reading ends by an error, the iteration raises that error."""
        try:
            await self._take()
        except asyncio.CancelledError:
            if not self._is_closed:
                self._refusal = UalError("the task that reads this subscription was cancelled")
            raise
        except Exception as error:  # noqa: BLE001 (the iteration raises it)
            self._refusal = error
        finally:
            self._changed.set()

    async def _take(self) -> None:
        interruptions = InterruptionLog(_log)
        has_begun = False
        while True:
            try:
                async for response in self._connection.stream_telemetry(self._rate_hz):
                    has_begun, self._interruption = True, None
                    interruptions.resumed()
                    self._missed_count += response.missed_count + (self._newest is not None)
                    self._newest = response
                    self._changed.set()
            except UalError as error:
                if not has_begun or self._connection.is_closed:
                    raise
                self._interruption = error
                interruptions.interrupted(error)
            await asyncio.sleep(RETRY_S)
