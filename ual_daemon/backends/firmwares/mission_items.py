"""The lists of items that an autopilot keeps (mission, fence, rally points), as the mission protocol has them.

MAVLink and MAVROS have the same items. https://mavlink.io/en/services/mission.html.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import NamedTuple

from ual.parameters.values import real32


class MissionType(IntEnum):
    """MAV_MISSION_TYPE: which list."""

    MISSION = 0
    FENCE = 1
    RALLY = 2

    @property
    def text(self) -> str:
        """Human-readable."""
        return _TEXTS[self]


_TEXTS = {MissionType.MISSION: "mission", MissionType.FENCE: "fence", MissionType.RALLY: "rally points"}


class MissionItem(NamedTuple):
    """An item: a MAV_CMD, its frame (MAV_FRAME), and its numbers.

    `x` and `y` are latitude and longitude in 1e-7 degrees where the frame is global, `z` is a height in metres.
    `param1` to `param4` and `z` are carried with 32 bits. ArduPilot keeps no `autocontinue`.
    """

    frame: int
    command: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0
    autocontinue: bool = True
    is_current: bool = False


class MissionList(NamedTuple):
    """A list as the autopilot has it. `opaque_id` is its checksum of it; 0 where it tells none, or has no items."""

    items: tuple[MissionItem, ...]
    opaque_id: int = 0


LAST_NAVIGATION = 95
"""MAV_CMD_NAV_LAST: commands up to this one fly somewhere, or hold; those beyond do something on the way."""
JUMP = 177
"""MAV_CMD_DO_JUMP."""
UNSUPPORTED = 3
"""MAV_MISSION_UNSUPPORTED."""

Difference = Callable[[Sequence[MissionItem], Sequence[MissionItem]], str]
"""Says, human-readable, how the list that was read back differs from the one that was sent; empty if it does not."""


def difference(sent: Sequence[MissionItem], found: Sequence[MissionItem], fields: Sequence[str]) -> str:
    """Returns how two lists differ in these fields of their items, human-readable; empty if they do not."""
    if len(sent) != len(found):
        return f"it has {len(found)} items instead of {len(sent)}"
    for seq, (mine, theirs) in enumerate(zip(sent, found, strict=True)):
        for field in fields:
            wanted, kept = _kept(mine, field), _kept(theirs, field)
            if wanted != kept and not (math.isnan(wanted) and math.isnan(kept)):
                return f"item {seq} has {field} {kept:.9g} instead of {wanted:.9g}"
    return ""


FIELDS = ("command", "frame", "param1", "param2", "param3", "param4", "x", "y", "z")
FENCE_FIELDS = ("command", "param1", "x", "y")
"""Fields of a fence's item that both autopilots keep. PX4 gives it another frame back, ArduPilot no height."""
RALLY_FIELDS = ("command", "frame", "x", "y", "z")

_INTEGER_FRAMES = {5: 0, 6: 3, 11: 10}
"""MAV_FRAME_GLOBAL_INT and its kin, which mean the same as those before them. Autopilots give either back."""


def _kept(item: MissionItem, field: str) -> float:
    """Returns a field as an autopilot can keep it."""
    value: float = getattr(item, field)
    if field == "frame":
        return _INTEGER_FRAMES.get(item.frame, item.frame)
    return real32(value) if isinstance(value, float) else float(value)


def refusal_text(result: int) -> str:
    """Returns what a MAV_MISSION_RESULT means, human-readable, with its name."""
    name, text = _RESULTS.get(result, (f"result {result}", "which UAL does not know"))
    return f"{name}: {text}"


_RESULTS = {
    1: ("ERROR", "a failure that it does not name, or it is busy"),
    2: ("UNSUPPORTED_FRAME", "it does not take this frame of coordinates"),
    3: ("UNSUPPORTED", "it does not take this command, or keeps no such list"),
    4: ("NO_SPACE", "it has no room for so many items"),
    5: ("INVALID", "one of the values is invalid"),
    **{5 + number: (f"INVALID_PARAM{number}", f"parameter {number} has an invalid value") for number in range(1, 5)},
    10: ("INVALID_PARAM5_X", "the latitude (x) has an invalid value"),
    11: ("INVALID_PARAM6_Y", "the longitude (y) has an invalid value"),
    12: ("INVALID_PARAM7", "the height (z) has an invalid value"),
    13: ("INVALID_SEQUENCE", "it did not expect an item of this number"),
    14: ("DENIED", "it takes no transfer now, as while it has one with another station"),
    15: ("OPERATION_CANCELLED", "the transfer was cancelled"),
}
"""Of each MAV_MISSION_RESULT its name and what it means."""
