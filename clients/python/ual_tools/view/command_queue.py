"""Gives the orders of one page to the UAVs. A motion is asked about first (a dry run), and begins when it is confirmed.

Each call has a thread of its own, in bounded number: an abort never waits for another call.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ual import Uav
from ual.errors import DaemonUnreachableError, UalError
from ual.shared.guard import WorkGuard
from ual_tools.output import error_text
from ual_tools.view.fleet import PageFleet, PageMember
from ual_tools.view.journal import Journal
from ual_tools.view.orders import Order

_MOST_ASKED, _MOST_RUN = 4, 32
"""Most orders of a page that may wait for their answers: questions, and commands."""
_VALID_S = 30.0
"""A proposal that is older is asked again: the UAV may have moved."""


@dataclass(frozen=True)
class Proposal:
    """An order that a UAV would accept, until `valid_until_s` (monotonic)."""

    ns: str
    order: Order
    answer: str
    valid_until_s: float

    @property
    def text(self) -> str:
        """Human-readable effect of the order."""
        return f"{self.ns}: {self.order.what}: {self.answer}"


class CommandQueue:
    """Orders of one page's operator.

    `proposal` is what waits to be confirmed. `said` is how the last order went; `count` changes with both.
    """

    def __init__(self, fleet: PageFleet, journal: Journal) -> None:
        self.proposal: Proposal | None = None
        self.said = ""
        self.count = 0
        self._fleet = fleet
        self._journal = journal
        self._guard = WorkGuard("orders of a page")
        self._lock = threading.Lock()
        self._asked = 0
        self._asking = threading.BoundedSemaphore(_MOST_ASKED)
        self._running = threading.BoundedSemaphore(_MOST_RUN)

    def propose(self, ns: str, order: Order) -> None:
        """Asks whether a UAV would accept an order. What was proposed before is withdrawn."""
        number = self._withdraw("")

        def ask(uav: Uav) -> None:
            answer = order.ask(uav)
            self._offer(number, Proposal(ns, order, answer, time.monotonic() + _VALID_S))

        self._start(ns, order.what, ask, self._asking)

    def confirm(self, proposal: Proposal) -> None:
        """Begins what was proposed, unless it is not the present proposal any more."""
        with self._lock:
            is_present = self.proposal is proposal and time.monotonic() < proposal.valid_until_s
        self._withdraw("" if is_present else f"{proposal.text}: too late, ask again")
        if is_present:
            self._start(proposal.ns, proposal.order.what, lambda uav: self._begin(proposal, uav), self._running)

    def withdraw(self) -> None:
        """Withdraws the proposal."""
        self._withdraw("")

    def tidy(self, now_s: float) -> None:
        """Withdraws a proposal that is too old."""
        proposal = self.proposal
        if proposal is not None and now_s >= proposal.valid_until_s:
            self._withdraw(f"{proposal.text}: too old, ask again")

    def run(self, ns: str, what: str, act: Callable[[Uav], object]) -> None:
        """Does something at once: what stops a flight, or what is no flight."""

        def do(uav: Uav) -> None:
            act(uav)
            self._report(ns, f"{what}: done")

        self._start(ns, what, do, self._running)

    def run_all(self, names: Sequence[str], what: str, act: Callable[[Uav], object]) -> None:
        """Does something with several UAVs at once: what stops a flight. Each has a thread of its own."""
        report = _TeamReport(what, len(names))

        def do(ns: str) -> None:
            why = ""
            try:
                act(self._member(ns).uav)
            except UalError as error:
                self._journal.refused(ns, what, error, time.time())
                why = error_text(error)
            except Exception as error:  # noqa: BLE001  as in `_do`
                self._guard.note(error)
                why = self._guard.last_cause
            self._say(report.add(ns, why))

        for ns in names:
            threading.Thread(target=do, args=(ns,), name=f"ual view {ns}", daemon=True).start()

    def _begin(self, proposal: Proposal, uav: Uav) -> None:
        task = proposal.order.begin(uav)
        if task is not None:  # it may end before any sample of the telemetry has it
            self._member(proposal.ns).running[task.id] = None
        self._report(proposal.ns, f"{proposal.order.what}: {'accepted' if task is not None else 'done'}")

    def _start(self, ns: str, what: str, do: Callable[[Uav], None], free: threading.Semaphore) -> None:
        if not free.acquire(blocking=False):
            self._say(f"{ns}: {what}: NOT SENT: too many orders of this page wait for an answer")
            return
        threading.Thread(target=self._do, args=(ns, what, do, free), name=f"ual view {ns}", daemon=True).start()

    def _do(self, ns: str, what: str, do: Callable[[Uav], None], free: threading.Semaphore) -> None:
        try:
            do(self._member(ns).uav)
        except UalError as error:
            self._journal.refused(ns, what, error, time.time())
            self._say(f"{ns}: {what}: REFUSED: {error_text(error)}")
        except Exception as error:  # noqa: BLE001  the operator must see how it ended
            self._guard.note(error)
            self._say(f"{ns}: {what}: FAILED: {self._guard.last_cause}")
        finally:
            free.release()

    def _member(self, ns: str) -> PageMember:
        member = self._fleet.members().get(ns)
        if member is None:
            raise DaemonUnreachableError(f"{ns} is not connected")
        return member

    def _report(self, ns: str, text: str) -> None:
        self._journal.write(ns, text, time.time())
        self._say(f"{ns}: {text}")

    def _say(self, text: str) -> None:
        with self._lock:
            self.said, self.count = text, self.count + 1

    def _offer(self, number: int, proposal: Proposal) -> None:
        with self._lock:
            if number == self._asked:  # else something else was asked meanwhile
                self.proposal, self.said, self.count = proposal, "", self.count + 1

    def _withdraw(self, text: str) -> int:
        with self._lock:
            self.proposal, self.said, self.count = None, text, self.count + 1
            self._asked += 1
            return self._asked


class _TeamReport:
    """Report of an order to several UAVs."""

    def __init__(self, what: str, count: int) -> None:
        self._what = what
        self._count = count
        self._done = 0
        self._refused: dict[str, str] = {}
        self._lock = threading.Lock()

    def add(self, ns: str, why_not: str) -> str:
        """Takes note of an answer, and returns how it goes."""
        with self._lock:
            if why_not:
                self._refused[ns] = why_not
            else:
                self._done += 1
            refused = "; ".join(f"{name}: {why}" for name, why in self._refused.items())
            return f"{self._what}: {self._done} of {self._count} done{f'; REFUSED: {refused}' if refused else ''}"
