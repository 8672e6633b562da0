"""DJI's display modes: the numbers are the same in both SDKs."""

from __future__ import annotations

MANUAL, ATTITUDE, P_GPS, HOTPOINT = 0, 1, 6, 9
ASSISTED_TAKE_OFF, AUTO_TAKE_OFF, AUTO_LANDING, GO_HOME, SDK_CONTROL = 10, 11, 12, 15, 17
FORCED_LANDING, SEARCH, ENGINE_START = 33, 40, 41

NAMES = {
    MANUAL: "MANUAL",
    ATTITUDE: "ATTITUDE",
    P_GPS: "P_GPS",
    HOTPOINT: "HOTPOINT",
    ASSISTED_TAKE_OFF: "ASSISTED_TAKEOFF",
    AUTO_TAKE_OFF: "AUTO_TAKEOFF",
    AUTO_LANDING: "AUTO_LANDING",
    GO_HOME: "GO_HOME",
    SDK_CONTROL: "SDK_CONTROL",
    FORCED_LANDING: "FORCED_LANDING",
    SEARCH: "SEARCH",
    ENGINE_START: "ENGINE_START",
}
TAKING_OFF = frozenset((ASSISTED_TAKE_OFF, AUTO_TAKE_OFF))
LANDING = frozenset((AUTO_LANDING, FORCED_LANDING))

STOPPED, ON_GROUND, IN_AIR = 0, 1, 2
"""Flight status."""


def name(display_mode: int) -> str:
    """Returns the name of a display mode."""
    return NAMES.get(display_mode, f"DISPLAY_MODE_{display_mode}")
