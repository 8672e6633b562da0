"""The texts of an autopilot that are critical or worse, while they are news: reported as they come, and forgotten."""

from __future__ import annotations

from ual_daemon.backends.values import SevereText

SEVERE = 2
"""The least urgent severity that is reported (MAV_SEVERITY_CRITICAL); lower numbers are worse."""
TEXT_S = 30.0
"""Seconds for which a text is reported that does not come again."""
_MOST_TEXTS = 8
_PART_S = 1.0
"""The next part of a long text comes within this time."""
_PREARM = "PreArm: "
"""These are repeated while they hold, and reported as checks that fail."""


class SevereTexts:
    """The severe texts of one autopilot. Belongs to the thread that receives."""

    def __init__(self) -> None:
        self._texts: tuple[SevereText, ...] = ()

    def on_text(self, text: str, severity: int, now_s: float, ends: tuple[str, ...] = ()) -> None:
        """Takes a text. One that says that something is over ends those that begin with one of `ends`.

        A text that comes again is reported again. A longer one replaces its own first part.
        """
        if ends:
            self._texts = tuple(each for each in self._texts if not each.text.startswith(ends))
        elif severity <= SEVERE and text and not text.startswith(_PREARM):
            kept = (each for each in self._texts if not _is_same(each, text, now_s))
            self._texts = (*kept, SevereText(text, severity, now_s))[-_MOST_TEXTS:]

    def fresh(self, now_s: float) -> tuple[SevereText, ...]:
        """Returns those that are news; the same object while nothing has changed."""
        if self._texts and now_s - self._texts[0].time_s > TEXT_S:  # the oldest comes first
            self._texts = tuple(each for each in self._texts if now_s - each.time_s <= TEXT_S)
        return self._texts


def _is_same(before: SevereText, text: str, now_s: float) -> bool:
    return before.text == text or (text.startswith(before.text) and now_s - before.time_s <= _PART_S)
