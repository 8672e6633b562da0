"""The keys of this terminal or console: has it give them at once, and leaves it as it was."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from ual_tools.keys import TerminalKeys

_TERMINATED_STATUS = 143
"""The exit status of a program that SIGTERM ends."""


@contextmanager
def keyboard() -> Iterator[TerminalKeys]:
    """Has the terminal give keys at once and without showing them. Leaves it as it was, also at SIGTERM."""
    before = signal.signal(signal.SIGTERM, _exit)
    try:
        if not sys.stdin.isatty():
            yield TerminalKeys(None)
            return
        with _characters_at_once() as keys:
            yield keys
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _characters_at_once() -> Iterator[TerminalKeys]:
    file = sys.stdin.fileno()
    try:
        import termios
        import tty
    except ImportError:  # Windows, whose consoles have no such mode
        from ual_tools.console_keys import ConsoleKeyboard

        yield ConsoleKeyboard(file)
        return
    mode = termios.tcgetattr(file)
    try:
        tty.setcbreak(file)
        yield TerminalKeys(file)
    finally:
        with suppress(termios.error):  # the terminal may be gone
            termios.tcsetattr(file, termios.TCSADRAIN, mode)


def _exit(_: int, __: FrameType | None) -> None:
    raise SystemExit(_TERMINATED_STATUS)
