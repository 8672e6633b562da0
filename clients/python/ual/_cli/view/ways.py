"""The straight ways that were ordered from the page. Of others' tasks the telemetry does not say where they lead."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from ual.geometry import Vector3
from ual.types import Telemetry


@dataclass(frozen=True, slots=True)
class _Way:
    task_id: str
    goal: Vector3


class Ways:
    """Where the tasks lead that were begun from the pages. Any thread may call."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ways: dict[str, _Way] = {}

    def begin(self, ns: str, task_id: str, goal: Vector3 | None) -> None:
        """Takes note that a task has begun: one that leads straight to a goal in `map`, or another one."""
        with self._lock:
            self._ways.pop(ns, None)
            if goal is not None:
                self._ways[ns] = _Way(task_id, goal)

    def goal(self, ns: str, telemetry: Telemetry | None) -> Vector3 | None:
        """Returns where the running task of a UAV leads, if it was begun here."""
        task = None if telemetry is None else telemetry.task
        with self._lock:
            way = self._ways.get(ns)
        return None if way is None or task is None or task.id != way.task_id else way.goal
