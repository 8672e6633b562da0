"""The ``ual`` command on a pseudo-terminal."""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
import time
from collections.abc import Callable

from typing_extensions import Self

from tests.conftest import LIMIT_S, open_terminal
from tests.forkserver import start_ual
from tests.waiting import until

UAL = (sys.executable, "-c", "from ual_tools.main import main; main()")
# The program itself does what `preexec_fn` would: that forks, and gRPC, which has threads here, may break a fork.
_OF_SESSION = "import fcntl, os, termios; os.setsid(); fcntl.ioctl(0, termios.TIOCSCTTY, 0)"
_OF_GROUP = "import os; os.setpgid(0, 0)"
_PATIENT = "from ual_tools.teleop import loop, vehicle; loop.LATE_S = loop.SLOW_S = vehicle.STALE_S = 1e9"
"""The teleop then takes a busy computer neither for a suspended one, nor for a slow terminal or daemon."""


class Terminal:
    """A program whose input and output are a terminal.

    Args:
        words: The words of the command.
        size: Columns and lines.
        is_controlling: Whether it is the terminal of the program's session: closed, it sends SIGHUP. Otherwise the
            program is in a process group of its own, as a shell starts it, and can be suspended.
        is_answering: Whether it answers the question for its status, as all true terminals do.
        is_patient: Whether no key and no step is dropped for being late: for tests of what they do.

    """

    def __init__(
        self,
        *words: str,
        size: tuple[int, int] = (100, 40),
        is_controlling: bool = False,
        is_answering: bool = False,
        is_patient: bool = False,
    ) -> None:
        self._ours, its = open_terminal()
        environment = os.environ | {"TERM": "xterm", "COLUMNS": str(size[0]), "LINES": str(size[1])}
        before = "; ".join([_OF_SESSION if is_controlling else _OF_GROUP, *([_PATIENT] if is_patient else [])])
        self.process = start_ual(words, environment, stdin=its, stdout=its, stderr=its, before=before)
        os.close(its)
        self.text = ""
        self._awaited: set[str] = set()
        self.is_answering = is_answering
        self.answers_count = 0
        self._is_closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.process.kill()
        self.process.wait()
        self.close()

    def close(self) -> None:
        """Closes the terminal as a lost connection does."""
        if not self._is_closed:
            os.close(self._ours)
        self._is_closed = True

    def drain(self) -> None:
        """Reads what is there."""
        while not self._is_closed and select.select([self._ours], [], [], 0.0)[0] and self._read():
            pass

    def forget(self) -> None:
        """Makes `wait_for` wait only for what is drawn from now on."""
        self.drain()
        self.text = ""
        self._awaited.clear()

    def wait_until(self, is_so: Callable[[], bool]) -> None:
        """Waits for anything, and reads meanwhile."""
        until(is_so, seen=self._end, between=self._drain_and_pause)

    def wait_for(self, text: str) -> None:
        """Waits for a text since the beginning, or since `forget`. To wait twice for it would wait for nothing."""
        assert text not in self._awaited, f"{text!r} was there already: forget() before what draws it again"
        self._awaited.add(text)
        while text not in self.text:
            assert self._read(), f"{text!r} never came:\n{self.text}"

    def press_until(self, keys: bytes, text: str) -> None:
        """Presses keys again until the text comes: a program that was not scheduled for long may drop them."""
        due_s, point = 0.0, len(self.text)

        def press_again() -> None:
            nonlocal due_s
            if time.monotonic() > due_s:
                self.press(keys)
                due_s = time.monotonic() + 3.0
            self._drain_and_pause()

        until(lambda: text in self.text[point:], repr(text), seen=self._end, between=press_again)

    def _end(self) -> str:
        return self.text[-5000:]

    def _drain_and_pause(self) -> None:
        self.drain()
        time.sleep(0.01)  # the pause of `until`

    def press(self, keys: bytes) -> None:
        os.write(self._ours, keys)

    def answer(self) -> None:
        """Answers the question for its status."""
        self.answers_count += 1
        self.press(b"\x1b[0n")

    def mode(self) -> list[object]:
        return list(termios.tcgetattr(self._ours))

    def interrupt(self) -> None:
        """Interrupts the program as a terminal does at Ctrl-C."""
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
        if self.is_answering and b"\x1b[5n" in read:
            self.answer()
        return bool(read)
