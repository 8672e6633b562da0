"""Lists and mission of the autopilot, as MAVROS publishes them. Belongs to the link's thread.

``mission/waypoints`` and its kin come when a list was transferred, and when the autopilot has another current item.
They have no time, and are sent again to each new subscriber.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from typing import NamedTuple

from ual.missions.plan import MissionStage
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.listed_missions import ReceivedMission
from ual_daemon.backends.firmwares.mission_items import JUMP, LAST_NAVIGATION, MissionItem, MissionType
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.fields import number

_E7_PER_DEG = 1e7
_GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})


class ReceivedList(NamedTuple):
    """A list as it came, and how many have come of its topic."""

    items: tuple[MissionItem, ...] = ()
    messages_count: int = 0


class MissionTopics:
    """The newest of each list, and of the mission. `heard` is for any thread."""

    def __init__(self, autopilot: Autopilot) -> None:
        codec = autopilot.missions
        self._stays_in_mode = codec is not None and codec.done_mode == codec.mode
        self.lists = dict.fromkeys(MissionType, ReceivedList())
        self.heard: ReceivedMission | None = None

    @property
    def handlers(self) -> dict[str, Callable[[Message, float], None]]:
        """Handler of each topic's messages."""
        return {
            topics.MISSION: self._on_mission,
            topics.FENCE: lambda message, _: self._keep(MissionType.FENCE, message),
            topics.RALLY: lambda message, _: self._keep(MissionType.RALLY, message),
            topics.REACHED: self._on_reached,
        }

    def discard(self) -> None:
        """Forgets what it has reported of its mission: it has booted."""
        self.heard = None

    def _on_mission(self, message: Message, now_s: float) -> None:
        self._keep(MissionType.MISSION, message)
        seq = int(message["current_seq"])
        reached, reached_s = (None, -math.inf) if self.heard is None else (self.heard.reached, self.heard.reached_s)
        if self._stays_in_mode and reached is not None and seq < reached:
            reached = None  # it flies there again
        changes = (self._mark(),)
        self.heard = ReceivedMission(MissionStage.UNKNOWN, seq, now_s, 0, reached, reached_s, changes)

    def _on_reached(self, message: Message, now_s: float) -> None:
        if self.heard is None:
            return
        reached = int(message["wp_seq"])
        stage = MissionStage.COMPLETE if self._is_last(reached) else MissionStage.UNKNOWN
        self.heard = ReceivedMission(stage, self.heard.seq, now_s, 0, reached, now_s, self.heard.changes)

    def _mark(self) -> int:
        """Returns a mark of the list as MAVROS has read it, which it does after each transfer that it sees."""
        items = [each._replace(is_current=False) for each in self.lists[MissionType.MISSION].items]
        return zlib.crc32(repr(items).encode())

    def _is_last(self, reached: int) -> bool:
        """Returns whether the mission is over with an item. ArduPilot stays in its mode then, and MAVROS passes no end
        on.
        """
        items = self.lists[MissionType.MISSION].items
        last = max((seq for seq, each in enumerate(items) if each.command <= LAST_NAVIGATION), default=math.inf)
        goes_back = any(each.command == JUMP for each in items[reached:])
        return self._stays_in_mode and reached >= last and not goes_back

    def _keep(self, kind: MissionType, message: Message) -> None:
        items = tuple(map(item_of, message["waypoints"]))
        self.lists[kind] = ReceivedList(items, self.lists[kind].messages_count + 1)


def item_of(message: Message) -> MissionItem:
    """Returns the item of a Waypoint, whose coordinates MAVROS has made of integers."""
    frame = int(message["frame"])
    factor = _E7_PER_DEG if frame in _GLOBAL_FRAMES else 1.0
    param1, param2, param3, param4 = (number(message[f"param{index}"]) for index in range(1, 5))
    return MissionItem(
        frame,
        int(message["command"]),
        param1,
        param2,
        param3,
        param4,
        round(number(message["x_lat"]) * factor),
        round(number(message["y_long"]) * factor),
        number(message["z_alt"]),
        bool(message["autocontinue"]),
        bool(message["is_current"]),
    )


def waypoint_of(item: MissionItem) -> Message:
    """Returns the Waypoint of an item. MAVROS cuts off what is beyond an integer, so half of one is added."""
    factor = _E7_PER_DEG if item.frame in _GLOBAL_FRAMES else 1.0
    x, y = (math.copysign(abs(each) + 0.5, each) / factor if each else 0.0 for each in (item.x, item.y))
    return {
        "frame": item.frame,
        "command": int(item.command),
        "is_current": item.is_current,
        "autocontinue": item.autocontinue,
        **{f"param{index}": float(value) for index, value in enumerate(item[2:6], 1)},
        "x_lat": x,
        "y_long": y,
        "z_alt": float(item.z),
    }
