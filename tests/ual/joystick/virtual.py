"""SDL's virtual joysticks: devices without hardware, which pygame sees as any other. They live in this process only."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

_JOYSTICK, _GAMEPAD = 0, 1
_SUBSYSTEMS = 0x200 | 0x2000
"""SDL_INIT_JOYSTICK and SDL_INIT_GAMECONTROLLER."""
FULL = 32767


def require_pygame() -> None:
    """Skips the module where pygame-ce is missing."""
    pytest.importorskip("pygame", reason="NO pygame-ce, JOYSTICKS ARE NOT TESTED: pip install pygame-ce")


def _sdl() -> ctypes.CDLL:
    """The library that pygame has loaded: another copy would have other devices."""
    import pygame  # noqa: F401 (loads SDL)

    files = re.findall(r"/\S*libSDL2-2\S*", Path("/proc/self/maps").read_text(encoding="utf-8"))
    library = ctypes.CDLL(files[0])
    library.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p
    return library


class VirtualDevice:
    """A connected virtual joystick: of SDL's kind "game controller", which SDL maps by itself, or an unknown one."""

    def __init__(self, *, is_gamepad: bool = True, axes: int = 6, buttons: int = 15, hats: int = 0) -> None:
        self._sdl = _sdl()
        kind = _GAMEPAD if is_gamepad else _JOYSTICK
        index = self._sdl.SDL_JoystickAttachVirtual(kind, axes, buttons, hats)
        assert index >= 0
        self._sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
        self._handle = ctypes.c_void_p(self._sdl.SDL_JoystickOpen(index))
        self._instance = self._sdl.SDL_JoystickInstanceID(self._handle)

    def axis(self, number: int, value: float) -> None:
        self._sdl.SDL_JoystickSetVirtualAxis(self._handle, number, ctypes.c_int16(round(value * FULL)))

    def button(self, number: int, is_held: bool) -> None:
        self._sdl.SDL_JoystickSetVirtualButton(self._handle, number, ctypes.c_uint8(is_held))

    def hat(self, number: int, direction: int) -> None:
        self._sdl.SDL_JoystickSetVirtualHat(self._handle, number, ctypes.c_uint8(direction))

    def pull(self) -> None:
        """Disconnects it."""
        for index in range(self._sdl.SDL_NumJoysticks()):
            if self._sdl.SDL_JoystickGetDeviceInstanceID(index) == self._instance:
                self._sdl.SDL_JoystickDetachVirtual(index)
                return


@contextmanager
def virtual_devices() -> Iterator[Callable[..., VirtualDevice]]:
    """Connects devices, which stay until the end of the block although a program ends its part of SDL."""
    sdl = _sdl()
    assert sdl.SDL_InitSubSystem(_SUBSYSTEMS) == 0
    try:
        yield VirtualDevice
    finally:
        # One that stayed would be the first that the next test finds, if somebody still has this part of SDL.
        for index in reversed(range(sdl.SDL_NumJoysticks())):
            if sdl.SDL_JoystickIsVirtual(index):
                sdl.SDL_JoystickDetachVirtual(index)
        sdl.SDL_QuitSubSystem(_SUBSYSTEMS)
