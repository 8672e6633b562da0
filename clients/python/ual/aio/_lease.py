"""The lease of a UAV, kept by a task for as long as the event loop runs; see `ual._lease`."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine, Generator
from typing import Any

from typing_extensions import Self

from ual import _calls
from ual._lease import KEEP_ALIVE_PERIOD_S
from ual.aio._connection import Connection
from ual.errors import LeaseLostError, UalError

_log = logging.getLogger(__name__)


class Lease:
    """The lease of one UAV, from `acquire` (``await``, or the beginning of its ``async with`` block) until `release`.

    See `ual.interface.Lease`.
    """

    def __init__(
        self, connection: Connection, holder: str, *, take: bool, settle: Callable[[], Coroutine[Any, Any, bool]]
    ) -> None:
        self._connection = connection
        self._holder = holder
        self._take = take
        self._settle = settle
        self._id = ""
        self._keeping: asyncio.Task[None] | None = None
        self._lost: UalError | None = None

    @property
    def lost(self) -> UalError | None:
        """Why it has ended by itself; None while it is held, and where it was released."""
        return self._lost

    async def acquire(self) -> Self:
        """Acquires it.

        Raises:
            LeaseHeldError: Another program holds it.
            PermissionDeniedError: Only a commander may take it.

        """
        await self._settle()
        self._lost = None  # of the time before
        self._id = await self._connection.run(_calls.acquire_lease(self._holder, self._take))
        self._connection.target.lease_id = self._id
        self._keeping = asyncio.create_task(self._keep())
        return self

    async def release(self) -> None:
        """Ends it: what is in progress is aborted, and the UAV holds its position."""
        if self._keeping is None:
            return
        keeping, self._keeping = self._keeping, None
        keeping.cancel()
        await asyncio.wait((keeping,))
        await self._settle()
        try:
            if self._lost is None:
                await self._connection.run(_calls.release_lease(self._id))
        except UalError as error:  # it ends by itself then
            _log.warning("the lease was not released: %s", error)
        finally:
            if self._connection.target.lease_id == self._id:
                self._connection.target.lease_id = ""

    def __await__(self) -> Generator[Any, None, Self]:
        return self.acquire().__await__()

    async def __aenter__(self) -> Self:
        return self if self._keeping is not None else await self.acquire()

    async def __aexit__(self, *exc: object) -> None:
        await self.release()

    async def _keep(self) -> None:
        while self._lost is None:
            await asyncio.sleep(KEEP_ALIVE_PERIOD_S)
            try:
                await self._connection.run(_calls.keep_lease(self._id), KEEP_ALIVE_PERIOD_S)
            except LeaseLostError as error:
                self._lost = error
                _log.warning("%s", error)
            except UalError:  # whether it still is the holder's is said by the next answer
                continue
