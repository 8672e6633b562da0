"""Begins and ends the parts of SDL that read joysticks, by pygame-ce. Needs no screen and opens no window."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from ual.shared import extras

_MAPPINGS = "SDL_GAMECONTROLLERCONFIG"
_SETTINGS = {
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",
    # SDL would take SIGTERM for an event of a window, and the program would not end.
    "SDL_NO_SIGNAL_HANDLERS": "1",
    # SDL reads joysticks with the events of its video part; "dummy" needs no screen.
    "SDL_VIDEODRIVER": "dummy",
}


class Sdl:
    """SDL's joysticks, from `__init__` to `close`. What the program had begun before it is left as it is.

    Args:
        mappings: Lines in SDL's format, in addition to those that SDL knows. They have an effect only if the program
            has not begun SDL's game controllers by itself.

    """

    def __init__(self, mappings: Sequence[str] = ()) -> None:
        with _environment({**_SETTINGS, _MAPPINGS: "\n".join([*mappings, os.environ.get(_MAPPINGS, "")])}):
            self.pygame = _pygame()
            from pygame._sdl2 import controller

            self.controller = controller
            parts: tuple[Any, ...] = (self.pygame.display, self.pygame.joystick, controller)
            self._begun = [part for part in parts if not part.get_init()]
            self._has_display = self.pygame.display not in self._begun
            for part in self._begun:
                part.init()

    def pump(self) -> None:
        """Reads all joysticks again. Does nothing if the program has a window: its own loop of events does it."""
        if not self._has_display:
            self.pygame.event.clear()

    def close(self) -> None:
        """Ends what was begun here."""
        while self._begun:
            self._begun.pop().quit()


def _pygame() -> Any:  # noqa: ANN401 (a module)
    with extras.needs("a joystick", "ual-client[joystick]"):
        import pygame
        import pygame.joystick
    return pygame


@contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
    """Sets variables that SDL reads when it begins, for the block only. But for the mappings, a user's own are kept."""
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update({name: value for name, value in settings.items() if before[name] is None or name == _MAPPINGS})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
