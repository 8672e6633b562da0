"""Traces of commands and tasks: from when they begin to how they end. The program may install a tracer; see there.

`ual_daemon.program` sets `tracer`; without one, nothing is traced, and nothing costs more than a look.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from types import MappingProxyType
from typing import Any, Protocol


class Tracer(Protocol):
    """See `ual.shared.tracing.Tracing`."""

    def current(self) -> object | None:
        """Returns the place in a trace of what this thread or task does; None if that is not traced."""
        ...

    def begin(self, name: str, above: object, attributes: Mapping[str, str]) -> Callable[[Future[Any]], None]:
        """Begins a part of what is at that place. Returns what ends it with a future."""
        ...


tracer: Tracer | None = None


def current() -> object | None:
    """Returns the place in a trace of what this thread or task does; None if that is not traced."""
    return None if tracer is None else tracer.current()


def begin(
    name: str, above: object | None, attributes: Mapping[str, str] = MappingProxyType({})
) -> Callable[[Future[Any]], None] | None:
    """Begins a part of what is at that place. Returns what ends it; None where nothing is traced."""
    return None if tracer is None or above is None else tracer.begin(name, above, attributes)
