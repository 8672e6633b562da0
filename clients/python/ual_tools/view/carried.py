"""Lines of the panel about grippers, winches, servos and relays of a UAV."""

from __future__ import annotations

from ual.errors import NotSupportedError, UalError
from ual.gripper import Equipment
from ual.interface import Gripper
from ual_tools.gripper import rows

_EQUIPMENT_CHECK_S = 2.0
"""States are asked of the autopilot, over its link."""


class PayloadBoard:
    """Asks while a page shows it. One thread asks, and another one may read `rows`."""

    def __init__(self) -> None:
        self.rows: tuple[tuple[str, str], ...] = ()
        """The name of each device, and its state; empty where nothing is carried, or no page shows it."""
        self._due_s = 0.0
        self._is_empty = False

    def poll(self, gripper: Gripper, now_s: float, *, is_wanted: bool) -> None:
        """Asks for the states, if they are wanted and due. Where nothing is carried it asks once."""
        if self._is_empty:
            return
        if not is_wanted:
            self.rows, self._due_s = (), now_s  # what was seen then is not the present when it is shown again
        elif now_s >= self._due_s:
            self._due_s = now_s + _EQUIPMENT_CHECK_S
            self.rows = self._ask(gripper)

    def _ask(self, gripper: Gripper) -> tuple[tuple[str, str], ...]:
        try:
            found = gripper.get_all()
        except NotSupportedError:  # by this backend: so it stays
            self._is_empty = True
            return ()
        except UalError as error:
            return (("carries", f"unknown: {error.message}"),)
        self._is_empty = found == Equipment()  # a daemon reads its configuration once
        return tuple((f"{kind} {name}", _text(*values)) for kind, name, *values in rows(found))


def _text(state: str, ordered: str, note: str) -> str:
    return "; ".join(filter(None, (state, ordered and f"ordered: {ordered}", note)))
