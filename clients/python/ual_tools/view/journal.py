"""The log of the page: changes of state, ended tasks, the autopilot's words, losses, and refusals. Pure."""

from __future__ import annotations

import threading
from collections import deque

from ual.errors import UalError
from ual.shared.ages import without_seconds
from ual.types import TaskInfo, TaskStatus, Telemetry
from ual_tools.condition import Urgency
from ual_tools.output import error_text, running_text
from ual_tools.view.shown import Shown, clock_text
from ual_tools.watch_board import WatchedUav

_MOST_LINES = 200
_LONGEST_LINE_CHARACTERS = 300


class Journal:
    """Journal of events, the newest last. Any thread may write."""

    def __init__(self) -> None:
        self.count = 0
        self._lock = threading.Lock()
        self._lines: deque[tuple[str, str]] = deque(maxlen=_MOST_LINES)
        self._states: dict[str, str] = {}
        self._text: dict[str, str] = {}
        self._levels: dict[str, Urgency] = {}

    def note_changes(self, uav: Shown, watched: WatchedUav, utc_s: float) -> None:
        """Writes what has changed of a UAV since the last look."""
        telemetry = watched.telemetry
        if telemetry is None:
            return
        if uav.is_lost:
            self._note_state(uav.ns, "lost", uav.label.removeprefix(f"{uav.ns}: "), utc_s)
            return
        reason = f" ({telemetry.state_reason})" if telemetry.state_reason else ""
        self._note_state(uav.ns, telemetry.state.name, f"{telemetry.state.name}{reason}", utc_s)
        self._note_text(uav.ns, telemetry, utc_s)
        self._note_alarm(uav, utc_s)

    def ended(self, ns: str, task: TaskInfo, utc_s: float) -> None:
        """Writes how a task ended."""
        why = "" if task.error is None else f": {error_text(task.error)}"
        if task.status is not TaskStatus.RUNNING:
            self.write(ns, f"{running_text(task)}: {task.status.name}{why}", utc_s)

    def refused(self, ns: str, what: str, error: UalError, utc_s: float) -> None:
        """Writes a refusal."""
        self.write(ns, f"{what} REFUSED: {error_text(error)}", utc_s)

    def write(self, ns: str, text: str, utc_s: float) -> None:
        """Writes a line about a UAV."""
        line = f"{clock_text(utc_s)} {ns}: {' '.join(text.split())}"
        with self._lock:
            self._lines.append((ns, line[:_LONGEST_LINE_CHARACTERS]))
            self.count += 1

    def entries(self, ns: str = "", most: int = 12) -> list[str]:
        """Returns the newest lines, the newest first: those of one UAV, or of all."""
        with self._lock:
            found = [line for of, line in self._lines if not ns or of == ns]
        return found[::-1][:most]

    def _note_state(self, ns: str, state: str, text: str, utc_s: float) -> None:
        if self._states.get(ns) != state:
            self._states[ns] = state
            self.write(ns, text, utc_s)

    def _note_alarm(self, uav: Shown, utc_s: float) -> None:
        """Writes when it becomes worse, with what is wrong then."""
        before = self._levels.get(uav.ns, Urgency.FINE)
        self._levels[uav.ns] = uav.how.level
        if uav.how.level > before:
            self.write(uav.ns, f"{uav.how.level.name}: {uav.how.text}", utc_s)

    def _note_text(self, ns: str, telemetry: Telemetry, utc_s: float) -> None:
        text = telemetry.status_text
        timeless = without_seconds(text)
        if text and self._text.get(ns) != timeless:
            self.write(ns, f"the autopilot says: {text}", utc_s)
        self._text[ns] = timeless
