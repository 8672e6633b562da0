"""A pilot who takes over in a take-off, at an exact time of the aircraft."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from tests.simulators.dji import AUTO_TAKE_OFF, SDK_CONTROL
from tests.simulators.lockstep_dji import LockstepDji
from tests.ual_daemon.backends.dji.test_dji_flights import record_states, wait
from tests.waiting import LIMIT_S, until
from ual.errors import TaskAbortedError
from ual.types import State
from ual_daemon import UAL

_CLIMBED_M = 1.1
"""A built-in take-off that ends higher looks as if it had ended by itself."""


class TakeOver(NamedTuple):
    """Outcome of a take-over."""

    shows_in_mode: bool
    told_after_s: float
    sent_after_s: float
    """Seconds for which setpoints left after it; 0 where none did."""


class _Pilot:
    """Takes over so long after the built-in take-off has begun."""

    def __init__(self, backend: LockstepDji, after_s: float) -> None:
        self.shows_in_mode = False
        self.taken_s: float | None = None
        self._aircraft, self._after_s = backend.aircraft, after_s
        self._begun_s: float | None = None

    def on_step(self) -> None:
        """Does what is due."""
        aircraft = self._aircraft
        if self._begun_s is None and aircraft.display == AUTO_TAKE_OFF:
            self._begun_s = aircraft.now_s
        is_due = self._begun_s is not None and aircraft.now_s >= self._begun_s + self._after_s
        if is_due and self.taken_s is None:
            is_climbing = aircraft.display == AUTO_TAKE_OFF and aircraft.height_m < _CLIMBED_M
            self.shows_in_mode = is_climbing or aircraft.display == SDK_CONTROL
            aircraft.pilot_takes_over()
            self.taken_s = aircraft.now_s


def take_over_in_take_off(uav: UAL, backend: LockstepDji, after_s: float) -> TakeOver:
    """Takes an armed aircraft off, and has the pilot take it over: the take-off ends by that."""
    told, pilot = record_states(uav, backend), _Pilot(backend, after_s)
    backend.on_step = pilot.on_step
    task = uav.take_off(5.0, blocking=False)
    until(lambda: pilot.taken_s is not None)
    with pytest.raises(TaskAbortedError, match="safety pilot"):
        task.wait(LIMIT_S)
    wait(backend, 2.0)
    taken_s = pilot.taken_s
    assert taken_s is not None
    manual_s = min(time_s for time_s, state in told if time_s > taken_s and state is State.FLYING_MANUAL)
    sent_s = max((time_s for time_s, _, _ in backend.aircraft.setpoints if time_s > taken_s), default=taken_s)
    return TakeOver(pilot.shows_in_mode, manual_s - taken_s, sent_s - taken_s)
