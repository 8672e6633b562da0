"""Waits for what another thread or process does: the one way in which tests wait."""

from __future__ import annotations

import asyncio
import gc
import inspect
import selectors
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Protocol, TypeVar

import grpc

from ual.types import State, Telemetry

T = TypeVar("T")
LIMIT_S = 240.0
"""Seconds that anything may take before a test gives up. A minute of a stepped simulation may take several on a busy
machine. Shorter than pytest's own limit, which does not say what was waited for.
"""
_PAUSE_S = 0.005
_WAIT = (str(Path(grpc.__file__).parent), selectors.__file__, subprocess.__file__, threading.__file__)
"""Files in which a thread waits."""


_frames_lock = threading.Lock()
_died: list[threading.ExceptHookArgs] = []
"""The threads that have died of an error since the test began."""


class Watched(Protocol):
    """A UAV, through the class or the client."""

    def state(self) -> State: ...

    def telemetry(self) -> Telemetry: ...


def until(
    condition: Callable[[], T],
    what: str = "",
    *,
    seen: Callable[[], object] | None = None,
    between: Callable[[], object] | None = None,
    limit_s: float = LIMIT_S,
) -> T:
    """Waits until a condition is true, and returns its answer.

    A failure says what was waited for (by default the condition as it is written), and what was seen last: what `seen`
    returns, or the last answer. `between` runs after each look that was in vain, instead of a pause.
    """
    wait = _Wait(condition, what, seen, limit_s)
    while not (answer := condition()):
        wait.check(answer)
        (between or _pause)()
    return answer


def _pause() -> float:
    """Waits until the next look is due, and returns when that is. `is_at_work` reads it meanwhile."""
    due_s = time.monotonic() + _PAUSE_S
    time.sleep(_PAUSE_S)
    return due_s


def is_at_work(thread: threading.Thread) -> bool:
    """Returns whether a thread has something to do, though a busy computer may give it no processor.

    It has not while it waits for another thread, a process or a descriptor, or between two looks of `until`. It has
    from the moment at which the other thread has notified it, or the next look is due.
    """
    frame = _frame_of(thread)
    if frame is None:
        return False
    if frame.f_code is _pause.__code__:
        return bool(time.monotonic() >= frame.f_locals.get("due_s", 0.0))
    if frame.f_code is threading.Condition.wait.__code__:
        waiter, waiting = frame.f_locals.get("waiter"), frame.f_locals["self"]._waiters
        return waiter is not None and waiter not in waiting
    return not frame.f_code.co_filename.startswith(_WAIT)


def _frame_of(thread: threading.Thread) -> FrameType | None:
    """Returns the frame that a thread runs.

    `sys._current_frames` holds the interpreter's lock of threads while it makes its answer. A collection of garbage
    then could pass the processor to another thread, which starts a third one and so waits for that lock: for ever
    (python/cpython#106883).
    """
    with _frames_lock:
        is_collecting = gc.isenabled()
        gc.disable()
        try:
            return sys._current_frames().get(thread.ident or 0)
        finally:
            if is_collecting:
                gc.enable()


def until_after(
    events: Sequence[T], point: int, is_it: Callable[[T], bool], what: str = "", *, limit_s: float = LIMIT_S
) -> T:
    """Waits for an event after a point, and returns it. What is there already is not taken for it.

    `events` only grows, and `point` is its length before what causes the event.
    """

    def found() -> list[T]:
        return [each for each in events[point:] if is_it(each)]

    return until(found, what or _source_of(is_it), seen=lambda: events[point:], limit_s=limit_s)[0]


def fail_waits_of_the_dead() -> None:
    """Lets waits fail as soon as a thread of this process has died: what they wait for may never come."""
    hook = threading.excepthook

    def died(args: threading.ExceptHookArgs) -> None:
        hook(args)
        _died.append(args)

    threading.excepthook = died


def forget_the_dead() -> None:
    """Begins another test."""
    _died.clear()


async def until_async(
    condition: Callable[[], T],
    what: str = "",
    *,
    seen: Callable[[], object] | None = None,
    limit_s: float = LIMIT_S,
) -> T:
    """Waits as `until`; the event loop runs meanwhile."""
    wait = _Wait(condition, what, seen, limit_s)
    while not (answer := condition()):
        wait.check(answer)
        await asyncio.sleep(_PAUSE_S)
    return answer


def until_state(uav: Watched, *states: State, limit_s: float = LIMIT_S) -> None:
    """Waits until a UAV is in one of the states."""
    names = " or ".join(state.name for state in states)
    until(lambda: uav.state() in states, names, seen=uav.telemetry, limit_s=limit_s)


class _Wait:
    """Awaited condition, and the duration of the wait."""

    def __init__(
        self, condition: Callable[[], object], what: str, seen: Callable[[], object] | None, limit_s: float
    ) -> None:
        self._condition = condition
        self._what = what
        self._seen = seen
        self._limit_s = limit_s
        self._deadline_s = time.monotonic() + limit_s

    def check(self, answer: object) -> None:
        """Fails once the limit has passed, or a thread has died."""
        for died in _died:
            name = None if died.thread is None else died.thread.name
            raise AssertionError(f"the thread {name!r} has died: {died.exc_value!r}") from died.exc_value
        assert time.monotonic() < self._deadline_s, self._failure(answer)

    def _failure(self, answer: object) -> str:
        seen = answer if self._seen is None else self._seen()
        what = self._what or _source_of(self._condition)
        return f"waited {self._limit_s:g} s in vain for: {what}; seen last: {seen}"


def _source_of(condition: Callable[..., object]) -> str:
    """The lines of a lambda, or the name of another function."""
    name = getattr(condition, "__qualname__", repr(condition))
    return " ".join(inspect.getsource(condition).split()) if name.endswith("<lambda>") else name
