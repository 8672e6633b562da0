"""The one log of a team: each line with the name of its program in a colour of its own, and on a terminal a line of
states below it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING

from typing_extensions import Self

if TYPE_CHECKING:
    from rich.text import Text

LAUNCH = "launch"
_COLOURS = ("cyan", "green", "magenta", "blue", "bright_cyan", "bright_green", "bright_magenta", "bright_blue")
_CONTROL = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)|[\x00-\x08\x0b-\x1f\x7f-\x9f]")
"""Escape sequences and control characters: a program's output must not move the cursor of this terminal."""


def plain(line: str) -> str:
    """Returns a line without anything that a terminal would obey."""
    return _CONTROL.sub("", line)


class Log:
    """Writes lines to stdout. On a terminal, the states of all programs stand below the last line.

    A terminal or pipe that is gone ends nothing: the team must still be ended in order.
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
        self._is_gone = False

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._try(self._live.stop)

    def line(self, name: str, text: str) -> None:
        """Writes one line of a program."""
        from rich.text import Text

        line = Text.assemble((f"{name:<{self._width}} ", self._colours.get(name, "bold")), plain(text))
        self._try(lambda: self._console.print(line, soft_wrap=True))

    def note(self, text: str, *, is_bad: bool = False) -> None:
        """Writes one line of `ual launch` itself."""
        from rich.text import Text

        line = Text.assemble((f"{LAUNCH:<{self._width}} ", "bold"), (text, "red" if is_bad else "bold"))
        self._try(lambda: self._console.print(line, soft_wrap=True))

    def state(self, name: str, text: str) -> None:
        """Shows the state of a program on the line below."""
        if self._states.get(name) != text:
            self._states[name] = text
            self._try(lambda: self._live.update(self._line_of_states(), refresh=self._live.is_started))

    @property
    def states(self) -> Mapping[str, str]:
        """What each program is doing."""
        return self._states

    def _line_of_states(self) -> Text:
        from rich.text import Text

        line = Text(no_wrap=True, overflow="ellipsis")
        for name, text in self._states.items():
            line.append(f" {name} ", f"reverse {self._colours[name]}").append(f" {text or '-'} ")
        return line

    def _try(self, write: object) -> None:
        if self._is_gone or not callable(write):
            return
        try:
            write()
        except OSError:
            self._is_gone = True
