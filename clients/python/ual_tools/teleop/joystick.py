"""Flies by a joystick or gamepad."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

from ual.joystick import Button, Device, Gamepad, GamepadState, JoystickError, Joysticks
from ual_tools.teleop.actions import ENDING, Action
from ual_tools.teleop.keyboard import Decoder
from ual_tools.teleop.layout import Layout
from ual_tools.teleop.pilot import Pilot
from ual_tools.teleop.sticks import CENTRED

_RETRY_S = 1.0
_KEYS = {b" ": Action.STOP, b"q": Action.QUIT, b"\t": Action.NEXT_UAV, b"\x1b[Z": Action.PREVIOUS_UAV}
"""Actions of the terminal's keys beside a joystick."""


class JoystickControls:
    """Controls a pilot by a gamepad, and by some keys of the terminal.

    Nothing flies until all sticks were seen centred and the dead-man's button released: at the start, after a cable was
    pulled, and after the process was suspended. So a stick that jumps when it is connected, or is held meanwhile, does
    nothing.

    Args:
        joysticks: Where the device is looked for again after its cable was pulled.
        device: Which one.
        layout: What its axes and buttons mean.

    Raises:
        JoystickError: It cannot be opened.

    """

    def __init__(self, joysticks: Joysticks, device: Device, layout: Layout) -> None:
        self._joysticks = joysticks
        self._device = device
        self._layout = layout
        self._gamepad: Gamepad | None = joysticks.open_device(device)
        self._tried_s = -math.inf
        self._decoder = Decoder()
        self._before: frozenset[Button] | None = None
        self._has_rested = False

    @property
    def title(self) -> str:
        """Name on the screen."""
        return f"joystick ({self._device.name})"

    @property
    def help(self) -> Sequence[tuple[str, str]]:
        """The buttons, and what each does."""
        layout = self._layout
        held = [] if layout.hold is None else [(layout.hold.value, "hold it to fly")]
        sticks = [(f"{'-' if axis.is_inverted else ''}{axis.axis.value}", name) for name, axis in layout.sticks.items()]
        buttons = [
            ("+".join(sorted(button.value for button in pressed)), action.value)
            for action, pressed in layout.actions.items()
        ]
        return [*held, *sticks, *buttons, ("space", "stop at once"), ("q", "stop and quit")]

    def question(self, now_s: float) -> str:
        """Returns what is to be done before it flies; empty if it flies."""
        if self._gamepad is None:
            return f"{self._device.name} was disconnected: connect it again"
        return "" if self._has_rested else "let go of all sticks and buttons"

    def forget(self) -> None:
        """Forgets what was held."""
        self._before, self._has_rested = None, False

    def control(self, pilot: Pilot, read: bytes, now_s: float, *, is_late: bool) -> None:
        """Does what the gamepad and the keys say. See `ual_tools.teleop.loop.Controls`."""
        for key in self._decoder.keys(read):
            if key in _KEYS and (not is_late or _KEYS[key] in ENDING):
                pilot.act(_KEYS[key])
        if is_late:
            self._has_rested = False
        state = self._read(pilot, now_s)
        if state is None:
            pilot.steer(CENTRED)
            return
        for action in self._begun(state):
            if not is_late or action in ENDING:
                pilot.act(action)
        self._has_rested = self._has_rested or self._layout.is_at_rest(state)
        pilot.steer(self._layout.steered(state) if self._has_rested else CENTRED)

    def close(self) -> None:
        """Closes the device."""
        if self._gamepad is not None:
            self._gamepad.close()

    def _begun(self, state: GamepadState) -> list[Action]:
        """Returns the actions of buttons that were pressed since the last look; those held at first do not count."""
        before, self._before = self._before, state.pressed
        return [] if before is None else self._layout.begun(before, state.pressed)

    def _read(self, pilot: Pilot, now_s: float) -> GamepadState | None:
        if self._gamepad is None:
            self._open_again(now_s)
            return None
        try:
            return self._gamepad.read()
        except JoystickError as error:
            pilot.release(f"sticks: {error}")
            self._gamepad.close()
            self._gamepad = None
            self.forget()
            return None

    def _open_again(self, now_s: float) -> None:
        """Opens the same kind of device, once a second at most."""
        if now_s - self._tried_s < _RETRY_S:
            return
        self._tried_s = now_s
        with suppress(JoystickError):
            for device in self._joysticks.list():
                if device.guid == self._device.guid:
                    self._gamepad = self._joysticks.open_device(device)
                    return
