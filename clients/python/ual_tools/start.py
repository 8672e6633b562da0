"""Begin of a command: at a time, and at the same moment for several UAVs."""

from __future__ import annotations

import math
import re
import threading
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from queue import SimpleQueue
from typing import TYPE_CHECKING

import click
from typing_extensions import override

from ual.errors import DaemonUnreachableError
from ual.shared.numbers import parse_number
from ual_tools.streams import OutputKind

if TYPE_CHECKING:
    from ual import Uav
    from ual_tools.condition import UavCondition

_LONGEST_DELAY_S = 86_400.0
_DAY, _HALF_DAY, _JUST_PAST = timedelta(days=1), timedelta(hours=12), timedelta(hours=2)
_SHORT_DELAY_S = 10.0
"""A wait that no one needs to be told of."""
_CLOCK = re.compile(r"[0-9]{1,2}:[0-9]{2}(:[0-9]{2}(\.[0-9]+)?)?")


def _tell_no_one(_: str) -> None:
    """Leaves it unsaid."""


class Time(click.ParamType[float]):
    """A time to come, in seconds since the epoch: ``14:05``, ``14:05:30``, ``+10`` (seconds from now) or ISO 8601."""

    name = "time"

    @override
    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        text, now = str(value), datetime.now().astimezone()
        try:
            begin_s = parsed(text, now)
        except ValueError:
            self.fail(
                f"{value!r} is no time: 14:05, 14:05:30, +10 (seconds from now) or 2026-11-23T14:05:30Z", param, ctx
            )
        left_s = begin_s - now.timestamp()
        if left_s < 0.0:
            self.fail(f"{value!r} has passed {_duration_text(-left_s)} ago{_next(text, begin_s)}", param, ctx)
        if left_s > _LONGEST_DELAY_S:
            self.fail(f"{value!r} is more than a day away", param, ctx)
        return begin_s


def parsed(text: str, now: datetime) -> float:
    """Returns the time that a text means, in seconds since the epoch.

    A time of the day is today's: at 10:10 9:00 has passed. Around midnight it is the nearest one: at 23:59 0:05 is
    tomorrow's, and at 0:05 23:59 has passed.

    Raises:
        ValueError: It is no time.

    """
    if text.startswith("+"):
        return now.timestamp() + parse_number(text)
    if not _CLOCK.fullmatch(text):
        return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()
    hour, minute, second = (*map(float, text.split(":")), 0.0)[:3]
    begin = now.replace(hour=int(hour), minute=int(minute), second=0, microsecond=0) + timedelta(seconds=second)
    if begin - _DAY > now - _JUST_PAST:
        return (begin - _DAY).timestamp()
    return (begin + _DAY if begin < now - _HALF_DAY else begin).timestamp()


def _next(text: str, begin_s: float) -> str:
    """Says how to write the same time of the next day, where only a time of the day was given."""
    if not _CLOCK.fullmatch(text):
        return ""
    following = datetime.fromtimestamp(begin_s).astimezone() + _DAY
    return f"; for the next one write {following.isoformat(timespec='seconds')}"


def wait_until(utc_s: float, tell: Callable[[str], None] = _tell_no_one) -> None:
    """Blocks until a time of the computer's clock, in seconds since the epoch.

    A long wait is reported at its beginning, and each time when half of the rest has passed.
    """
    never = threading.Event()
    shown_s = math.inf
    while (left_s := utc_s - time.time()) > 0.0:
        if _SHORT_DELAY_S < left_s <= shown_s / 2:
            tell(f"begins at {datetime.fromtimestamp(utc_s).astimezone():%H:%M:%S}, in {_duration_text(left_s)}")
            shown_s = left_s
        never.wait(min(left_s, 1.0))  # the clock may be set meanwhile


def _duration_text(duration_s: float) -> str:
    hours, minutes, seconds = round(duration_s) // 3600, round(duration_s) // 60 % 60, round(duration_s) % 60
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {seconds} s" if minutes else f"{seconds} s"


class Gate:
    """Lets the members of a team pass at the same moment, once all have come.

    Where one cannot come, none passes if the command `needs_all`; else the others do.
    """

    def __init__(
        self, count: int, begin_utc_s: float | None, *, needs_all: bool, tell: Callable[[str], None] = _tell_no_one
    ) -> None:
        """`tell` gets the words about a long wait, once for all of them."""
        self._begin_utc_s = begin_utc_s
        self._tell = tell
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
            tell, self._tell = self._tell, _tell_no_one
        if self._begin_utc_s is not None:
            wait_until(self._begin_utc_s, tell)

    def _come(self) -> None:
        with self._changed:
            self._missing_count -= 1
            self._changed.notify_all()


class CommandMember:
    """One of several UAVs that get the same command."""

    def __init__(self, name: str, gate: Gate) -> None:
        self.name = name
        self.is_flying = False
        """Whether Ctrl-C has to stop what the command has begun."""
        self.interrupted = threading.Event()
        self.lines: SimpleQueue[tuple[str, OutputKind]] = SimpleQueue()
        """Printed lines of its command, each with its kind."""
        self.condition: UavCondition | None = None
        """Condition of the UAV, where its command asked for it."""
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
