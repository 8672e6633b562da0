"""The buttons for several UAVs of a page that flies: what ends their flights, at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import viser

from ual import Uav
from ual.types import State
from ual_tools.view import chosen
from ual_tools.view.command_queue import CommandQueue

_LANDS_ALREADY = (State.LANDED_DISARMED, State.LANDED_ARMED, State.LANDING)


class TeamPanel:
    """The buttons of one page for several UAVs. Each says for which; none is there while one UAV is chosen."""

    def __init__(self, command_queue: CommandQueue) -> None:
        self._command_queue = command_queue
        self._names: tuple[str, ...] = ()
        self._all: tuple[str, ...] = ()

    def build(self, gui: viser.GuiApi) -> None:
        """Adds the buttons to the page."""
        self._buttons = [
            self._add(gui, "Hold", "hold", lambda uav: uav.abort()),
            self._add(gui, "Land", "land", land),
        ]

    def choose(self, found: tuple[str, ...], names: Sequence[str]) -> None:
        """Takes the UAVs that are chosen among all of these."""
        if (found, tuple(names)) == (self._names, self._all):
            return
        self._names, self._all = found, tuple(names)
        for button, what in self._buttons:
            button.visible = len(found) > 1
            button.label = f"{what} {chosen.title(found, names)}"

    def _add(
        self, gui: viser.GuiApi, label: str, what: str, act: Callable[[Uav], object]
    ) -> tuple[viser.GuiButtonHandle, str]:
        button = gui.add_button(label, color="red", visible=False)

        # A coroutine, so that clicks are answered in their order; the command queue gives each call a thread.
        @button.on_click
        async def _(_: object) -> None:
            self._command_queue.run_all(self._names, what, act)

        return button, label


def land(uav: Uav) -> None:
    """Lands a UAV, unless it lands already, or stands on the ground."""
    if uav.state() not in _LANDS_ALREADY:
        uav.land(blocking=False)
