"""Reports of refused setpoints: the first at once, those that follow together. It needs no ROS."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import ual

AGAIN_S = 0.5
"""Seconds for which setpoints with the same reason of refusal are counted, before they are reported."""


class Refusals:
    """Tells each refusal, and repeats it no faster than every `AGAIN_S`. Only the event loop calls it.

    Args:
        loop: The event loop.
        tell: Called with the topic, the last error, and how many there were since it was called last.

    """

    def __init__(self, loop: asyncio.AbstractEventLoop, tell: Callable[[str, ual.UalError, int], None]) -> None:
        self._loop = loop
        self._tell = tell
        self._counted: dict[tuple[str, str], list[ual.UalError]] = {}
        """By topic and reason: what was refused since that was told last."""
        self._timers: dict[tuple[str, str], asyncio.TimerHandle] = {}

    def note(self, topic: str, error: ual.UalError) -> None:
        """Takes a refusal."""
        key = topic, error.reason
        if key in self._counted:
            self._counted[key].append(error)
        else:
            self._tell_of(key, [error])

    def end(self) -> None:
        """Tells what is still counted, and ends."""
        for key, errors in self._counted.items():
            self._timers.pop(key).cancel()
            if errors:
                self._tell(key[0], errors[-1], len(errors))
        self._counted.clear()

    def _tell_of(self, key: tuple[str, str], errors: list[ual.UalError]) -> None:
        self._tell(key[0], errors[-1], len(errors))
        self._counted[key] = []
        self._timers[key] = self._loop.call_later(AGAIN_S, self._again, key)

    def _again(self, key: tuple[str, str]) -> None:
        errors = self._counted.pop(key)
        del self._timers[key]
        if errors:
            self._tell_of(key, errors)
