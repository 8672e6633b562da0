"""States of a gamepad and of a raw joystick at one time."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Axis(Enum):
    """An axis of the standard layout, by its name in SDL's mappings. In the order of SDL's numbers."""

    LEFT_X = "leftx"
    LEFT_Y = "lefty"
    RIGHT_X = "rightx"
    RIGHT_Y = "righty"
    LEFT_TRIGGER = "lefttrigger"
    RIGHT_TRIGGER = "righttrigger"

    @property
    def is_trigger(self) -> bool:
        """True if it goes from 0 to 1 only."""
        return self in (Axis.LEFT_TRIGGER, Axis.RIGHT_TRIGGER)


class Button(Enum):
    """A button of the standard layout, by its name in SDL's mappings. In the order of SDL's numbers."""

    A = "a"
    B = "b"
    X = "x"
    Y = "y"
    BACK = "back"
    GUIDE = "guide"
    START = "start"
    LEFT_STICK = "leftstick"
    RIGHT_STICK = "rightstick"
    LEFT_SHOULDER = "leftshoulder"
    RIGHT_SHOULDER = "rightshoulder"
    DPAD_UP = "dpup"
    DPAD_DOWN = "dpdown"
    DPAD_LEFT = "dpleft"
    DPAD_RIGHT = "dpright"


@dataclass(frozen=True)
class GamepadState:
    """The axes and buttons of a gamepad. Sticks go from -1 to 1 (right and down are positive), triggers from 0 to 1."""

    left_x: float = 0.0
    left_y: float = 0.0
    right_x: float = 0.0
    right_y: float = 0.0
    left_trigger: float = 0.0
    right_trigger: float = 0.0
    pressed: frozenset[Button] = frozenset()
    """The buttons that are held."""

    def axis(self, axis: Axis) -> float:
        """Returns where an axis is."""
        value: float = getattr(self, axis.name.lower())
        return value


@dataclass(frozen=True)
class RawState:
    """The axes, buttons and hats of a joystick by their numbers, as the device sends them; axes go from -1 to 1."""

    axes: tuple[float, ...] = ()
    buttons: tuple[bool, ...] = ()
    hats: tuple[tuple[int, int], ...] = ()
    """Each is x (right is 1) and y (up is 1)."""
