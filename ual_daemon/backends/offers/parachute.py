"""Interface of a backend's parachute; see `ual_daemon.services.parachute`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from concurrent.futures import Future
from enum import IntEnum


class ParachuteAction(IntEnum):
    """Order to a parachute, by the numbers of MAVLink (PARACHUTE_ACTION)."""

    DISABLE = 0
    ENABLE = 1
    RELEASE = 2


class ParachuteDriver(ABC):
    """The parachute of one vehicle. From any thread; no method waits."""

    @abstractmethod
    def order(self, action: ParachuteAction) -> Future[None]:
        """Orders it, repeatedly until that is acknowledged.

        The future ends by itself: as done, with a `RejectedByAutopilotError`, a `LinkLostError`, or a
        `NotSupportedError` where there is no parachute. A `UalTimeoutError` says that it is not known whether it was
        obeyed. Cancelling it withdraws the order.
        """
