"""Missions that the autopilot flies by itself, also where the link or the daemon is lost.

As values, from ``mission.proto``. ``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ual.missions.items import Item


class LinkLossAction(Enum):
    """Action of the autopilot by itself in a mission, once the link to its ground station is lost."""

    CONTINUE = 1
    RETURN = 2
    LAND = 3


class MissionStage(Enum):
    """Stage of the autopilot's mission, by its own report."""

    UNKNOWN = 0
    NONE = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


@dataclass(frozen=True, slots=True)
class MissionPlan:
    """Plan of a mission.

    Args:
        length_m: The path, including what jumps repeat.
        duration_s: In calm air, as if it stopped at each waypoint. A return to launch and a landing are the
            autopilot's, and are counted at the speeds known of it.
        lowest_m: The lowest altitude of its places above the ground of the take-off.
        highest_m: The highest one.
        executed_count: The number of items that are executed, with those that jumps repeat.

    """

    length_m: float
    duration_s: float
    lowest_m: float
    highest_m: float
    executed_count: int


@dataclass(frozen=True, slots=True)
class StoredMission:
    """The mission that an autopilot has.

    Args:
        items: Its items, in order.
        digest: The same for the same mission. Empty where there is none.

    """

    items: tuple[Item, ...]
    digest: str = ""


@dataclass(frozen=True, slots=True)
class MissionProgress:
    """Progress of the autopilot's mission, whichever program has started it.

    Args:
        stage: By the autopilot's own words.
        item: The item that it flies to, counted from 1; None where it does not say.
        reached: The item that it reached last; None where the daemon has received none.
        task_id: The task of UAL that flies it; empty where it is none of UAL.

    """

    stage: MissionStage
    item: int | None = None
    reached: int | None = None
    task_id: str = ""
