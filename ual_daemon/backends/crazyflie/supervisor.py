"""States of the firmware's supervisor in plain words."""

from __future__ import annotations

from enum import IntFlag


class SupervisorFlags(IntFlag):
    """The bits of ``supervisor.info``."""

    CAN_ARM = 1
    ARMED = 2
    ARMS_ITSELF = 4
    CAN_FLY = 8
    FLYING = 16
    TUMBLED = 32
    LOCKED = 64
    CRASHED = 128


CHARGING, CHARGED, LOW_POWER, SHUTDOWN = 1, 2, 3, 4
"""Of ``pm.state``."""

_LOCKED = "it is locked: switch it off and on again"
_CRASHED = "it has crashed: look at it, set it level, and switch it off and on again"
_TUMBLED = "it is tumbled: set it level"

SEVERE_TROUBLES = frozenset((_LOCKED, _CRASHED, _TUMBLED))
"""Troubles of the aircraft itself, and not of its battery."""


def troubles(info: SupervisorFlags, power_state: int | None) -> tuple[str, ...]:
    """Returns why it cannot fly, in plain words; empty if nothing is known to be wrong."""
    checks = (
        (bool(info & SupervisorFlags.LOCKED), _LOCKED),
        (bool(info & SupervisorFlags.CRASHED), _CRASHED),
        (bool(info & SupervisorFlags.TUMBLED), _TUMBLED),
        (power_state in (CHARGING, CHARGED), "it is charging: take it off the charger"),
        (power_state == LOW_POWER, "its battery is low: charge it"),
        (power_state == SHUTDOWN, "it is switching off"),
    )
    return tuple(words for holds, words in checks if holds)


def why_not_disarm(info: SupervisorFlags, *, is_on_ground: bool) -> str:
    """Returns why it cannot be disarmed; empty if it can. The firmware itself would stop the motors in the air."""
    if not is_on_ground:
        return "it is not on the ground"
    if info & SupervisorFlags.ARMS_ITSELF:
        return "this firmware arms itself (its motors stand still until it takes off)"
    return ""


def why_not_fly(info: SupervisorFlags, power_state: int | None) -> str:
    """Returns why it cannot take off; empty if it can."""
    found = troubles(info, power_state)
    if found:
        return "; ".join(found)
    if not info & SupervisorFlags.ARMED:
        return "it is not armed"
    return "" if info & SupervisorFlags.CAN_FLY else "its supervisor does not let it fly"
