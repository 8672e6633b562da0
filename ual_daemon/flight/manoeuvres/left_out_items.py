"""Items of a mission that were left out by a jump that was not UAL's: such a mission was not flown to its end."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence

from ual.missions.items import PLACED, Item, Jump
from ual.types import AltitudeReference
from ual_daemon.backends.offers.missions import MissionReport
from ual_daemon.backends.values import Snapshot
from ual_daemon.geodesy import FlatProjection

_LONGEST_REPORT_GAP_S = 1.5
"""Between two reports that follow each other in time. What was flown in a longer gap is not known."""
_MOST_JUMPS = 8
"""Jumps of UAL that may wait until they are reported."""
_ITEM_DISTANCE_M = 3.0
"""Distance in metres at which a place is reached, by both autopilots' radius of 2 m. One so near the one before may not
be reported.
"""


class LeftOutItems:
    """Follows which item the autopilot tells. Items are counted from 1. Belongs to the thread of the updates."""

    def __init__(self, items: Sequence[Item]) -> None:
        self._items = items
        self._jumps_by_itself = any(isinstance(each, Jump) for each in items)
        self._told: tuple[int, float] | None = None
        """The item that was reported last, and when."""
        self._lock = threading.Lock()
        self._own: tuple[int, ...] = ()
        """The items to which UAL has jumped, the last one last, until they or later ones are reported."""
        self._left_out: set[int | None] = set()
        self._nearest_m = math.inf
        """Least distance in metres from the item that was reported last; 0 where that is not known."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the items that were left out and not flown since."""
        return tuple(sorted(each for each in self._left_out if each is not None))

    def jumps_to(self, item: int) -> None:
        """Notes that UAL jumps to an item: those before it are left out on purpose. From any thread."""
        with self._lock:
            self._own = (*self._own, item)[-_MOST_JUMPS:]

    def forget(self) -> None:
        """Begins again with the next report: the mission was not flown, or not seen, for a while."""
        if self._told is not None:
            self._told, self._nearest_m = None, 0.0

    def step(self, report: MissionReport, snapshot: Snapshot) -> None:
        """Takes what the autopilot tells while it flies the mission, and where it is."""
        before = self._told
        if report.item is None or (before is not None and report.time_s < before[1]):
            return
        item = min(report.item, len(self._items))  # ArduPilot tells one more at its end
        self._told = (item, report.time_s)
        if before is None or before[0] == item:
            self._nearest_m = min(self._nearest_m, self._away_m(item, snapshot))
        elif self._take_own(item):
            pass
        elif report.time_s - before[1] <= _LONGEST_REPORT_GAP_S and not self._jumps_by_itself:
            begin = before[0] + (self._nearest_m <= _ITEM_DISTANCE_M)
            self._left_out.update(number for number in range(begin, item) if self._is_destination(number))
        if before is not None and before[0] != item:
            self._nearest_m = self._away_m(item, snapshot)
        self._left_out -= {item, report.reached}

    def _away_m(self, number: int, snapshot: Snapshot) -> float:
        """Returns how far it is from the place of an item; 0 where that is not known."""
        item, here = self._items[number - 1], snapshot.position_geo()
        pose, home, place = snapshot.motion.pose, snapshot.earth.home, _position(item)
        if place is None or here is None:
            return 0.0
        aside = FlatProjection(*place).to_local(here.latitude_deg, here.longitude_deg, place[2])
        is_above_home = getattr(item, "altitude_reference", None) is AltitudeReference.HOME
        up_m = 0.0
        if is_above_home and pose is not None and home is not None:
            up_m = pose.value.position.z - home.z - place[2]
        return math.hypot(aside.x, aside.y, up_m)

    def _take_own(self, told: int) -> bool:
        """Returns whether what is reported is that of a jump of UAL; the jumps before it are over, too."""
        with self._lock:
            for index, own in reversed(tuple(enumerate(self._own))):
                if self._is_own(told, own):
                    self._own = self._own[index + 1 :]
                    return True
        return False

    def _is_own(self, told: int, own: int) -> bool:
        """Returns whether what is reported is that of UAL's jump: an item that does not fly is reported as the one
        after it.
        """
        return own <= told and not any(isinstance(each, PLACED) for each in self._items[own - 1 : told - 1])

    def _is_destination(self, number: int) -> bool:
        """Returns whether an item leads to a place that takes time to fly to."""
        item = self._items[number - 1]
        if not isinstance(item, PLACED):
            return False
        before = next((each for each in reversed(self._items[: number - 1]) if isinstance(each, PLACED)), None)
        here, there = _position(before), _position(item)
        if here is None or there is None:
            return True
        return (FlatProjection(*here).to_local(*there)).norm() > _ITEM_DISTANCE_M


def _position(item: Item | None) -> tuple[float, float, float] | None:
    if not isinstance(item, PLACED) or item.latitude_deg is None or item.longitude_deg is None:
        return None
    return item.latitude_deg, item.longitude_deg, getattr(item, "altitude_m", None) or 0.0
