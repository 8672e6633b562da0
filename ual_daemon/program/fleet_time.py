"""The simulated time of a fleet that several processes fly: a change that one of them is requested happens in all.

A worker sends each change to the supervisor. The supervisor has all workers make the changes in one order, so that
their times stay alike, and tells the worker that asked when all have made it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, TimeoutError  # noqa: A004  (Python 3.10 has two of them)
from dataclasses import dataclass
from itertools import count
from typing import Protocol

from ual.errors import UalError, WrongStateError
from ual.interface import Simulation

ASK, MAKE, MADE = "ask", "make", "made"
"""A worker requests a change; all workers make it; it is made."""
_END_CHECK_S = 1.0
"""Seconds between two looks of a waiting worker whether the fleet ends."""

Tell = Callable[..., None]
"""Sends words to the other process: text, numbers or None."""


class FleetTime:
    """The time of a worker's UAVs, as their simulations offer it. Its members block until all workers have followed."""

    def __init__(self, simulation: Simulation, tell: Tell, is_over: Callable[[], bool]) -> None:
        """`simulation` is that of any UAV of this worker. `tell` reaches the supervisor. `is_over`: it is gone."""
        self._changes: dict[str, Callable[[float], None]] = {
            "speed": simulation.set_speed_factor,
            "step": simulation.step,
        }
        self._tell = tell
        self._is_over = is_over
        self._numbers = count()
        self._requests: dict[int, Future[None]] = {}
        self._errors: dict[int, UalError] = {}
        self._maker = ThreadPoolExecutor(1, "time of the fleet")

    def set_speed_factor(self, speed_factor: float) -> None:
        """Sets how fast the time of the whole fleet runs; see `ual.interface.Simulation`."""
        self._ask("speed", speed_factor)

    def step(self, duration_s: float) -> None:
        """Advances the time of the whole fleet, which stands still; see `ual.interface.Simulation`."""
        self._ask("step", duration_s)

    def _ask(self, kind: str, value: float) -> None:
        number, request = next(self._numbers), Future[None]()
        self._requests[number] = request
        self._tell(ASK, number, kind, value)
        while True:
            try:
                return request.result(_END_CHECK_S)
            except TimeoutError:
                if self._is_over():
                    raise WrongStateError("this fleet ends: the change of its time is not confirmed") from None

    def on_make(self, ticket: int, number: int | None, kind: str, value: float) -> None:
        """Makes a change, on a thread of its own. `number` is that of the request, if this worker has asked."""
        self._maker.submit(self._make, ticket, number, kind, value)

    def _make(self, ticket: int, number: int | None, kind: str, value: float) -> None:
        text = ""
        try:
            self._changes[kind](value)
        except UalError as error:
            text = error.message
            if number is not None:
                self._errors[number] = error
        self._tell(MADE, ticket, text)

    def on_made(self, number: int, text: str) -> None:
        """All workers have made the change; `text` says what one of them refused."""
        request, error = self._requests.pop(number), self._errors.pop(number, None)
        if error is None and text:
            error = WrongStateError(f"another process of this fleet has refused it: {text}")
        request.set_exception(error) if error is not None else request.set_result(None)


class FleetMember(Protocol):
    """A worker, as the supervisor sees it."""

    @property
    def is_running(self) -> bool:
        """Whether it can be reported anything."""

    def tell(self, *words: object) -> None:
        """Sends words to it."""


@dataclass(slots=True)
class _TimeChange:
    """A change in progress: the process that requested it, its number there, and the processes that have yet to make
    it.
    """

    origin: FleetMember
    number: int
    waited_for: list[FleetMember]
    text: str = ""


class Relay:
    """The supervisor's part: hands each change to all workers."""

    def __init__(self, members: Sequence[FleetMember]) -> None:
        self._members = members
        self._tickets = count()
        self._changes: dict[int, _TimeChange] = {}

    def on_ask(self, origin: FleetMember, number: int, kind: str, value: float) -> None:
        """A worker requests a change."""
        ticket, running = next(self._tickets), [each for each in self._members if each.is_running]
        self._changes[ticket] = _TimeChange(origin, number, running)
        for each in running:
            each.tell(MAKE, ticket, number if each is origin else None, kind, value)

    def on_made(self, member: FleetMember, ticket: int, text: str) -> None:
        """A worker has made a change, or refused it: `text`."""
        change = self._changes[ticket]
        change.waited_for.remove(member)
        change.text = change.text or text
        if not change.waited_for:
            del self._changes[ticket]
            change.origin.tell(MADE, change.number, change.text)

    def on_end(self, member: FleetMember) -> None:
        """A worker has ended: nothing more is waited for from it."""
        for ticket, change in list(self._changes.items()):
            if member in change.waited_for:
                self.on_made(member, ticket, "")
