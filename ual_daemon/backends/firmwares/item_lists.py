"""The lists that an autopilot keeps, by whatever protocol they are transferred."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import Future

from ual.errors import RejectedByAutopilotError, UalError, UalTimeoutError
from ual_daemon.backends.firmwares.mission_items import Difference, MissionItem, MissionList, MissionType
from ual_daemon.backends.offers.parameters import Refusal

WRITES_COUNT = 3
"""Attempts to send a list that was read back otherwise: late messages of a transfer before may have got into it."""


class ItemLists(ABC):
    """Transfers lists with one autopilot. From any thread; no method waits. Each future ends by itself."""

    @abstractmethod
    def download(self, kind: MissionType) -> Future[MissionList]:
        """Reads a list."""

    @abstractmethod
    def replace(
        self, kind: MissionType, items: Sequence[MissionItem], refusal: Refusal, differs: Difference
    ) -> Future[MissionList]:
        """Has the autopilot keep these items, or none, and reads them back.

        `refusal` is called each time before something is sent that leads to a change, see `AutopilotParameters.write`.
        `differs` says how what was read back differs. The future ends with what was read back, or with an error.
        """


def not_current() -> UalTimeoutError:
    """Returns that the autopilot has not reported an item as its current one, however often it was asked."""
    return UalTimeoutError("the autopilot did not make that item its current one: look where it flies")


def kept_otherwise(kind: MissionType, difference: str, why: str = "") -> RejectedByAutopilotError:
    """Returns that the autopilot keeps another list. `why` is its own answer."""
    tail = f"; {why}" if why else ""
    return RejectedByAutopilotError(
        f"{kind.text}: the autopilot keeps another one: {difference}{tail}", {"list": kind.text}
    )


def not_read_back(error: UalError, kind: MissionType) -> UalError:
    """Returns that a list was sent, but could not be read back."""
    text = f"{error.message}; the {kind.text} was sent, but could not be read back: read what the autopilot has now"
    return type(error)(text, error.metadata)
