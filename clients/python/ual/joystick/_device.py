"""The joysticks of this computer: which there are, and what each says."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from typing_extensions import override

from ual.joystick._errors import JoystickDisconnectedError, JoystickError
from ual.joystick._mapping import own_mappings, read_mappings
from ual.joystick._sdl import Sdl
from ual.joystick._state import Axis, Button, GamepadState, RawState

if TYPE_CHECKING:
    from types import TracebackType

    from typing_extensions import Self

_FULL_AXIS_VALUE = 32767
"""SDL's value of a stick at its end; at the other end it is one more."""


@dataclass(frozen=True)
class Device:
    """A joystick that is connected."""

    index: int
    """Its number among those that are connected now."""
    name: str
    guid: str
    """Says which kind of device it is: two of the same kind have the same."""
    is_mapped: bool
    """True if SDL's table or a file of the user's says which axis and button is which."""


class Joysticks:
    """The joysticks of this computer, also those that are connected later.

    One thread at a time may use it and what it opens. SDL sees a device that comes or goes in `list` and in `read`.
    In a program with a pygame window of its own, that program's loop of events does it.

    Args:
        directory: Where the user's mappings are; `mapping_directory` by default.

    Raises:
        MappingError: A file of the user's is no mapping.
        NotSupportedError: pygame-ce is not installed.

    """

    def __init__(self, directory: Path | None = None) -> None:
        self._sdl = Sdl(own_mappings() if directory is None else read_mappings(directory))

    def list(self) -> tuple[Device, ...]:
        """Returns the joysticks that are connected."""
        self._sdl.pump()
        return tuple(self._device(index) for index in range(self._sdl.pygame.joystick.get_count()))

    def find(self, which: int | str | None = None) -> Device:
        """Returns the joystick of a number or of (a part of) a name; by default the only one.

        Raises:
            JoystickError: There is none, or there are several.

        """
        connected = self.list()
        found = [device for device in connected if _is_meant(device, which)]
        if len(found) == 1:
            return found[0]
        if not connected:
            raise JoystickError("no joystick is connected")
        known = ", ".join(f"{device.index} ({device.name})" for device in connected)
        choice = "" if which is None else f"{which!r} is "
        raise JoystickError(f"{choice}{'one of several' if found else 'none of the'} joysticks: choose one of {known}")

    def open(self, which: int | str | None = None) -> Gamepad:
        """Opens a joystick whose axes and buttons are known; see `find`.

        Raises:
            JoystickError: There is none, there are several, or its axes and buttons are not known.

        """
        return self.open_device(self.find(which))

    def open_device(self, device: Device) -> Gamepad:
        """Opens a joystick of the list.

        Raises:
            JoystickError: It is gone, or its axes and buttons are not known.

        """
        if not device.is_mapped:
            raise JoystickError(f"the axes and buttons of {device.name} are not known: ual teleop joystick --map")
        try:
            return Gamepad(self._sdl, device)
        except self._sdl.pygame.error as error:
            raise JoystickError(f"{device.name} cannot be opened: {error}") from None

    def open_raw(self, device: Device) -> RawJoystick:
        """Opens a joystick of the list to read its axes and buttons by their numbers.

        Raises:
            JoystickError: It is gone.

        """
        try:
            return RawJoystick(self._sdl, device)
        except self._sdl.pygame.error as error:
            raise JoystickError(f"{device.name} cannot be opened: {error}") from None

    def close(self) -> None:
        """Closes all. Does nothing the second time."""
        self._sdl.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    def _device(self, index: int) -> Device:
        opened = self._sdl.pygame.joystick.Joystick(index)
        is_mapped = bool(self._sdl.controller.is_controller(index))
        return Device(index, opened.get_name(), opened.get_guid(), is_mapped)


def _is_meant(device: Device, which: int | str | None) -> bool:
    if which is None:
        return True
    return device.index == which if isinstance(which, int) else which.casefold() in device.name.casefold()


class _Opened(ABC):
    """A device that is open."""

    def __init__(self, sdl: Sdl, device: Device) -> None:
        self.device = device
        self._sdl = sdl

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    @property
    def is_connected(self) -> bool:
        """False once its cable was pulled; it stays so, also when the device is back: open it again."""
        self._sdl.pump()
        return self._is_attached()

    @abstractmethod
    def close(self) -> None:
        """Closes the device. It must not be read any more."""

    @abstractmethod
    def _is_attached(self) -> bool:
        pass

    def _require(self) -> None:
        if not self.is_connected:
            raise JoystickDisconnectedError(f"{self.device.name} was disconnected")


class Gamepad(_Opened):
    """A joystick in the standard layout. `Joysticks.open` returns one."""

    def __init__(self, sdl: Sdl, device: Device) -> None:
        super().__init__(sdl, device)
        self._controller = sdl.controller.Controller(device.index)

    def read(self) -> GamepadState:
        """Returns where its axes are and which buttons are held, now.

        Raises:
            JoystickDisconnectedError: It is not connected any more.

        """
        self._require()
        axes = [self._controller.get_axis(number) for number in range(len(Axis))]
        pressed = frozenset(button for number, button in enumerate(Button) if self._controller.get_button(number))
        named = {axis.name.lower(): max(-1.0, value / _FULL_AXIS_VALUE) for axis, value in zip(Axis, axes, strict=True)}
        return GamepadState(**named, pressed=pressed)

    @override
    def close(self) -> None:
        self._controller.quit()

    @override
    def _is_attached(self) -> bool:
        return bool(self._controller.attached())


class RawJoystick(_Opened):
    """A joystick by the numbers of its axes and buttons. `Joysticks.open_raw` returns one."""

    def __init__(self, sdl: Sdl, device: Device) -> None:
        super().__init__(sdl, device)
        self._joystick: Any = sdl.pygame.joystick.Joystick(device.index)

    def read(self) -> RawState:
        """Returns what it says now.

        Raises:
            JoystickDisconnectedError: It is not connected any more.

        """
        self._require()
        read = self._joystick
        return RawState(
            tuple(read.get_axis(number) for number in range(read.get_numaxes())),
            tuple(bool(read.get_button(number)) for number in range(read.get_numbuttons())),
            tuple(read.get_hat(number) for number in range(read.get_numhats())),
        )

    @override
    def close(self) -> None:
        self._joystick.quit()

    @override
    def _is_attached(self) -> bool:
        joystick = self._sdl.pygame.joystick
        present = (joystick.Joystick(index).get_instance_id() for index in range(joystick.get_count()))
        return self._joystick.get_instance_id() in present
