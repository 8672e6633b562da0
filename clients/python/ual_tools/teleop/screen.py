"""Draws on a thread of its own: a terminal that takes no output must not delay the keys."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ual_tools.teleop.echo import QUESTION

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.live import Live


class Screen:
    """The newest picture. Pictures that come faster than the terminal takes them are left out."""

    def __init__(self, live: Live) -> None:
        self.is_gone = False
        """Whether the terminal has refused a picture."""
        self._live = live
        self._changed = threading.Condition()
        self._picture: RenderableType | None = None
        self._is_asking = False
        self._began_s: float | None = None
        self._is_closed = False

    @property
    def size(self) -> tuple[int, int]:
        """Columns and lines."""
        return self._live.console.size.width, self._live.console.size.height

    def show(self, picture: RenderableType, *, is_asking: bool) -> None:
        """Draws a picture as soon as the one before is drawn, and then sends the question of `echo`."""
        with self._changed:
            self._picture = picture
            self._is_asking = self._is_asking or is_asking
            self._changed.notify_all()

    def stuck_s(self) -> float:
        """Returns how long the terminal has not taken the picture that is being drawn."""
        began_s = self._began_s
        return 0.0 if began_s is None else time.monotonic() - began_s

    def run(self) -> None:
        """Draws until `close`."""
        while (picture := self._next()) is not None:
            self._began_s = time.monotonic()
            try:
                self._live.update(picture, refresh=True)
                self._ask()
            except OSError:
                self.is_gone = True
            self._began_s = None

    def close(self) -> None:
        """Ends it after the picture that is being drawn."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    def _ask(self) -> None:
        with self._changed:
            is_asking, self._is_asking = self._is_asking, False
        if is_asking:
            self._live.console.file.write(QUESTION)
            self._live.console.file.flush()

    def _next(self) -> RenderableType | None:
        with self._changed:
            self._changed.wait_for(lambda: self._is_closed or self._picture is not None)
            picture, self._picture = self._picture, None
            return None if self._is_closed else picture


@contextmanager
def screen() -> Iterator[Screen]:
    """Takes the whole terminal, and leaves it as it was."""
    from rich.console import Console
    from rich.live import Live

    with Live(console=Console(), screen=True, auto_refresh=False) as live:
        drawn = Screen(live)
        thread = threading.Thread(target=drawn.run, name="teleop screen", daemon=True)
        thread.start()
        try:
            yield drawn
        finally:
            drawn.close()
            thread.join()
