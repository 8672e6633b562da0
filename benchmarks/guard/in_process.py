"""The cost of setpoints and samples in this process, over that of a plain send by pymavlink."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from benchmarks.guard.costs import Sink, over_pymavlink
from tests.simulators.lockstep import MemoryLink
from tests.simulators.lockstep_crazyflie import SteppedLink
from tests.simulators.memory_transport import MemoryTransport
from tests.work.flights import BACKENDS, Place, flying, free, narrow
from tests.work.served import Served, served
from ual.geometry import Twist, Vector3

_SLOW = (Vector3(0.3, 0.3, 0.0), Vector3(-0.3, -0.3, 0.0))
_TWISTS = tuple(map(Twist, _SLOW))


def setpoint_ratios() -> Iterator[tuple[str, float]]:
    """Yields what `UAL.set_velocity` costs with each backend: where there is room, and in the worst place."""
    yield "class, mavlink-px4, free", _class_ratio("mavlink-px4", free())
    for name in BACKENDS:
        yield f"class, {name}, narrow", _class_ratio(name, narrow(name))


def _class_ratio(name: str, place: Place) -> float:
    with flying(name, place) as uav, Sink() as sink, _sending_to(sink):
        return over_pymavlink(lambda number: uav.set_velocity(_TWISTS[number % 2]), lambda: uav.set_velocity(Twist()))


@contextmanager
def _sending_to(sink: Sink) -> Iterator[None]:
    """What this thread sends to a simulated autopilot goes to the sink instead: what that does with it is no cost of
    ours. Its own thread sends the setpoint again at each update.
    """
    this = threading.current_thread()
    with ExitStack() as stack:
        for kind in (MemoryLink, MemoryTransport, SteppedLink):
            stack.enter_context(patch.object(kind, "send", _diverted(kind.send, this, sink)))
        yield


def _diverted(send: Callable[..., Any], this: threading.Thread, sink: Sink) -> Callable[..., Any]:
    def diverted(link: object, data: Any, **options: Any) -> Any:  # noqa: ANN401  as of each kind of link
        if threading.current_thread() is not this:
            return send(link, data, **options)
        sink.send(data if isinstance(data, bytes) else data.encode())
        return True

    return diverted


def served_ratios() -> Iterator[tuple[str, float]]:
    """Yields what a received setpoint and a sample that is sent cost behind the server."""
    for text, has_all in (("", False), (" with everything", True)):
        for name, make in (("stream", Served.stream), ("call", lambda uav: uav.call)):
            yield f"served {name}{text}", _served_ratio(make, has_all=has_all)
        yield f"served sample{text}", _sample_ratio(has_all=has_all)


def _served_ratio(make: Callable[[Served], Callable[[Vector3], Callable[[], None]]], *, has_all: bool) -> float:
    def fly(uav: Served) -> float:
        ready = make(uav)
        send = [ready(velocity) for velocity in _SLOW]
        return over_pymavlink(lambda number: send[number % 2]())

    with tempfile.TemporaryDirectory() as directory:
        return served(fly, Path(directory), has_all=has_all)


def _sample_ratio(*, has_all: bool) -> float:
    def fly(uav: Served) -> float:
        send = uav.stream()(_SLOW[0])

        def step(number: int) -> None:
            if number % 10 == 0:
                send()
            uav.step()

        return over_pymavlink(step)

    with tempfile.TemporaryDirectory() as directory:
        return served(fly, Path(directory), has_all=has_all)
