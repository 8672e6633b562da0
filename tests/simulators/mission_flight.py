"""Flight of a simulated autopilot through the items of its mission, by itself. The physics are those of `Autopilot`.

PX4 counts its items from 0 and has no home among them; ArduPilot's item 0 is home.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence

from tests.simulators.physics import Target, Vector
from ual_daemon.backends.firmwares.mission_items import MissionItem

WAYPOINT, LOITER_UNLIMITED, RETURN, LAND, TAKEOFF, DELAY, JUMP, SPEED = 16, 17, 20, 21, 22, 93, 177, 178
NAV_LAST = 95
REACHED_M = 1.0
NONE, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = 1, 2, 3, 4, 5


class MissionFlight:
    """The state of one mission. `first` is the number of its first item.

    Args:
        items: Returns the items as they are kept.
        to_local: Returns the place of an item in the local frame, by its latitude, longitude, height and frame.
        on_reached: Called with the number of each item that was reached.

    """

    def __init__(
        self,
        items: Callable[[], Sequence[MissionItem]],
        first: int,
        to_local: Callable[[MissionItem], Vector],
        on_reached: Callable[[int], None],
    ) -> None:
        self._items, self._first, self._to_local, self._on_reached = items, first, to_local, on_reached
        self.seq = first
        self.state = NONE
        self.speed_m_s: float | None = None
        self.hold: Vector = (0.0, 0.0, 0.0)
        """Position at which it stays while no item leads elsewhere."""
        self.begins_count = 0
        """Times that it was begun since it was new."""
        self._jumps: Counter[int] = Counter()
        self._since_s: float | None = None

    def reset(self) -> None:
        """Begins anew with the next start: another mission was uploaded, or the first item was chosen."""
        self.seq, self.speed_m_s = self._first, None
        self.state = NOT_STARTED if len(self._items()) > self._first else NONE
        self._jumps.clear()
        self.begins_count = 0
        self._since_s = None

    def replaced(self) -> None:
        """Another mission was uploaded. One that is flown goes on in it, with the item of the same number."""
        if self.state == ACTIVE and len(self._items()) > self._first:
            self.seq, self._since_s = min(self.seq, len(self._items()) - 1), None
        else:
            self.reset()

    def choose(self, seq: int) -> bool:
        """Makes an item the current one. Returns whether there is such an item."""
        if not 0 <= seq < len(self._items()):
            return False
        if seq <= self._first or self.state == COMPLETE:
            self.reset()
        self.seq, self._since_s = max(seq, self._first), None
        self.state = ACTIVE if self.state == ACTIVE else NOT_STARTED
        return True

    @property
    def item(self) -> MissionItem | None:
        """The current item that moves it; None where there is none any more."""
        items = self._items()
        return items[self.seq] if self.seq < len(items) else None

    def begin(self, hold: Vector) -> None:
        """The mode of missions was entered, and the vehicle would come to rest there."""
        self._since_s, self.hold = None, hold
        if self.state == COMPLETE:
            self.reset()
        self.state = ACTIVE if len(self._items()) > self._first else NONE
        self.begins_count += 1

    def leave(self) -> None:
        """Another mode was entered."""
        if self.state == ACTIVE:
            self.state = PAUSED

    def target(self, position: Vector, now_s: float, yaw_rad: float) -> Target:
        """Returns where it flies now, and goes on with the next item where one was reached."""
        item = self._moving()
        if item is None or self.state != ACTIVE:
            if self.state == ACTIVE:
                self.state = COMPLETE
            return Target(self.hold, yaw_rad=yaw_rad)
        if item.command == DELAY:
            self._stay(item.param1, now_s)
            return Target(self.hold, yaw_rad=yaw_rad)
        goal = self.hold = self._goal(item, position)
        is_there = self._is_there(item, position, goal)
        if is_there and item.command != LAND:
            self._stay(item.param1 if item.command == WAYPOINT else 0.0, now_s)
        return Target(goal, yaw_rad=yaw_rad)

    def _goal(self, item: MissionItem, position: Vector) -> Vector:
        north, east, down = self._to_local(item)
        if item.command == TAKEOFF:
            return self.hold[0], self.hold[1], min(down, position[2])
        if item.command == LAND:
            return north, east, self.hold[2]
        return north, east, down

    def _is_there(self, item: MissionItem, position: Vector, goal: Vector) -> bool:
        if item.command == TAKEOFF:
            return position[2] <= self._to_local(item)[2] + 0.3
        return math.dist(position, goal) < REACHED_M

    @property
    def is_taking_off(self) -> bool:
        """Whether it climbs in its take-off."""
        return self.state == ACTIVE and self.item is not None and self.item.command == TAKEOFF

    def is_landing(self, position: Vector) -> bool:
        """Returns whether it is over the place where it lands."""
        item = self.item
        if self.state != ACTIVE or item is None or item.command != LAND:
            return False
        north, east, _ = self._to_local(item)
        return math.dist(position[:2], (north, east)) < REACHED_M

    def landed(self) -> None:
        """It has landed at its last item."""
        if self.state == ACTIVE:
            self._on_reached(self.seq)
            self.state = COMPLETE

    def _stay(self, seconds: float, now_s: float) -> None:
        if self._since_s is None:
            self._since_s = now_s
        if now_s - self._since_s >= seconds:
            self._on_reached(self.seq)
            self._go_to(self.seq + 1)

    def _go_to(self, seq: int) -> None:
        self.seq, self._since_s = seq, None

    def _moving(self) -> MissionItem | None:
        """Returns the next item that moves it, after those that act at once."""
        for _ in range(1000):
            item = self.item
            if item is None:
                return None
            if item.command == JUMP:
                if self._jumps[self.seq] < item.param2:
                    self._jumps[self.seq] += 1
                    self._go_to(int(item.param1))
                else:
                    self._go_to(self.seq + 1)
            elif item.command <= NAV_LAST:
                return item
            else:
                if item.command == SPEED:
                    self.speed_m_s = item.param2
                self._go_to(self.seq + 1)
        return None
