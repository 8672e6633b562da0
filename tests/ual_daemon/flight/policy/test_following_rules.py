"""Rules of the watch of falls, look by look."""

from __future__ import annotations

import math
from typing import cast

import pytest

from tests.snapshots import changed
from tests.ual_daemon.flight.hand_made import Autopilot
from ual.geometry import Twist, Vector3
from ual.types import State
from ual_daemon.backends.base import Backend, BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import Control, Estimator, LandedState, Mode, Sample
from ual_daemon.flight.policy.following import Following, Trouble
from ual_daemon.flight.state import estimate
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.references import Reference, Velocity

LOOK_S, G_M_S2 = 0.1, 9.81
VELOCITY_S = 0.032


class Watched:
    """A UAV in the air, and the watch of it."""

    def __init__(self, control: Control = Control.REFERENCES, mode: str = "GUIDED", z_m: float = 6.0) -> None:
        self.autopilot = Autopilot(z=z_m, landed=LandedState.IN_AIR, control=control, mode=mode)
        self.backend = LightBackend(BackendOptions("uav_1", settings={"speed_factor": 0}))
        self.following = Following(cast("Backend", self.backend))
        self.boots_count, self.keeps_height, self.is_placed = 1, False, True
        self.reference: Reference | None = None

    def poll_once(self) -> None:
        snapshot = self.autopilot.snapshot()
        assert snapshot.control.mode is not None
        told = snapshot.control.mode.value
        mode = Mode(told.name, told.control, keeps_height=self.keeps_height)
        now_s = snapshot.time_s
        snapshot = changed(
            snapshot,
            mode=Sample(mode, now_s),
            boots_count=self.boots_count,
            estimator=Sample(Estimator(self.is_placed, ""), now_s),
        )
        self.following.observe(snapshot, estimate(snapshot, self.backend.freshness), lambda: self.reference)

    def fly(self, duration_s: float, gains_m_s2: float = 0.0) -> float | None:
        """Returns how far it had descended when a trouble was found first; None while none is."""
        begin_m = self.autopilot.z
        for _ in range(round(duration_s / LOOK_S)):
            self.autopilot.time_s += LOOK_S
            self.autopilot.z += (self.autopilot.climb_m_s - gains_m_s2 * LOOK_S / 2.0) * LOOK_S
            self.autopilot.climb_m_s -= gains_m_s2 * LOOK_S
            self.poll_once()
            if self.following.why:
                return begin_m - self.autopilot.z
        return None

    def falls_from(self, height_m: float, climbs_m_s: float, after_s: float) -> bool:
        """Falls `after_s` after a second of steady flight, by velocities of 31 Hz; lies in the end. Returns whether a
        fall is found.
        """
        begin_s = self.autopilot.time_s + 1.0 + after_s
        for _ in range(round(3.0 / VELOCITY_S)):
            self.autopilot.time_s += VELOCITY_S
            passed_s = self.autopilot.time_s - begin_s
            falls_s = max(0.0, passed_s)
            z_m = height_m + climbs_m_s * passed_s - G_M_S2 * falls_s * falls_s / 2.0
            has_hit = falls_s > 0.0 and z_m <= 0.0
            self.autopilot.z = 0.0 if has_hit else z_m
            self.autopilot.climb_m_s = 0.0 if has_hit else climbs_m_s - G_M_S2 * falls_s
            if self.autopilot.time_s >= self.following.due_s:
                self.poll_once()
        return bool(self.following.why)

    def is_down(self, height_m: float) -> bool:
        self.following.note_height(height_m, is_ground_known=True)
        return self.following.is_down

    def lie(self, landed: LandedState = LandedState.IN_AIR) -> None:
        self.autopilot.z, self.autopilot.climb_m_s, self.autopilot.landed = 0.1, 0.0, landed


@pytest.mark.parametrize("descends_m_s", [0.5, 1.5])
def test_a_fall_of_two_metres_in_a_landing_is_found_by_what_it_gains(descends_m_s: float) -> None:
    """By its speed alone it was not: 4.5 m/s come after 1 m, and last 0.2 s. ArduCopter, campaign 11200023."""
    watched = Watched(Control.LAND, "LAND")
    watched.autopilot.climb_m_s = -descends_m_s
    assert watched.fly(3.0) is None
    fallen_m = watched.fly(1.0, G_M_S2)
    assert fallen_m is not None
    assert fallen_m < 1.9


