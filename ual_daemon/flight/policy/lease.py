"""The lease: one program at a time that flies, where somebody requests it.

Each command is given with the identifier of a lease, or with none. It may begin if that is the identifier of the lease
that is held, or if neither is there: one comparison, which costs a stream of setpoints nothing.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timezone

from ual.errors import LeaseHeldError, LeaseLostError, UalError
from ual.types import LeaseInfo
from ual_daemon.backends.clock import steady_s

EXPIRES_AFTER_S = 2.0
"""Seconds that a lease lasts after it was kept last. A program that is alive keeps it four times as often."""
NOBODY = ""
_MOST_ENDED_LEASES = 100


@dataclass(frozen=True, slots=True)
class _Held:
    id: str
    info: LeaseInfo
    lasts_s: float


class FlightLease:
    """The lease: at most one program commands a UAV. Any thread may call.

    Durations are of the computer's monotonic clock, also in a simulation: a program lives in real time.
    """

    def __init__(self, clock: Callable[[], float] = steady_s) -> None:
        self.id = NOBODY
        """The identifier of the lease that is held; compared with that of each command."""
        self._clock = clock
        self._lock = threading.Lock()
        self._held: _Held | None = None
        self._expires_s = math.inf
        self._ended: dict[str, str] = {}

    @property
    def info(self) -> LeaseInfo | None:
        """Holder of the lease; None where there is no lease."""
        held = self._held
        return None if held is None else held.info

    def acquire(
        self, holder: str, identity: str, *, take: bool, lasts_s: float = EXPIRES_AFTER_S, lease_id: str = NOBODY
    ) -> str:
        """Begins a lease and returns its identifier, a secret. The holder (`lease_id`) gets its lease again.

        Raises:
            LeaseHeldError: Another one is held, and it is not to be taken.
            LeaseLostError: The one that the caller has has ended.

        """
        info = LeaseInfo(holder, identity, time.time())
        with self._lock:
            if lease_id != NOBODY:
                if (refusal := self.refusal("acquire_lease", lease_id)) is not None:
                    raise refusal
                return lease_id
            if self._held is not None and not take:
                raise _held_error("acquire_lease", self._held.info)
            self._end(f"taken by {_described(info)}")
            self._held = held = _Held(os.urandom(16).hex(), info, lasts_s)
            self._expires_s = self._clock() + lasts_s
            self.id = held.id
        return held.id

    def keep(self, lease_id: str) -> None:
        """Keeps a lease.

        Raises:
            LeaseLostError: It has ended.

        """
        with self._lock:
            # One that is late is not ended here: the UAV has to be stopped with it (`expire`).
            if self._held is None or self._held.id != lease_id or self._clock() > self._expires_s:
                raise self._lost(lease_id, "keep_lease")
            self._expires_s = self._clock() + self._held.lasts_s

    def release(self, lease_id: str) -> bool:
        """Ends a lease. Returns False where it has ended before."""
        with self._lock:
            if self._held is None or self._held.id != lease_id:
                return False
            self._end("it was released")
            return True

    def expire(self) -> LeaseInfo | None:
        """Ends the lease if it was not kept. Returns its former holder, if it has ended by this."""
        if self._held is None or self._clock() <= self._expires_s:
            return None
        with self._lock:
            held = self._held
            if held is None or self._clock() <= self._expires_s:
                return None
            self._end(_expired(held))
            return held.info

    def refusal(self, command: str, lease_id: str) -> UalError | None:
        """Returns why a command may not begin with the lease by which it is given; None if it may."""
        held = self._held
        if lease_id == (NOBODY if held is None else held.id):
            return None
        if lease_id != NOBODY or held is None:
            return self._lost(lease_id, command)
        return _held_error(command, held.info)

    def _lost(self, lease_id: str, command: str) -> LeaseLostError:
        how = self._ended.get(lease_id, "this daemon does not know it: it may have been restarted")
        if self._held is not None and self._held.id == lease_id:
            how = _expired(self._held)
        return LeaseLostError(f"{command}: the lease has ended: {how}", {"by": how, "command": command})

    def _end(self, how: str) -> None:
        if self._held is None:
            return
        self._ended[self._held.id] = how
        if len(self._ended) > _MOST_ENDED_LEASES:
            del self._ended[next(iter(self._ended))]
        self._held, self._expires_s, self.id = None, math.inf, NOBODY


def _expired(held: _Held) -> str:
    return f"it was not kept for {held.lasts_s:g} s"


def _held_error(command: str, info: LeaseInfo) -> LeaseHeldError:
    since = datetime.fromtimestamp(info.since_s, timezone.utc).isoformat(timespec="seconds")
    return LeaseHeldError(
        f"{command}: {_described(info)} holds the lease since {since}; a commander may take it (take, `ual --take`)",
        {"holder": info.holder, "identity": info.identity, "since": since, "command": command},
    )


def _described(info: LeaseInfo) -> str:
    return f"{info.holder} ({info.identity})" if info.identity not in ("", info.holder) else info.holder
