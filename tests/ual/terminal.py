"""The ``ual`` command on a pseudo-terminal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import termios

from typing_extensions import Self

from tests.conftest import LIMIT_S, open_terminal

UAL = (sys.executable, "-c", "from ual._cli import main; main()")


class Terminal:
    """A program whose input and output are a terminal."""

    def __init__(self, *words: str) -> None:
        self._ours, its = open_terminal()
        environment = os.environ | {"TERM": "xterm", "COLUMNS": "100", "LINES": "40"}
        self.process = subprocess.Popen([*UAL, *words], stdin=its, stdout=its, stderr=its, env=environment)
        os.close(its)
        self.text = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._ours)

    def wait_for(self, text: str) -> None:
        while text not in self.text:
            assert self._read(), f"{text!r} never came:\n{self.text}"

    def press(self, keys: bytes) -> None:
        os.write(self._ours, keys)

    def mode(self) -> list[object]:
        return list(termios.tcgetattr(self._ours))

    def interrupt(self) -> None:
        """What a terminal does at Ctrl-C."""
        self.process.send_signal(signal.SIGINT)

    def wait(self) -> int:
        while self._read():
            pass
        return self.process.wait(LIMIT_S)

    def _read(self) -> bool:
        try:
            read = os.read(self._ours, 65536)
        except OSError:  # the other end is closed
            return False
        self.text += read.decode(errors="replace")
        return bool(read)
