"""Joysticks and gamepads in one layout, whatever the device: the one of SDL's game controllers.

    from ual.joystick import Axis, Button, Joysticks

    with Joysticks() as joysticks, joysticks.open() as gamepad:
        while gamepad.is_connected:
            state = gamepad.read()
            print(state.axis(Axis.LEFT_X), Button.A in state.pressed)

SDL knows some hundred devices. For others, a file of the user's says which axis and button is which; `Mapper` makes
one. Needs pygame-ce (the extra ``joystick``), which is imported when `Joysticks` opens.
"""

from ual.joystick._device import Device, Gamepad, Joysticks, RawJoystick
from ual.joystick._errors import JoystickDisconnectedError, JoystickError, MappingError
from ual.joystick._mapper import Mapper, Question
from ual.joystick._mapping import Mapping, mapping_directory
from ual.joystick._state import Axis, Button, GamepadState, RawState

__all__ = [
    "Axis",
    "Button",
    "Device",
    "Gamepad",
    "GamepadState",
    "JoystickDisconnectedError",
    "JoystickError",
    "Joysticks",
    "Mapper",
    "Mapping",
    "MappingError",
    "Question",
    "RawJoystick",
    "RawState",
    "mapping_directory",
]
