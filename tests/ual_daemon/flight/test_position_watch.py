"""A source of the position that ends in flight is told at once, and not where another one is there."""

from __future__ import annotations

import pytest

from tests.snapshots import changed
from ual.types import GpsFix, GpsInfo
from ual_daemon.backends.values import (
    Control,
    ControlState,
    Estimator,
    LandedState,
    Mode,
    MotionState,
    Sample,
    Snapshot,
)
from ual_daemon.flight.external_silence import NOTICED_SILENCE_S, ExternalSilence
from ual_daemon.flight.position_watch import INERTIA_S, LOST_POSITION_S, RECOVERED_POSITION_S, PositionWatch

STEP_S = 0.05
NO_FIX = "no satellite fix (NONE), and the position drifts"
ENDED = "no poses come from outside any more, and the position drifts"


class Flight:
    """A UAV in the air with a good estimate, its receiver of satellites, and a source of poses from outside."""

    def __init__(self, fix: GpsFix | None = GpsFix.FIX_3D, landed: LandedState = LandedState.IN_AIR) -> None:
        self.silence = ExternalSilence()
        self.watch = PositionWatch(self.silence)
        self.now_s = 100.0
        self.fix, self.landed, self.is_good, self.aids = fix, landed, True, ""
        self.is_measured = False

    def snapshot(self) -> Snapshot:
        now_s = self.now_s
        snapshot = Snapshot(
            now_s,
            now_s,
            control=ControlState(
                Sample(True, now_s),
                Sample(self.landed, now_s),
                Sample(Mode("OFFBOARD", Control.REFERENCES), now_s),
            ),
            motion=MotionState(Sample(Estimator(self.is_good), now_s)),
        )
        gps = None if self.fix is None else GpsInfo(self.fix)
        return changed(snapshot, gps=gps, aids=self.aids)

    def passes(self, duration_s: float) -> str:
        """Lets time pass. Returns what is told then."""
        until_s = self.now_s + duration_s
        while self.now_s < until_s - 1e-9:
            self.now_s += STEP_S
            if self.is_measured:
                self.silence.on_pose(self.now_s)
            if self.now_s >= self.watch.due_s:
                self.watch.update(self.snapshot())
        return self.watch.trouble


def test_a_lost_fix_is_reported_within_half_a_second_and_tasks_wait() -> None:
    flight = Flight()
    assert not flight.passes(5.0)
    flight.fix = GpsFix.NONE
    assert flight.passes(LOST_POSITION_S + 0.2) == NO_FIX
    assert flight.watch.waits == NO_FIX


def test_a_fix_that_is_gone_for_a_moment_is_not_lost() -> None:
    flight = Flight()
    flight.passes(5.0)
    for _ in range(10):
        flight.fix = GpsFix.NONE
        assert not flight.passes(LOST_POSITION_S - 0.1)
        flight.fix = GpsFix.FIX_3D
        assert not flight.passes(RECOVERED_POSITION_S + 0.2)


def test_it_is_over_when_the_fix_is_back_for_a_second() -> None:
    flight = Flight()
    flight.passes(5.0)
    flight.fix = GpsFix.NONE
    flight.passes(1.0)
    flight.fix = GpsFix.RTK_FLOAT
    assert flight.passes(RECOVERED_POSITION_S - 0.2) == NO_FIX
    assert not flight.passes(0.4)


def test_it_is_reported_on_while_the_autopilot_has_no_position_and_ends_on_the_ground() -> None:
    flight = Flight()
    flight.passes(5.0)
    flight.fix = GpsFix.NONE
    flight.passes(6.0)
    flight.is_good = False
    assert flight.passes(20.0) == NO_FIX
    flight.landed = LandedState.ON_GROUND
    assert not flight.passes(0.2)


def test_an_estimate_that_stays_good_without_it_has_another_source() -> None:
    flight = Flight()
    flight.passes(5.0)
    flight.fix = GpsFix.NONE
    assert flight.passes(INERTIA_S - 1.0)
    assert not flight.passes(2.0)


@pytest.mark.parametrize(
    "fix",
    [GpsFix.NONE, GpsFix.FIX_2D, None],
    ids=["no fix", "two dimensions", "no receiver"],
)
def test_one_that_never_flew_by_satellites_is_not_troubled(fix: GpsFix | None) -> None:
    assert not Flight(fix).passes(30.0)


def test_a_lost_fix_troubles_nobody_who_has_optical_flow_or_poses_from_outside() -> None:
    for aids, is_measured in (("optical flow", False), ("", True)):
        flight = Flight()
        flight.aids, flight.is_measured = aids, is_measured
        flight.passes(5.0)
        flight.fix = GpsFix.NONE
        assert not flight.passes(30.0)


def test_on_the_ground_nothing_is_reported() -> None:
    flight = Flight(landed=LandedState.ON_GROUND)
    flight.is_measured = True
    flight.passes(5.0)
    flight.fix, flight.is_measured = GpsFix.NONE, False
    assert not flight.passes(5.0)


def test_poses_that_end_are_reported_within_half_a_second() -> None:
    flight = Flight(GpsFix.NONE)
    flight.is_measured = True
    assert not flight.passes(5.0)
    flight.is_measured = False
    assert not flight.passes(NOTICED_SILENCE_S - 0.1)
    assert flight.passes(0.2) == ENDED
    assert flight.watch.waits == ENDED
    flight.is_measured = True
    assert not flight.passes(2.0 * RECOVERED_POSITION_S + 0.4)


def test_poses_that_are_dropped_are_reported_by_their_cause() -> None:
    flight = Flight(GpsFix.NONE)
    flight.is_measured = True
    flight.passes(5.0)
    flight.is_measured = False
    for _ in range(10):
        flight.silence.dropped(flight.now_s, "it is old")
        flight.passes(0.1)
    assert flight.watch.trouble == "the poses from outside are dropped: it is old, and the position drifts"


def test_with_a_fix_poses_that_end_are_reported_but_nothing_waits() -> None:
    flight = Flight(GpsFix.FIX_3D)
    flight.is_measured = True
    flight.passes(5.0)
    flight.is_measured = False
    assert flight.passes(1.0) == ENDED
    assert not flight.watch.waits


def test_a_few_poses_are_no_source() -> None:
    flight = Flight(GpsFix.NONE)
    flight.is_measured = True
    flight.passes(0.5)
    flight.is_measured = False
    assert not flight.passes(5.0)


def test_both_that_end_are_reported() -> None:
    flight = Flight()
    flight.passes(3.0)
    flight.is_measured = True
    flight.passes(3.0)
    flight.fix = GpsFix.NONE
    assert not flight.passes(20.0)
    flight.is_measured = False
    assert flight.passes(1.0) == f"{NO_FIX}; {ENDED}"


def test_a_cause_whose_figures_change_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    flight = Flight(GpsFix.NONE)
    flight.is_measured = True
    flight.passes(5.0)
    flight.is_measured = False
    for number in range(20):
        flight.silence.dropped(flight.now_s, f"it is old: measured {number} s ago")
        flight.passes(0.1)
    assert caplog.text.count("position_trouble") == 1
    assert "measured 18 s ago" in flight.watch.trouble or "measured 19 s ago" in flight.watch.trouble


def test_a_source_that_begins_in_flight_is_not_one_that_was_lost() -> None:
    flight = Flight(GpsFix.NONE)
    flight.passes(5.0)
    flight.is_measured, flight.fix = True, GpsFix.FIX_3D
    for _ in range(60):
        assert not flight.passes(0.1)
