"""Messages that are received and not taken, and the reasons, human-readable. Pure logic: callers pass the time."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass

RECENT_NOTE_S = 5.0
"""Only what came within this time is reported: everything that speaks MAVLink sends a heartbeat each second."""
LASTING_NOTE_S = 2.0
"""Seconds for which messages must have come before they are worth a line of the log: the autopilot's heartbeat may come
next.
"""
MOST_NOTES = 16
"""Most notes that are remembered; a new note replaces the one whose messages came least lately."""
MOST_REPORTED_NOTES = 3
"""Most notes that are reported at once."""


@dataclass(slots=True)
class _Note:
    text: str
    is_minor: bool
    since_s: float
    heard_s: float


class Untaken:
    """Takes notes of what comes and is not used. Belongs to the thread that receives; bounded, whatever comes."""

    def __init__(self) -> None:
        self._notes: dict[Hashable, _Note] = {}

    def __contains__(self, key: Hashable) -> bool:
        return key in self._notes

    def note(self, key: Hashable, text: str, now_s: float, *, is_minor: bool = False) -> None:
        """Takes note of something that came: `text` says what, and why it is not taken.

        What `is_minor` is reported after the rest: it is nothing that could be flown.
        """
        since_s = now_s - self.lasts_s(key, now_s)
        if key not in self._notes and len(self._notes) >= MOST_NOTES:
            del self._notes[min(self._notes, key=lambda each: self._notes[each].heard_s)]
        self._notes[key] = _Note(text, is_minor, since_s, now_s)

    def forget(self, key: Hashable) -> None:
        """Forgets what was noted: it is taken now."""
        self._notes.pop(key, None)

    def lasts_s(self, key: Hashable, now_s: float) -> float:
        """Returns for how long something has come without a long pause; 0 where it does not come now."""
        note = self._notes.get(key)
        return 0.0 if note is None or now_s - note.heard_s > RECENT_NOTE_S else now_s - note.since_s

    def text(self, now_s: float, since_s: float = -math.inf, *, lasts_s: float = 0.0) -> str:
        """Returns what has come lately, after `since_s`, and for at least `lasts_s`; empty if there is nothing."""
        found = [
            note
            for key, note in self._notes.items()
            if note.heard_s > since_s and now_s - note.heard_s <= RECENT_NOTE_S and self.lasts_s(key, now_s) >= lasts_s
        ]
        texts = [note.text for note in sorted(found, key=lambda each: each.is_minor)]
        more_count = len(texts) - MOST_REPORTED_NOTES
        return "; ".join([*texts[:MOST_REPORTED_NOTES], *([f"and {more_count} more"] if more_count > 0 else [])])
