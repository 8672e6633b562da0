"""Troubles of real autopilots in simulation, so that their own failsafes set in: by their parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.transmitter import Transmitter

NEAR_FENCE_M = 8.0


@dataclass(frozen=True)
class Change:
    """A parameter, its value while something is wrong, and its usual one. An `int` is one on the wire, too."""

    name: str
    wrong: float
    usual: float

    def make(self, pilot: Transmitter) -> None:
        _set(pilot, self.name, self.wrong)

    def undo(self, pilot: Transmitter) -> None:
        _set(pilot, self.name, self.usual)


TROUBLES: Mapping[str, Mapping[str, tuple[Change, ...]]] = {
    "PX4": {
        # In flight the simulated battery has less than this after a few seconds.
        "battery failsafe": (Change("BAT_LOW_THR", 0.95, 0.15), Change("BAT_CRIT_THR", 0.9, 0.07)),
        "rc failsafe": (),
        "fence": (Change("GF_MAX_HOR_DIST", NEAR_FENCE_M, 150.0),),
        "position failsafe": (Change("SIM_GPS_USED", 0, 10),),
    },
    "ArduPilot": {
        "battery failsafe": (
            Change("BATT_FS_LOW_ACT", 2.0, 0.0),
            Change("BATT_LOW_TIMER", 1.0, 10.0),
            Change("BATT_LOW_VOLT", 10.5, 0.0),
            Change("SIM_BATT_VOLTAGE", 10.0, 12.6),
        ),
        "rc failsafe": (),
        "fence": (Change("FENCE_RADIUS", NEAR_FENCE_M, 150.0), Change("FENCE_ENABLE", 1.0, 0.0)),
        "position failsafe": (Change("SIM_GPS_DISABLE", 1.0, 0.0),),
    },
}
"""By the autopilot, and by the cause that UAL must name."""
CAUSES = ("battery failsafe", "rc failsafe", "fence")
"""Causes after which the autopilot flies on by itself."""


@contextmanager
def trouble(pilot: Transmitter, autopilot: str, cause: str) -> Iterator[None]:
    """Makes something go wrong, until the end of the block."""
    is_signal_lost = cause == "rc failsafe"
    try:
        with changed(pilot, TROUBLES[autopilot][cause]):
            if is_signal_lost:
                pilot.lose_signal()
            yield
    finally:
        if is_signal_lost:
            pilot.find_signal()
        if autopilot == "ArduPilot" and cause == "battery failsafe":  # it remembers the failsafe
            pilot.order(mavlink.MAV_CMD_BATTERY_RESET, (65535.0, 100.0))


@contextmanager
def changed(pilot: Transmitter, changes: Sequence[Change]) -> Iterator[None]:
    """Changes parameters, until the end of the block."""
    try:
        for change in changes:
            change.make(pilot)
        yield
    finally:
        for change in reversed(changes):
            change.undo(pilot)


def _set(pilot: Transmitter, name: str, value: float) -> None:
    if isinstance(value, int):
        pilot.set_integer(name, value)
    else:
        pilot.set_parameter(name, value)
