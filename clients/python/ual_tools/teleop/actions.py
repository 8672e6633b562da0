"""Actions of keys and buttons, apart from the sticks."""

from __future__ import annotations

from enum import Enum


class Action(Enum):
    """One press of a key or button. The device requests a confirmation before it gives one of `CONFIRMED`."""

    TAKE_OFF = "take-off"
    LAND = "land"
    ABORT = "abort"
    """Cancels the running task, brakes and holds. The same command as `STOP`, under the name that menus give it."""
    STOP = "stop"
    RECOVER = "recover"
    ARM = "arm"
    FASTER = "faster"
    SLOWER = "slower"
    HEADLESS = "headless on or off"
    MODE = "velocity or pose"
    NEXT_UAV = "next UAV"
    PREVIOUS_UAV = "previous UAV"
    QUIT = "quit"


CONFIRMED = frozenset({Action.TAKE_OFF, Action.RECOVER, Action.ARM})
"""Actions that move a UAV that stood, or take it from its safety pilot: one press must not be enough."""
ENDING = frozenset({Action.STOP, Action.ABORT, Action.LAND, Action.QUIT})
"""Actions that only end a motion: they also count when they were pressed a while ago."""
