"""Times of pictures by distance, and the pictures that a camera keeps."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.errors import InvalidArgumentError
from ual.geometry import Vector3
from ual_daemon.backends.engine import photo_log
from ual_daemon.backends.engine.distance_trigger import DistanceTrigger
from ual_daemon.backends.engine.photo_log import PhotoLog


@given(st.floats(0.1, 50.0), st.floats(0.001, 0.9), st.integers(1, 200))
def test_on_a_row_each_picture_is_due_where_it_should_be(distance_m: float, share: float, count: int) -> None:
    """Steps of any length below the distance do not add up: picture n is due within a step after n distances."""
    trigger, step_m = DistanceTrigger(distance_m), distance_m * share
    taken_m = [i * step_m for i in range(count) if trigger.due_count(Vector3(i * step_m))]
    for number, place_m in enumerate(taken_m):
        assert -1e-6 * distance_m <= place_m - number * distance_m <= step_m * (1.0 + 1e-6) + 1e-6 * distance_m


def test_the_first_is_due_at_once_and_a_hover_makes_none() -> None:
    trigger = DistanceTrigger(1.0)
    assert trigger.due_count(Vector3(5.0)) == 1
    for i in range(1000):
        assert trigger.due_count(Vector3(5.0 + 0.4 * math.sin(i), 0.4 * math.cos(i))) == 0


def test_steps_that_are_too_long_are_counted() -> None:
    trigger = DistanceTrigger(1.0)
    trigger.due_count(Vector3())
    assert trigger.due_count(Vector3(0.0, 3.5)) == 3
    assert trigger.due_count(Vector3(0.0, 3.9)) == 0
    assert trigger.due_count(Vector3(0.0, 4.1)) == 1


def test_the_log_numbers_what_is_added_and_forgets_the_oldest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photo_log, "MOST_PHOTOS", 3)
    log: PhotoLog[str] = PhotoLog()
    with pytest.raises(InvalidArgumentError, match="there is no picture 0: it has none"):
        log.get(0)
    for _ in range(5):
        log.add(lambda number: f"photo {number}")
    assert log.count == 5
    assert log.since(0) == log.since(2) == ["photo 2", "photo 3", "photo 4"]
    assert log.since(4) == ["photo 4"]
    assert log.since(9) == []
    assert log.get(2) == "photo 2"
    for number in (1, 5):
        with pytest.raises(InvalidArgumentError, match="it has 2 to 4"):
            log.get(number)
