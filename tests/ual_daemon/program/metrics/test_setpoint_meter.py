from __future__ import annotations

import pytest

from ual.geometry import Vector3
from ual_daemon.backends.values import VelocitySetpoint
from ual_daemon.program.metrics.setpoint_meter import BOUNDS_S, SetpointMeter

SETPOINT = VelocitySetpoint(Vector3(1.0, 0.0, 0.0))
PERIOD_S = 0.02


class Metered:
    """A meter whose time a test sets."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.meter = SetpointMeter(lambda: self.now_s, PERIOD_S)

    def send(self, *gaps_s: float) -> None:
        for gap_s in gaps_s:
            self.now_s += gap_s
            self.meter.on_sent(SETPOINT)

    def late(self, by_s: float) -> int:
        """Returns the number of setpoints that were late by at most a time."""
        return self.meter.lateness.counts[BOUNDS_S.index(by_s)]


def test_the_first_setpoint_is_counted_and_cannot_be_late() -> None:
    metered = Metered()
    metered.send(0.0)
    assert metered.meter.sent_count == 1
    assert metered.meter.lateness.counts[-1] == 0


def test_lateness_is_what_passes_beyond_the_period() -> None:
    metered = Metered()
    metered.send(0.0, 0.02, 0.015, 0.024, 0.32)  # in time, too early, 4 ms, 300 ms late
    assert [metered.late(bound) for bound in (0.001, 0.005, 0.2, 0.5)] == [2, 3, 3, 4]
    assert metered.meter.lateness.sum_s == pytest.approx(0.304)
    assert metered.meter.sent_count == 5


def test_after_a_pause_the_next_one_is_not_late() -> None:
    metered = Metered()
    metered.send(0.0)
    metered.meter.on_pause(0.1)
    metered.send(5.0, 0.1)
    assert metered.meter.lateness.counts == (1,) * len(BOUNDS_S)


def test_a_process_that_was_stopped_is_late_and_a_flight_that_was_abandoned_is_not() -> None:
    metered = Metered()
    metered.send(0.0, 3.02)
    assert (metered.late(2.0), metered.late(5.0)) == (0, 1)
    metered.send(60.0)
    assert metered.meter.lateness.counts[-1] == 1
