"""The lease of a UAV, kept by a thread of its own for as long as the program lives."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from typing_extensions import override

from ual import _calls, _forks, interface
from ual._connection import Connection
from ual.errors import LeaseLostError, UalError

KEEP_ALIVE_PERIOD_S = 0.5
"""A fourth of the time after which a lease expires."""
_log = logging.getLogger(__name__)


class Lease(interface.Lease):
    """See `ual.interface.Lease`. Begins at once."""

    def __init__(self, connection: Connection, holder: str, *, take: bool, settle: Callable[[], bool]) -> None:
        """`settle` sends the setpoints that wait: none of them may come after the lease has begun or ended."""
        self._connection = connection
        self._settle = settle
        self._lost: UalError | None = None
        settle()
        self._is_over = threading.Event()
        self._id = connection.run(_calls.acquire_lease(holder, take))
        connection.target.lease_id = self._id
        self._thread = threading.Thread(target=self._keep, name="lease", daemon=True)
        self._thread.start()
        _forks.renew_in_child(self)

    def begin_anew(self) -> None:
        """Leaves the lease to the parent in a forked process: to release it there would stop what the parent flies."""
        self._is_over = threading.Event()
        self._is_over.set()

    def __repr__(self) -> str:
        status = "lost" if self._lost is not None else "released" if self._is_over.is_set() else "held"
        return f"<Lease of {self._connection.target.shown_ns or 'a UAV'}, {status}>"

    @property
    @override
    def lost(self) -> UalError | None:
        return self._lost

    @override
    def release(self) -> None:
        if self._is_over.is_set():
            self._forget()
            return
        self._is_over.set()
        self._thread.join(KEEP_ALIVE_PERIOD_S)
        self._settle()
        try:
            self._connection.run(_calls.release_lease(self._id))
        except UalError as error:  # it ends by itself then
            _log.warning("the lease was not released: %s", error)
        finally:
            self._forget()

    def _forget(self) -> None:
        """Flies without a lease from now on."""
        if self._connection.target.lease_id == self._id:
            self._connection.target.lease_id = ""

    def _keep(self) -> None:
        while not self._is_over.wait(KEEP_ALIVE_PERIOD_S):
            try:
                self._connection.run(_calls.keep_lease(self._id), KEEP_ALIVE_PERIOD_S)
            except LeaseLostError as error:
                self._lose(error)
            except UalError:  # whether it still is the holder's is said by the next answer
                continue

    def _lose(self, error: UalError) -> None:
        self._lost = error
        self._is_over.set()
        _log.warning("%s", error)
