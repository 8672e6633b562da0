"""What a mission would be, by a dry run; and how far the autopilot is with its mission."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ual.missions.items import Item


@dataclass(frozen=True, slots=True)
class MissionPlan:
    """What a mission would be.

    Attributes:
        length_m: The way, with what jumps repeat. None where it is not known where the UAV is.
        duration_s: How long it takes in calm air, as if it stopped at each waypoint. A return to launch and a landing
            are the autopilot's, and are counted at the speeds known of it.
        lowest_m: The lowest altitude of its waypoints above the ground of the take-off.
        highest_m: The highest one.
        executed_count: How many items are executed, with those that jumps repeat.

    """

    length_m: float
    duration_s: float
    lowest_m: float
    highest_m: float
    executed_count: int


@dataclass(frozen=True, slots=True)
class StoredMission:
    """The mission that the autopilot has. `digest` is the same for the same mission; empty where there is none."""

    items: tuple[Item, ...]
    digest: str = ""


class LinkLossAction(Enum):
    """What the autopilot is to do by itself in a mission, once the link to its ground station is lost."""

    CONTINUE = 1
    RETURN = 2
    LAND = 3


class MissionStage(Enum):
    """How far the autopilot is with its mission, by its own words."""

    UNKNOWN = 0
    NONE = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


@dataclass(frozen=True, slots=True)
class MissionProgress:
    """How far the autopilot is with its mission, whoever has started it.

    Attributes:
        stage: By the autopilot's own words.
        item: The item that it flies to, counted from 1; None where it does not say.
        reached: The item that it reached last; None where none was since it is heard.
        task_id: The task of UAL that flies it; empty where it is none of UAL.

    """

    stage: MissionStage
    item: int | None = None
    reached: int | None = None
    task_id: str = ""
