"""The batteries of a vehicle, and the one that its flight depends on. Pure logic."""

from __future__ import annotations

import math

from ual.types import Battery

BATTERY_SILENCE_S = 20.0
"""Seconds without a report after which a battery is gone. PX4 tells of each every 2 s."""
PAYLOAD = "payload"
FUNCTIONS = {1: "all", 2: "propulsion", 3: "avionics", 4: PAYLOAD}
"""Consumers that a battery feeds, by MAV_BATTERY_FUNCTION."""
MOST_BATTERIES = 16
"""Most batteries that are kept."""


class Batteries:
    """Takes the words on each battery, by its id."""

    def __init__(self) -> None:
        self.all: tuple[Battery, ...] = ()
        """Batteries that were reported lately, in the order of their ids."""
        self._reported_s: dict[int, float] = {}
        self._known: dict[int, Battery] = {}

    def on_battery(self, battery: Battery, now_s: float) -> None:
        """Takes the report of one."""
        if battery.id not in self._known and len(self._known) >= MOST_BATTERIES:
            return
        self._known[battery.id], self._reported_s[battery.id] = battery, now_s
        self.drop_silent(now_s)
        self.all = tuple(self._known[each] for each in sorted(self._known))

    def drop_silent(self, now_s: float) -> bool:
        """Drops those that are not reported any more; to be called also while none is. Returns whether any was."""
        silent = [each for each, reported_s in self._reported_s.items() if now_s - reported_s > BATTERY_SILENCE_S]
        for each in silent:
            del self._known[each], self._reported_s[each]
        if silent:
            self.all = tuple(self._known[each] for each in sorted(self._known))
        return bool(silent)

    @property
    def are_several(self) -> bool:
        """Whether the flight may depend on another one than the first."""
        return len(self.all) > 1

    def decisive(self) -> Battery | None:
        """Returns the emptiest of those that feed more than the payload; None while none is known."""
        flying = [each for each in self.all if each.function != PAYLOAD] or self.all
        return min(flying, key=_charge, default=None)


def _charge(battery: Battery) -> tuple[float, float]:
    """Returns how full it is; a voltage counts only among those whose charge is not known."""
    percent, volts = battery.remaining_percent, battery.voltage_v
    return (math.inf if percent is None else percent, math.inf if volts is None else volts)
