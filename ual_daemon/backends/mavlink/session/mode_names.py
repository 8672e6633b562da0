"""Names by the autopilot of modes without a name here: those that other programs and scripts add. Pure logic."""

from __future__ import annotations

import math
from dataclasses import replace

from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.values import Mode

REQUEST_S = 2.0
MOST_REQUESTS = 5
"""Most requests for the names, at this interval: an older autopilot has none."""
MOST_NAMES = 64
LONGEST_NAME_CHARACTERS = 35
"""As AVAILABLE_MODES has it."""


class ModeNames:
    """Makes modes of the autopilot's numbers, with its own names for those of other programs.

    The names are requested once the vehicle is in such a mode, and again when they change. While PX4 tells all its
    modes over a slow link, it sends nothing else there for up to 2.5 s.
    """

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._names: dict[int, str] = {}
        self._wanted: int | None = None
        """The number of the mode whose name is not known."""
        self._version: int | None = None
        self._requests_count = 0
        self._next_s = -math.inf

    def mode(self, custom_mode: int) -> Mode:
        """Returns the mode of a number."""
        mode = self._autopilot.mode(custom_mode)
        if self._autopilot.names_mode(custom_mode):
            self._wanted = None
            return mode
        name = self._names.get(custom_mode)
        self._wanted = custom_mode if name is None else None
        return replace(mode, own_text=f"{mode.name} ({name})") if name else mode

    def take_request(self, now_s: float) -> bool:
        """Returns whether the names are to be requested now, and counts that as done."""
        if self._wanted is None or now_s < self._next_s or self._requests_count >= MOST_REQUESTS:
            return False
        self._requests_count += 1
        self._next_s = now_s + REQUEST_S
        return True

    def forget(self) -> None:
        """Forgets all names: they may have changed."""
        self._names.clear()
        self._requests_count = 0

    def on_available(self, message: Message, now_s: float, _: float) -> None:
        """Takes AVAILABLE_MODES: one of the modes. A standard mode has no name there."""
        number = message.custom_mode
        if len(self._names) < MOST_NAMES or number in self._names:
            printable = "".join(each for each in message.mode_name if each.isprintable())
            self._names[number] = printable[:LONGEST_NAME_CHARACTERS].strip()

    def on_monitor(self, message: Message, now_s: float, _: float) -> None:
        """Takes AVAILABLE_MODES_MONITOR: it has another number once the modes have changed."""
        if self._version not in (None, message.seq):
            self.forget()
        self._version = message.seq
