"""Interface of a backend for missions that the autopilot flies by itself.

See `ual_daemon.services.missions`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import NamedTuple

from ual.missions.items import Item
from ual.missions.plan import LinkLossAction, MissionStage
from ual_daemon.backends.offers.parameters import Refusal

UNCHANGED = "unchanged"
"""Metadata of a `RejectedByAutopilotError` after which the autopilot has the list that it had before."""


class KeptMission(NamedTuple):
    """The mission that the autopilot has, as it was read from it. `digest` is the same for the same mission.

    `mission_id` is the autopilot's own checksum of it; 0 where it tells none.
    """

    items: tuple[Item, ...]
    digest: str
    mission_id: int = 0


@dataclass(frozen=True, slots=True)
class MissionReport:
    """Report of the autopilot about its mission, newest values.

    Attributes:
        stage: How far it is.
        item: The item that it flies to, or executes, counted from 1; None while that is not known.
        reached: The item that it reached last, counted from 1, also in a flight of its mission before; None if none was
            since it is received.
        time_s: When it was received last.
        mission_id: Its own checksum of the mission; 0 where it tells none.
        reached_s: Time of the report on what it reached last.
        changes: What else of it changes with the mission, such as its number of items: compared, and not read.
    """

    stage: MissionStage
    item: int | None
    reached: int | None
    time_s: float
    mission_id: int = 0
    reached_s: float = -math.inf
    changes: tuple[int, ...] = ()


class OnItsOwn(NamedTuple):
    """Actions of the autopilot by itself in a mission, by its parameters.

    Attributes:
        link_loss: What it does once its ground station is lost; None for something else.
        link_loss_text: The same, human-readable, with the names of the parameters.
        begins_anew: Why it begins with the first item whenever it enters the mode of missions; empty if it goes on.
    """

    link_loss: LinkLossAction | None
    link_loss_text: str
    begins_anew: str = ""


class AutopilotMissions(ABC):
    """The missions of one autopilot. From any thread; no method waits.

    Each future ends by itself, also where nothing answers: with a `LinkLostError`, or with a `UalTimeoutError`.
    """

    @property
    @abstractmethod
    def mode(self) -> str:
        """The name of the mode in which it flies its mission."""

    @property
    @abstractmethod
    def return_mode(self) -> str:
        """The name of the mode to which a `ReturnManoeuvre` leads; that of the mission where it stays in it."""

    @property
    @abstractmethod
    def pause_mode(self) -> str:
        """The name of the mode to which `Backend.hold` leads."""

    @property
    @abstractmethod
    def done_mode(self) -> str:
        """The name of the mode in which it holds its position after a mission; that of the mission where it stays."""

    @property
    def keeps_parts(self) -> bool:
        """Whether an upload that is cut off may leave a part of it on the autopilot, instead of what was there."""
        return True

    @abstractmethod
    def require(self, items: Sequence[Item]) -> None:
        """Checks that the autopilot would execute all items as they stand.

        Raises:
            InvalidArgumentError: It would ignore one, or read it otherwise; the item is named.
            LinkLostError: It is not known which autopilot it is.
            NotSupportedError: UAL uploads no missions to this one.

        """

    @abstractmethod
    def upload(self, items: Sequence[Item], refusal: Refusal) -> Future[KeptMission]:
        """Uploads a mission and reads it back; see `AutopilotParameters.write` for `refusal`.

        The future ends with a `RejectedByAutopilotError` where the autopilot keeps another one.
        """

    @abstractmethod
    def download(self) -> Future[KeptMission]:
        """Reads the mission."""

    @abstractmethod
    def clear(self, refusal: Refusal) -> Future[KeptMission]:
        """Removes the mission. The future ends once it was read back that there is none."""

    @abstractmethod
    def report(self) -> MissionReport | None:
        """Returns the newest of its reports on its mission; None while there is none."""

    @abstractmethod
    def set_current(self, items: Sequence[Item], item: int, refusal: Refusal, *, anew: bool) -> Future[None]:
        """Makes an item, counted from 1, the next one to fly.

        `items` is the mission that the autopilot has. `anew`: it also begins to count its jumps again. `refusal`: see
        `AutopilotParameters.write`. While it returns an `UndecidedError`, nothing is sent, and it is called again.

        The future ends once the autopilot says that it is the current one.
        """

    @abstractmethod
    def fly(self) -> Future[None]:
        """Commands the mode in which it flies its mission. Never arms. Ends as a command of `Backend`."""

    @abstractmethod
    def on_its_own(self) -> Future[OnItsOwn]:
        """Reads what it does by itself in a mission, by its parameters. They are never written."""
