"""Frequency of reports about refused setpoints."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

import ual
from ual_ros2.refusals import AGAIN_S, Refusals


class Loop:
    """An event loop whose time a test lets pass."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._due: list[tuple[float, Callable[[], object]]] = []

    def call_later(self, delay_s: float, callback: Callable[..., object], *args: object) -> SimpleNamespace:
        due = self.now_s + delay_s, lambda: callback(*args)
        self._due.append(due)
        return SimpleNamespace(cancel=lambda: self._due.remove(due))

    def let_pass(self, time_s: float) -> None:
        self.now_s += time_s
        for due in sorted((due for due in self._due if due[0] <= self.now_s), key=lambda due: due[0]):
            self._due.remove(due)
            due[1]()

    @property
    def is_idle(self) -> bool:
        return not self._due


@pytest.fixture
def loop() -> Any:
    return Loop()


@pytest.fixture
def reported() -> list[tuple[str, str, int]]:
    return []


@pytest.fixture
def refusals(loop: Any, reported: list[tuple[str, str, int]]) -> Refusals:
    return Refusals(loop, lambda topic, error, count: reported.append((topic, error.message, count)))


def test_the_first_is_reported_at_once_and_the_others_together(
    loop: Loop, reported: list[object], refusals: Refusals
) -> None:
    for number in range(5):
        refusals.note("set_pose", ual.GeofenceError(f"far {number}"))
    assert reported == [("set_pose", "far 0", 1)]
    loop.let_pass(AGAIN_S)
    assert reported == [("set_pose", "far 0", 1), ("set_pose", "far 4", 4)]
    loop.let_pass(AGAIN_S)
    assert len(reported) == 2
    assert loop.is_idle
    refusals.note("set_pose", ual.GeofenceError("far 5"))
    assert reported[2:] == [("set_pose", "far 5", 1)]


def test_each_topic_and_reason_is_reported_by_itself(reported: list[object], refusals: Refusals) -> None:
    refusals.note("set_pose", ual.GeofenceError("far"))
    refusals.note("set_pose", ual.WrongStateError("landed"))
    refusals.note("set_velocity", ual.GeofenceError("far"))
    assert reported == [("set_pose", "far", 1), ("set_pose", "landed", 1), ("set_velocity", "far", 1)]


def test_the_counts_are_those_of_all(loop: Loop, reported: list[tuple[str, str, int]], refusals: Refusals) -> None:
    for _ in range(100):
        refusals.note("set_pose", ual.GeofenceError("far"))
        loop.let_pass(0.02)
    refusals.end()
    assert sum(count for _, _, count in reported) == 100
    assert len(reported) <= 100 * 0.02 / AGAIN_S + 2


def test_the_end_tells_what_was_counted_and_leaves_no_timer(
    loop: Loop, reported: list[object], refusals: Refusals
) -> None:
    refusals.note("set_pose", ual.GeofenceError("far 0"))
    refusals.note("set_pose", ual.GeofenceError("far 1"))
    refusals.note("cmd_vel", ual.WrongStateError("landed"))
    refusals.end()
    assert reported == [("set_pose", "far 0", 1), ("cmd_vel", "landed", 1), ("set_pose", "far 1", 1)]
    assert loop.is_idle