@pytest.mark.parametrize(("height_m", "climbs_m_s"), [(1.3, 0.0), (1.3, 1.5), (1.5, -0.7)])
def test_a_fall_of_half_a_second_is_found_whenever_it_begins(height_m: float, climbs_m_s: float) -> None:
    """Looks a tenth of a second apart came too late for one of four (PX4, in a mission after UAL's arming)."""
    for step in range(10):
        watched = Watched(Control.TAKE_OFF, "AUTO.MISSION", height_m)
        assert watched.falls_from(height_m, climbs_m_s, step * LOOK_S / 10.0), step


def test_a_fall_that_ends_at_the_ground_has_hit_it() -> None:
    watched = Watched()
    assert watched.falls_from(6.0, 0.0, 0.0)
    watched.following.note_height(0.1, is_ground_known=True)
    assert watched.following.has_hit
    watched.following.note_height(6.0, is_ground_known=True)
    assert not watched.following.has_hit
    watched.following.release()
    watched.following.note_height(0.1, is_ground_known=True)
    assert not watched.following.has_hit


@pytest.mark.parametrize("gains_m_s2", [1.0, 3.0, 4.0])
def test_no_descent_by_an_autopilots_own_acceleration_is_a_fall(gains_m_s2: float) -> None:
    watched = Watched(Control.LAND, "LAND", 30.0)
    watched.fly(2.0)
    assert watched.fly(4.0 / gains_m_s2, gains_m_s2) is None
    assert watched.fly(3.0) is None


@pytest.mark.parametrize(("keeps_height", "is_told"), [(True, True), (False, False)])
def test_a_fall_in_a_pilots_mode_is_reported_where_the_autopilot_bounds_the_descent(
    *, keeps_height: bool, is_told: bool
) -> None:
    """PX4, a dead motor in POSCTL, campaign 11000145. In ACRO a pilot may dive."""
    watched = Watched(Control.OTHER, "POSCTL", 9.0)
    watched.keeps_height = keeps_height
    watched.fly(2.0)
    assert (watched.fly(1.0, G_M_S2) is not None) is is_told


def test_a_pilot_who_descends_fast_does_not_fall() -> None:
    watched = Watched(Control.OTHER, "LOITER", 60.0)
    watched.keeps_height = True
    watched.fly(1.0)
    assert watched.fly(2.0, 2.5) is None  # to 5 m/s
    assert watched.fly(3.0) is None


@pytest.mark.parametrize("pause_s", [2.0, 3.0, 8.0])
def test_what_lies_after_a_pause_in_which_it_hovered_has_fallen(pause_s: float) -> None:
    """While this computer stands nothing is seen. ArduCopter hovers by itself where no setpoints come."""
    watched = Watched()
    watched.fly(2.0)
    watched.lie()
    watched.autopilot.time_s += pause_s
    watched.poll_once()
    assert watched.following.trouble is Trouble.FALL


@pytest.mark.parametrize(
    ("pause_s", "z_m", "is_told"), [(2.0, 0.1, True), (3.0, 0.1, False), (2.0, 3.0, False), (40.0, 0.1, False)]
)
def test_an_autopilot_that_may_have_landed_by_itself_in_a_pause_has_not_fallen(
    pause_s: float, z_m: float, *, is_told: bool
) -> None:
    watched = Watched(z_m=9.0 if is_told else 6.0)
    watched.fly(2.0)
    watched.autopilot.control, watched.autopilot.mode = Control.LAND, "LAND"
    watched.autopilot.z = z_m
    watched.autopilot.time_s += pause_s
    watched.poll_once()
    assert bool(watched.following.why) is is_told


def test_a_descent_that_goes_on_in_a_pause_is_no_fall() -> None:
    watched = Watched(z_m=20.0)
    watched.autopilot.climb_m_s = -1.4
    assert watched.fly(2.0) is None
    watched.autopilot.z -= 4.2
    watched.autopilot.time_s += 3.0
    watched.poll_once()
    assert watched.following.why == ""


