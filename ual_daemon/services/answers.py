"""Waits, in the class, for what a service has begun. `ual_daemon.server.services.waiting` does so on the event loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Future
from typing import Any, NamedTuple, TypeAlias, TypeVar

from ual.contract.methods import METHODS
from ual_daemon.services.vehicle import wait

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])


class Pause(NamedTuple):
    """A time in which a stream has nothing to say."""

    seconds: float


Steps: TypeAlias = "Generator[T | Pause | Future[Any], Any, None]"
"""A stream as a service writes it, for both ways in: results, pauses, and futures, of which it gets the results."""


def in_thread(method: F) -> F:
    """Declares that a method takes long before it returns: the server calls it off the event loop."""
    return method


def answer(future: Future[T], method: str) -> T:
    """Waits for what a method has begun, as long as the contract says.

    Raises:
        UalTimeoutError: It was not there in time.
        UalError: As the future ends, or the backend has withdrawn it.

    """
    return wait(future, METHODS[method].limit_s, method)


def answers(stream: Steps[T], method: str) -> Iterator[T]:
    """Yields the results of a stream. Raises as `answer`, for each future."""
    result: object = None
    try:
        while True:
            step = stream.send(result)
            result = None
            if isinstance(step, Future):
                result = answer(step, method)
            elif isinstance(step, Pause):
                time.sleep(step.seconds)
            else:
                yield step
    except StopIteration:
        return
    finally:
        stream.close()
