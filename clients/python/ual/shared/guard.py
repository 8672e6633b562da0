"""The guard of worker threads: data that cannot be processed cost one entry, and never the thread.

A thread that encodes or writes what others have said (callers, autopilots, cameras) meets values that nobody foresaw.
Each such thread hands each entry to its `WorkGuard`, which counts and logs what fails, and has something else written
in place of the entry. `on_ended_thread` takes note of a thread that ends by an exception nevertheless.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeVar

T = TypeVar("T")

_log = logging.getLogger(__name__)

_MOST_LOGGED_ERRORS = 10
_LONGEST_CAUSE_CHARACTERS = 200
"""In characters: the cause may quote what a caller has sent."""


class GuardFigures(NamedTuple):
    """Entries that could not be processed, by the name of their guard, and the threads that have ended by a defect."""

    failed: MappingProxyType[str, int]
    ended_threads: tuple[str, ...]


class _Process:
    """Counts of the guards of this process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._failed: dict[str, int] = {}
        self._ended: tuple[str, ...] = ()

    def add_guard(self, name: str) -> None:
        with self._lock:
            self._failed.setdefault(name, 0)

    def add_failure(self, name: str) -> None:
        with self._lock:
            self._failed[name] += 1

    def add_ended(self, name: str) -> None:
        with self._lock:
            self._ended = (*self._ended, name)

    def figures(self) -> GuardFigures:
        with self._lock:
            return GuardFigures(MappingProxyType(dict(self._failed)), self._ended)

    def ended_threads(self) -> tuple[str, ...]:
        return self._ended


_process: Final = _Process()
figures: Final = _process.figures
"""Returns what the guards of this process have counted. From any thread."""
ended_threads: Final = _process.ended_threads
"""Returns the names of the threads that ended by a defect. From any thread, without a lock."""


def cause(error: BaseException) -> str:
    """Returns an exception as one short text."""
    text = f"{type(error).__name__}: {error}".rstrip(": ")
    return text if len(text) <= _LONGEST_CAUSE_CHARACTERS else f"{text[:_LONGEST_CAUSE_CHARACTERS]}..."


class WorkGuard:
    """Counts and logs the entries that a worker thread cannot process, so that it goes on. Any thread may call.

    `name` is the worker's in the log and in the metrics.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.last_cause = ""
        """Of the newest failure, as one short text."""
        self._logged: set[type[Exception]] = set()
        _process.add_guard(name)

    def run(self, work: Callable[[], T], instead: Callable[[str], T]) -> T:
        """Returns what `work` returns; where that fails, what `instead` makes of the cause."""
        try:
            return work()
        except Exception as error:  # noqa: BLE001  one entry must not end the thread
            self.note(error)
            return instead(cause(error))

    def contain(self, work: Callable[[], object], passes: type[Exception] | tuple[type[Exception], ...] = ()) -> bool:
        """Returns whether `work` was done. Exceptions of `passes` are the caller's."""
        try:
            work()
        except passes:
            raise
        except Exception as error:  # noqa: BLE001  as above
            self.note(error)
            return False
        return True

    def note(self, error: Exception) -> None:
        """Counts a failure, and logs it with its traceback, once for each kind. For an exception that is handled."""
        _process.add_failure(self.name)
        self.last_cause = cause(error)
        if type(error) not in self._logged and len(self._logged) < _MOST_LOGGED_ERRORS:
            self._logged.add(type(error))
            line = "%s: an entry could not be processed, the others are; this is a defect of UAL, please report it"
            _log.error(line, self.name, exc_info=error)


def on_ended_thread(args: Any) -> None:  # noqa: ANN401  threading.ExceptHookArgs, which is no class of Python 3.10
    """Logs and counts a thread that has ended by an exception: a program sets it as `threading.excepthook`."""
    if args.exc_type is SystemExit:
        return
    name = "unknown" if args.thread is None else args.thread.name
    _process.add_ended(name)
    error = args.exc_value if args.exc_value is not None else args.exc_type
    _log.error("the thread %r has ended; this is a defect of UAL, please report it", name, exc_info=error)
