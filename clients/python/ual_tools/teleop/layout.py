"""Meaning of a gamepad's axes and buttons: from the standard layout to sticks and actions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from ual.joystick import Axis, Button, GamepadState
from ual_tools.teleop.actions import CONFIRMED, Action
from ual_tools.teleop.sticks import CENTRED, Sticks

DEAD_ZONE_DEFLECTION = 0.1
EXPO_SHARE = 0.3
TWO_BUTTONS = CONFIRMED | {Action.LAND}
"""Actions that need two buttons together: one that is touched by accident must not trigger them."""


@dataclass(frozen=True)
class StickAxis:
    """An axis that deflects a stick.

    Within `dead_zone` of its middle (0 to 1) it is centred. `expo` (0 to 1) makes it finer near the middle: the
    deflection is (1 - expo) x + expo x^3 of what is beyond the dead zone.
    """

    axis: Axis
    is_inverted: bool = False
    dead_zone: float = DEAD_ZONE_DEFLECTION
    expo: float = EXPO_SHARE

    def deflection(self, state: GamepadState) -> float:
        """Returns the deflection, -1 to 1."""
        value = state.axis(self.axis)
        beyond = max(0.0, abs(value) - self.dead_zone) / (1.0 - self.dead_zone)
        size = min(1.0, (1.0 - self.expo) * beyond + self.expo * beyond**3)
        return math.copysign(size, -value if self.is_inverted else value) if size else 0.0


def _default_sticks() -> dict[str, StickAxis]:
    axes = {"forward": Axis.RIGHT_Y, "left": Axis.RIGHT_X, "up": Axis.LEFT_Y, "turn": Axis.LEFT_X}
    return {name: StickAxis(axis, is_inverted=True) for name, axis in axes.items()}


def _default_actions() -> dict[Action, frozenset[Button]]:
    both = Button.RIGHT_SHOULDER
    return {
        Action.TAKE_OFF: frozenset((both, Button.Y)),
        Action.LAND: frozenset((both, Button.A)),
        Action.RECOVER: frozenset((both, Button.X)),
        Action.ARM: frozenset((both, Button.START)),
        Action.STOP: frozenset((Button.B,)),
        Action.FASTER: frozenset((Button.DPAD_UP,)),
        Action.SLOWER: frozenset((Button.DPAD_DOWN,)),
        Action.NEXT_UAV: frozenset((Button.DPAD_RIGHT,)),
        Action.PREVIOUS_UAV: frozenset((Button.DPAD_LEFT,)),
        Action.HEADLESS: frozenset((Button.BACK,)),
        Action.MODE: frozenset((Button.START,)),
    }


@dataclass(frozen=True)
class Layout:
    """Layout of a gamepad: the axis of each stick, the buttons of each action, and the dead-man's button: only while it
    is held, the sticks fly. Without one (None) they always do.
    """

    hold: Button | None = Button.LEFT_SHOULDER
    sticks: Mapping[str, StickAxis] = field(default_factory=_default_sticks)
    actions: Mapping[Action, frozenset[Button]] = field(default_factory=_default_actions)

    def is_held(self, state: GamepadState) -> bool:
        """Returns whether the dead-man's button is held."""
        return self.hold is None or self.hold in state.pressed

    def is_at_rest(self, state: GamepadState) -> bool:
        """Returns whether no stick is deflected, and the dead-man's button is not held."""
        return self._deflections(state) == CENTRED and (self.hold is None or self.hold not in state.pressed)

    def steered(self, state: GamepadState) -> Sticks:
        """Returns the deflections: centred while the dead-man's button is not held."""
        return self._deflections(state) if self.is_held(state) else CENTRED

    def begun(self, before: frozenset[Button], pressed: frozenset[Button]) -> list[Action]:
        """Returns the actions whose last button was pressed just now.

        Of actions that share a button, the one with more buttons counts: START alone is not meant with RIGHT SHOULDER.
        """
        complete = {action: buttons for action, buttons in self.actions.items() if buttons <= pressed}
        return [
            action
            for action, buttons in complete.items()
            if not buttons <= before and not any(buttons < other for other in complete.values())
        ]

    def _deflections(self, state: GamepadState) -> Sticks:
        return Sticks(**{name: axis.deflection(state) for name, axis in self.sticks.items()})
