"""Flies by the keys of a terminal: which keys mean what, and what a key that is held means."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace

from ual_tools.teleop.actions import CONFIRMED, ENDING, Action
from ual_tools.teleop.pilot import Pilot, StickMode
from ual_tools.teleop.smoothing import SmoothedAxis
from ual_tools.teleop.sticks import CENTRED, Sticks

CONFIRM_S = 2.0
"""A confirmation is waited for this long."""
_REPEAT_S = 0.12
"""Seconds within which a key that comes again is a repeat of the terminal: no finger is as fast."""
_KEY_STEP_PERIOD_S = 0.5
"""A key that is held makes another step each time this passes."""

# What terminals send for the arrow keys: xterm, and its application mode (ESC O).
_STICKS = {
    b"\x1b[A": ("forward", 1.0),
    b"\x1bOA": ("forward", 1.0),
    b"\x1b[B": ("forward", -1.0),
    b"\x1bOB": ("forward", -1.0),
    b"\x1b[D": ("left", 1.0),
    b"\x1bOD": ("left", 1.0),
    b"\x1b[C": ("left", -1.0),
    b"\x1bOC": ("left", -1.0),
    b"w": ("up", 1.0),
    b"s": ("up", -1.0),
    b"a": ("turn", 1.0),
    b"d": ("turn", -1.0),
}
_ACTIONS = {
    b"t": Action.TAKE_OFF,
    b"l": Action.LAND,
    b"x": Action.ABORT,
    b" ": Action.STOP,
    b"r": Action.RECOVER,
    b"m": Action.ARM,
    b"+": Action.FASTER,
    b"=": Action.FASTER,
    b"-": Action.SLOWER,
    b"h": Action.HEADLESS,
    b"p": Action.MODE,
    b"\t": Action.NEXT_UAV,
    b"\x1b[Z": Action.PREVIOUS_UAV,
    b"q": Action.QUIT,
}
_CONFIRM = (b"\r", b"\n")
_KEY = re.compile(rb"\x1b\[[0-9;]*[@-~]|\x1bO[@-~]|\x1b(?!\[|O)|[^\x1b]")
_UNFINISHED = re.compile(rb"\x1b(\[[0-9;]*|O)?\Z")


class Decoder:
    """Splits what a terminal sends into keys. A key that arrives in two parts (over a network) stays one."""

    def __init__(self) -> None:
        self._rest = b""

    def keys(self, read: bytes) -> list[bytes]:
        """Returns the keys that are complete."""
        read = self._rest + read
        unfinished = _UNFINISHED.search(read)
        self._rest = b"" if unfinished is None else unfinished[0]
        return _KEY.findall(read[: len(read) - len(self._rest)])


class Menu:
    """Makes actions out of keys. What is dangerous needs Enter after its key: holding the key must not be enough."""

    def __init__(self) -> None:
        self._question: tuple[Action, float] | None = None

    def question(self, now_s: float) -> str:
        """Returns what is to be confirmed; empty if nothing is."""
        action = self._waiting(now_s)
        return "" if action is None else f"{action.value}? Enter confirms"

    def action(self, key: bytes, now_s: float) -> Action | None:
        """Returns the action that a key requests; None if it requests none, or for one that must be confirmed."""
        pending, self._question = self._waiting(now_s), None
        if key in _CONFIRM:
            return pending
        action = _ACTIONS.get(key)
        if action in CONFIRMED:
            self._question = action, now_s
            return None
        return action

    def _waiting(self, now_s: float) -> Action | None:
        if self._question is None or now_s - self._question[1] > CONFIRM_S:
            return None
        return self._question[0]


class Keys:
    """The four axes of the keys. The time is given, in seconds from anywhere."""

    def __init__(self) -> None:
        self._axes = {name: SmoothedAxis() for name in ("forward", "left", "up", "turn")}

    def press(self, key: bytes, now_s: float) -> None:
        """Takes a key; one that is none of the axes does nothing."""
        if key in _STICKS:
            name, direction = _STICKS[key]
            self._axes[name].press(direction, now_s)

    def sticks(self, now_s: float) -> Sticks:
        """Returns the deflections."""
        return Sticks(**{name: axis.value(now_s) for name, axis in self._axes.items()})


class Steps:
    """Makes steps of the pose mode out of keys: one for each press, and while a key is held one each half second."""

    def __init__(self) -> None:
        self._last: dict[bytes, float] = {}
        self._stepped: dict[bytes, float] = {}

    def step(self, key: bytes, now_s: float) -> Sticks:
        """Returns the step that a key requests, centred if none."""
        if key not in _STICKS:
            return CENTRED
        is_repeat = now_s - self._last.get(key, -math.inf) < _REPEAT_S
        self._last[key] = now_s
        if is_repeat and now_s - self._stepped[key] < _KEY_STEP_PERIOD_S:
            return CENTRED
        self._stepped[key] = now_s
        name, direction = _STICKS[key]
        return replace(CENTRED, **{name: direction})


class Keyboard:
    """Controls a pilot by the keys that a terminal has sent."""

    title = "keyboard"
    help: Sequence[tuple[str, str]] = (
        ("arrows", "forward, back, left, right"),
        ("w s  a d", "up, down, turn left, right"),
        ("space", "stop at once"),
        ("t  l", "take off (then Enter), land"),
        ("x  r", "abort, recover (then Enter)"),
        ("m", "arm (then Enter)"),
        ("+ -", "speed level"),
        ("h  p", "headless, velocity or pose"),
        ("Tab", "next UAV"),
        ("q", "stop and quit"),
    )

    def __init__(self) -> None:
        self._decoder = Decoder()
        self._menu = Menu()
        self.forget()

    def forget(self) -> None:
        """Forgets which keys were held."""
        self._keys = Keys()
        self._steps = Steps()
        self._menu = Menu()

    def question(self, now_s: float) -> str:
        """Returns what is to be confirmed; empty if nothing is."""
        return self._menu.question(now_s)

    def control(self, pilot: Pilot, read: bytes, now_s: float, *, is_late: bool) -> None:
        """Does what the keys say.

        Args:
            pilot: Executes the commands.
            read: What the terminal has sent since the last call.
            now_s: When.
            is_late: Whether the keys may have waited for a while. Then they can only end a motion.

        """
        keys = self._decoder.keys(read)
        if is_late:
            self.forget()
            keys = [key for key in keys if _ACTIONS.get(key) in ENDING]
        for key in keys:
            self._press(pilot, key, now_s)
        if pilot.mode is StickMode.VELOCITY:
            pilot.steer(self._keys.sticks(now_s))

    def _press(self, pilot: Pilot, key: bytes, now_s: float) -> None:
        action = self._menu.action(key, now_s)
        if action is not None:
            if action not in (Action.FASTER, Action.SLOWER):
                self.forget()
            pilot.act(action)
        elif pilot.mode is StickMode.POSE:
            pilot.step(self._steps.step(key, now_s))
        else:
            self._keys.press(key, now_s)
