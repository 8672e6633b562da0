"""Keys of a terminal: reads their bytes, and says which key some bytes mean."""

from __future__ import annotations

import os
import re
import select
import time
from collections.abc import Sequence
from enum import Enum, auto


class Key(Enum):
    """Meaning of a key."""

    UP = auto()
    DOWN = auto()
    PAGE_UP = auto()
    PAGE_DOWN = auto()
    HOME = auto()
    END = auto()
    QUIT = auto()


# What terminals send: the sequences of xterm, of its application mode (ESC O), of the Linux console and of the vt220.
_KEYS = {
    Key.UP: (b"\x1b[A", b"\x1bOA", b"k"),
    Key.DOWN: (b"\x1b[B", b"\x1bOB", b"j"),
    Key.PAGE_UP: (b"\x1b[5~", b"b"),
    Key.PAGE_DOWN: (b"\x1b[6~", b" "),
    Key.HOME: (b"\x1b[H", b"\x1bOH", b"\x1b[1~", b"\x1b[7~", b"g"),
    Key.END: (b"\x1b[F", b"\x1bOF", b"\x1b[4~", b"\x1b[8~", b"G"),
    Key.QUIT: (b"q", b"Q", b"\x03"),
}
_BY_BYTES = {sequence: key for key, sequences in _KEYS.items() for sequence in sequences}
_SEQUENCE = re.compile(rb"\x1b\[[0-9;]*[@-~]|\x1bO[@-~]|.", re.DOTALL)


def decoded(read: bytes) -> list[Key]:
    """Returns the keys in some bytes of a terminal, without those that mean nothing here."""
    return [_BY_BYTES[each] for each in _SEQUENCE.findall(read) if each in _BY_BYTES]


class TerminalKeys:
    """The keys of a terminal; without a terminal there are none."""

    def __init__(self, file: int | None) -> None:
        self._file = file

    def wait(self, timeout_s: float) -> Sequence[Key]:
        """Returns the keys that were pressed, after `timeout_s` at the latest."""
        return decoded(self.read(timeout_s))

    @property
    def is_gone(self) -> bool:
        """Whether there is no terminal (any more)."""
        return self._file is None

    def read(self, timeout_s: float) -> bytes:
        """Returns what the terminal has sent, after `timeout_s` at the latest."""
        if self._file is None:
            time.sleep(timeout_s)  # Windows cannot wait for no file at all
            return b""
        ready, _, _ = select.select([self._file], [], [], timeout_s)
        if not ready:
            return b""
        try:
            read = os.read(self._file, 1024)
        except OSError:
            read = b""
        if not read:  # the terminal is gone
            self._file = None
        return read
