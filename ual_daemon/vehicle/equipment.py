"""The orders that are in progress of what a UAV carries: one at a time for each device."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import NamedTuple

from ual.errors import TaskAbortedError, WrongStateError
from ual_daemon import logs
from ual_daemon.backends import futures
from ual_daemon.settings import PayloadSettings

_log = logging.getLogger(__name__)


class PayloadDevice(NamedTuple):
    """A device of the configuration: its kind, such as "gripper", and its name."""

    kind: str
    name: str

    @property
    def text(self) -> str:
        """Human-readable name of the device."""
        return f"the {self.kind} {self.name}"


@dataclass(eq=False)
class _DeviceOrder:
    text: str
    holds: bool
    result: Future[None] = field(default_factory=Future)
    sent: Future[None] = field(default_factory=Future)
    is_over: bool = False


class PayloadEquipment:
    """Payload devices that the UAV carries. From any thread.

    An autopilot's answers do not say which order they are for. So a second order of a device waits for no first one: it
    is refused, or replaces it.
    """

    def __init__(self, settings: PayloadSettings) -> None:
        self.settings = settings
        self._giving = threading.Lock()
        self._lock = threading.Lock()
        self._under_way: dict[PayloadDevice, _DeviceOrder] = {}
        self._ordered: dict[PayloadDevice, str] = {}

    def ordered(self, device: PayloadDevice) -> str:
        """Returns what was ordered last and acknowledged, human-readable; empty: nothing."""
        with self._lock:
            return self._ordered.get(device, "")

    def give(
        self,
        device: PayloadDevice,
        text: str,
        begin: Callable[[], Future[None]],
        *,
        holds: bool,
        require: Callable[[], object],
    ) -> Future[None]:
        """Begins an order, which `text` describes for users. Cancelling the future withdraws it.

        One that `holds` the load replaces the one that is in progress. `require` raises where it may not begin: what
        ends the lease after that withdraws it.

        Raises:
            WrongStateError: Another one is in progress, and this one does not hold.
            UalError: As `require` and `begin`.

        """
        order = _DeviceOrder(text, holds)
        ended: list[_DeviceOrder] = []
        try:
            with self._giving:  # the backend gets the orders of several threads as they are kept here
                require()
                before = self._replace(device, order, holds=holds)
                ended += () if before is None else self._stopped([before])
                self._begin(device, order, begin)
        finally:  # without the lock: a waiter for the end of one may send the next
            for each in ended:
                futures.fail(each.result, TaskAbortedError(f"{each.text} was replaced", {"by": text}))
        return order.result

    def withdraw(self, why: str, metadata: Mapping[str, str]) -> None:
        """Withdraws all orders that may let a load go: they do not leave any more. `why` is human-readable."""
        with self._giving:
            with self._lock:
                under_way = [each for each in self._under_way.values() if not each.holds]
            stopped = self._stopped(under_way)
        for order in stopped:  # without the lock: a waiter for the end of one may send the next
            text = f"{order.text} was withdrawn: {why}; if it has left already, it may still be done"
            futures.fail(order.result, TaskAbortedError(text, metadata))

    def _replace(self, device: PayloadDevice, order: _DeviceOrder, *, holds: bool) -> _DeviceOrder | None:
        with self._lock:
            before = self._under_way.get(device)
            if before is not None and not holds:
                why = f"{before.text} is under way; order it again once that has ended"
                raise WrongStateError(f"{order.text}: {device.text} is busy: {why}", {"needed": "the end of an order"})
            self._under_way[device] = order
        return before

    def _begin(self, device: PayloadDevice, order: _DeviceOrder, begin: Callable[[], Future[None]]) -> None:
        try:
            order.sent = begin()
        except BaseException:
            self._forget(device, order)
            raise
        logs.event(_log, logging.INFO, "payload_ordered", device=device.text, order=order.text)
        order.sent.add_done_callback(lambda _: self._on_end(device, order))
        order.result.add_done_callback(lambda result: order.sent.cancel() if result.cancelled() else None)

    def _on_end(self, device: PayloadDevice, order: _DeviceOrder) -> None:
        is_withdrawn = order.sent.cancelled()
        error = None if is_withdrawn else order.sent.exception()
        if not self._forget(device, order, is_obeyed=error is None and not is_withdrawn):
            return
        if is_withdrawn:
            order.result.cancel()
        else:
            futures.end(order.result, error)

    def _stopped(self, orders: Sequence[_DeviceOrder]) -> list[_DeviceOrder]:
        """Has orders not leave any more. Returns those that had not ended before: their futures are to end."""
        with self._lock:
            stopped = [each for each in orders if not each.is_over]
            for each in stopped:
                each.is_over = True
        for each in orders:
            each.sent.cancel()
        return stopped

    def _forget(self, device: PayloadDevice, order: _DeviceOrder, *, is_obeyed: bool = False) -> bool:
        """Returns whether the order has not ended before."""
        with self._lock:
            is_first, order.is_over = not order.is_over, True
            if is_obeyed:
                self._ordered[device] = order.text
            if self._under_way.get(device) is order:
                del self._under_way[device]
            return is_first
