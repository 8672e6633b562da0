"""Reads keys from a console of Windows, as the bytes that a terminal of other systems sends."""

from __future__ import annotations

import importlib
import time
from typing import Any

from typing_extensions import override

from ual_tools.keys import TerminalKeys

_POLL_S = 0.005
"""A console cannot be waited for: it has to be asked repeatedly."""
_SPECIAL = ("\x00", "\xe0")
"""Characters that precede the code of a key that is no character."""
_SEQUENCES = {
    "H": b"\x1b[A",
    "P": b"\x1b[B",
    "M": b"\x1b[C",
    "K": b"\x1b[D",
    "I": b"\x1b[5~",
    "Q": b"\x1b[6~",
    "G": b"\x1b[H",
    "O": b"\x1b[F",
}
"""The sequence of xterm for each code of `msvcrt.getwch`: arrows, page up and down, home, end."""


class ConsoleKeyboard(TerminalKeys):
    """The keys of a console."""

    def __init__(self, file: int) -> None:
        super().__init__(file)
        self._console: Any = importlib.import_module("msvcrt")

    @override
    def read(self, timeout_s: float) -> bytes:
        end_s = time.monotonic() + timeout_s
        while not self._console.kbhit():
            left_s = end_s - time.monotonic()
            if left_s <= 0.0:
                return b""
            time.sleep(min(_POLL_S, left_s))
        read = b""
        while self._console.kbhit():
            read += self._key()
        return read

    def _key(self) -> bytes:
        character = self._console.getwch()
        if character in _SPECIAL:
            return _SEQUENCES.get(self._console.getwch(), b"")
        return str(character).encode(errors="ignore")