def test_where_the_position_was_lost_it_may_be_elsewhere() -> None:
    watched = Watched()
    watched.fly(2.0)
    watched.is_placed = False
    watched.autopilot.time_s += 1.0
    watched.poll_once()
    watched.is_placed, watched.autopilot.z = True, 1.0
    watched.autopilot.time_s += 1.0
    watched.poll_once()
    assert watched.following.why == ""


def test_a_velocity_after_a_pilots_flight_is_compared_anew() -> None:
    """Errors of the flight before counted on, and the next velocity ended after 0.3 s (campaign, ArduCopter
    13400029).
    """
    watched = Watched()
    asked = Velocity(Twist(Vector3(5.0, 0.0, 0.0)), DriftCorrection(), in_body=False, expires_s=math.inf)
    watched.fly(2.0)
    watched.reference = asked
    assert watched.fly(0.5) is None
    watched.reference, watched.autopilot.control, watched.autopilot.mode = None, Control.OTHER, "LOITER"
    watched.keeps_height = True
    watched.fly(4.0)
    watched.reference, watched.autopilot.control, watched.autopilot.mode = asked, Control.REFERENCES, "GUIDED"
    assert watched.fly(2.0) is None
    assert watched.fly(3.0) is not None  # this one is never flown


@pytest.mark.parametrize(("climbs_m_s", "is_down"), [(0.2, True), (0.6, False)])
def test_what_drifts_along_the_ground_after_its_impact_is_down(climbs_m_s: float, is_down: bool) -> None:
    """A real PX4 with a dead motor: by its estimate it never stood still, and rose by 0.85 m once that worked again."""
    watched = Watched()
    assert watched.fly(1.0) is None
    assert watched.fly(1.0, G_M_S2) is not None
    watched.lie()
    watched.autopilot.drift_m_s = 0.6
    for look in range(20):
        watched.autopilot.time_s += LOOK_S
        watched.autopilot.climb_m_s = climbs_m_s if look % 4 else -climbs_m_s
        watched.poll_once()
    assert not watched.following.is_still
    assert watched.is_down(0.1) is is_down


def fallen(brakes_m_s2: float) -> Watched:
    """Returns one that has fallen, and has braked so hard."""
    watched = Watched()
    assert watched.fly(1.0) is None
    while watched.autopilot.climb_m_s > -6.0:
        watched.fly(LOOK_S, G_M_S2)
    while watched.autopilot.climb_m_s < 0.0:
        watched.fly(LOOK_S, -min(brakes_m_s2, -watched.autopilot.climb_m_s / LOOK_S))
    return watched


@pytest.mark.parametrize(("brakes_m_s2", "has_hit"), [(60.0, True), (12.0, False)])
def test_a_fall_that_ends_by_an_impact_is_down_where_its_estimate_is_a_metre_off(
    brakes_m_s2: float, has_hit: bool
) -> None:
    """A real PX4 lay still 0.9 m up by its estimate, and was not landed."""
    watched = fallen(brakes_m_s2)
    for _ in range(20):
        watched.fly(LOOK_S)
    assert watched.following.is_still
    assert watched.is_down(1.0)
    assert watched.is_down(2.0) is has_hit


def test_what_tumbles_on_the_ground_is_down_a_while_after_its_impact() -> None:
    watched = fallen(60.0)
    for is_down in (False, True):
        for look in range(20):
            watched.autopilot.time_s += LOOK_S
            watched.autopilot.climb_m_s = 1.0 if look % 2 else -1.0
            watched.poll_once()
        assert watched.is_down(1.0) is is_down


def test_a_boot_ends_what_was_reported_of_a_fall() -> None:
    """It still said for 1.2 s after the boot that it fell (campaign, 10200003)."""
    watched = Watched()
    watched.fly(2.0)
    assert watched.fly(1.0, G_M_S2) is not None
    watched.lie(LandedState.ON_GROUND)
    watched.autopilot.armed, watched.boots_count = False, 2
    watched.autopilot.time_s += 2.0
    watched.poll_once()
    assert watched.following.why == ""
    assert estimate(watched.autopilot.snapshot(), watched.backend.freshness).state is State.LANDED_DISARMED
