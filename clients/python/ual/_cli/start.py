"""When a command begins: at a time, and at the same moment for several UAVs."""

from __future__ import annotations

import re
import threading
import time
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

import click
from typing_extensions import override

from ual.errors import DaemonUnreachableError

if TYPE_CHECKING:
    from ual._client import Uav

_LONGEST_S = 86_400.0
_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2}(\.\d+)?)?")


class Time(click.ParamType[float]):
    """A time to come, in seconds since the epoch: ``14:05``, ``14:05:30``, ``+10`` (seconds from now) or ISO 8601."""

    name = "time"

    @override
    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            begin_s = _parsed(str(value))
        except ValueError:
            self.fail(
                f"{value!r} is no time: 14:05, 14:05:30, +10 (seconds from now) or 2026-11-23T14:05:30Z", param, ctx
            )
        left_s = begin_s - time.time()
        if not 0.0 <= left_s <= _LONGEST_S:
            self.fail(f"{value!r} {'has passed' if left_s < 0.0 else 'is more than a day away'}", param, ctx)
        return begin_s


def _parsed(text: str) -> float:
    if text.startswith("+"):
        return time.time() + float(text)
    if not _CLOCK.fullmatch(text):
        return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()
    now = datetime.now().astimezone()
    hour, minute, second = (*map(float, text.split(":")), 0.0)[:3]
    begin = now.replace(hour=int(hour), minute=int(minute), second=0, microsecond=0) + timedelta(seconds=second)
    return (begin if begin >= now else begin + timedelta(days=1)).timestamp()


def wait_until(utc_s: float) -> None:
    """Blocks until a time of the computer's clock, in seconds since the epoch."""
    never = threading.Event()
    while (left_s := utc_s - time.time()) > 0.0:
        never.wait(min(left_s, 1.0))  # the clock may be set meanwhile


class Gate:
    """Lets the members of a team pass at the same moment, once all have come.

    Where one cannot come, none passes if the command `needs_all`; else the others do.
    """

    def __init__(self, count: int, begin_utc_s: float | None, *, needs_all: bool) -> None:
        self._begin_utc_s = begin_utc_s
        self._needs_all = needs_all
        self._missing_count = count
        self._is_closed = False
        self._changed = threading.Condition()

    def close(self) -> None:
        """Lets nobody pass any more."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    def leave(self) -> None:
        """Takes note that one will not come."""
        if self._needs_all:
            self.close()
        else:
            self._come()

    def pass_through(self) -> None:
        """Waits for the others.

        Raises:
            DaemonUnreachableError: One of them cannot be reached and all are needed, or the gate was closed.

        """
        self._come()
        with self._changed:
            self._changed.wait_for(lambda: self._is_closed or not self._missing_count)
            if self._is_closed:
                raise DaemonUnreachableError("nothing was sent, because not all of them can be reached")
        if self._begin_utc_s is not None:
            wait_until(self._begin_utc_s)

    def _come(self) -> None:
        with self._changed:
            self._missing_count -= 1
            self._changed.notify_all()


class Member:
    """One of several UAVs that get the same command."""

    def __init__(self, name: str, gate: Gate) -> None:
        self.name = name
        self.is_flying = False
        """Whether Ctrl-C has to stop what the command has begun."""
        self.interrupted = threading.Event()
        self._gate = gate
        self._uav: Uav | None = None

    def meet(self, uav: Uav) -> None:
        """Takes the connection to the UAV, and waits for those of the others."""
        if self._uav is None:
            uav.info()
            self._gate.pass_through()
        self._uav = uav

    def leave(self) -> None:
        """Takes note that its command has ended. Where that was before it came to the gate, the others do not wait."""
        if self._uav is None:
            self._gate.leave()

    def stop(self) -> None:
        """Stops what the command has begun. Raises the `UalError` by which that is refused."""
        self.interrupted.set()
        if self._uav is not None and self.is_flying:
            self._uav.abort()
