"""Common log of a team: each line with the name of its program in a colour of its own, and on a terminal a line of
states below it.
"""

from __future__ import annotations

import contextlib
import queue
import re
import threading
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING

from typing_extensions import Self

from ual.shared.guard import WorkGuard
from ual_tools.streams import give_up_output

if TYPE_CHECKING:
    from rich.text import Text

LAUNCH = "launch"
_MOST_WAITING_LINES = 10_000
_FLUSH_LIMIT_S = 1.0
_COLOURS = ("cyan", "green", "magenta", "blue", "bright_cyan", "bright_green", "bright_magenta", "bright_blue")
_CONTROL = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)|[\x00-\x08\x0b-\x1f\x7f-\x9f]")
"""Escape sequences and control characters: a program's output must not move the cursor of this terminal."""


def plain(line: str) -> str:
    """Returns a line without anything that a terminal would obey."""
    return _CONTROL.sub("", line)


class TeamLog:
    """Writes lines to stdout. On a terminal, the states of all programs stand below the last line.

    A thread of its own writes: a terminal that is stopped, or a link that is slow, must not keep the UAVs from landing.
    What it cannot take is dropped and counted. A terminal or pipe that is gone ends nothing.
    """

    def __init__(self, names: Sequence[str]) -> None:
        from rich.console import Console
        from rich.live import Live

        self._console = Console(highlight=False, markup=False, emoji=False)
        self._width = max(map(len, (*names, LAUNCH)))
        self._colours = {name: _COLOURS[i % len(_COLOURS)] for i, name in enumerate(names)}
        self._states: dict[str, str] = dict.fromkeys(names, "")
        self._live = Live(
            console=self._console, auto_refresh=False, transient=True, redirect_stdout=False, redirect_stderr=False
        )
        self._work: queue.Queue[Callable[[], object] | None] = queue.Queue(_MOST_WAITING_LINES)
        self._lost_count = 0
        self._guard = WorkGuard("launch log")
        self._thread = threading.Thread(target=self._write, name="log", daemon=True)

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._put(self._live.start)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._put(self._live.stop)
        with contextlib.suppress(queue.Full):
            self._work.put(None, timeout=_FLUSH_LIMIT_S)
            self._thread.join(_FLUSH_LIMIT_S)

    def write(self, name: str, text: str) -> None:
        """Writes one line of a program."""
        self._print(name, self._colours.get(name, ""), plain(text), "")

    def note(self, text: str, *, is_bad: bool = False) -> None:
        """Writes one line of `ual launch` itself."""
        self._print(LAUNCH, "bold", plain(text), "red" if is_bad else "bold")

    def state(self, name: str, text: str) -> None:
        """Shows the state of a program on the line below."""
        if self._states.get(name) != text:
            self._states[name] = text
            if self._console.is_terminal:
                line = self._states_text()
                self._put(lambda: self._live.update(line, refresh=True))

    def _states_text(self) -> Text:
        from rich.text import Text

        line = Text(no_wrap=True, overflow="ellipsis")
        for name, text in self._states.items():
            line.append(f" {name} ", f"reverse {self._colours[name]}").append(f" {text or '-'} ")
        return line

    def _print(self, name: str, name_style: str, text: str, style: str) -> None:
        from rich.text import Text

        line = Text.assemble((f"{name:<{self._width}} ", name_style), (text, style))
        self._put(lambda: self._console.print(line, soft_wrap=True))

    def _put(self, work: Callable[[], object]) -> None:
        try:
            if self._lost_count:
                lost = f"{LAUNCH:<{self._width}} {self._lost_count} lines lost: the log is not read fast enough"
                self._work.put_nowait(lambda: self._console.print(lost))
                self._lost_count = 0
            self._work.put_nowait(work)
        except queue.Full:
            self._lost_count += 1

    def _write(self) -> None:
        is_gone = False
        while (work := self._work.get()) is not None:
            if is_gone:
                continue
            try:
                if not self._guard.contain(work, passes=OSError):
                    self._console.print(f"{LAUNCH:<{self._width}} a line cannot be shown: {self._guard.last_cause!a}")
            except (OSError, SystemExit):  # rich ends the program by the latter where a pipe is closed
                is_gone = True
                give_up_output()
