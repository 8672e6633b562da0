"""Positions to which velocities lead PX4 and ArduCopter whose estimates err, from any beginning: `craft` flies them.

Each flight is compared with that of a twin without errors, wind or drag, which is where the velocity leads.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.ual_daemon.tracker.craft import ARDUPILOT, LIMITS, PX4, STEP_S, Craft, ErrorAt, FlightTrace
from ual.geometry import Vector3
from ual_daemon.backends.values import VelocityResponses
from ual_daemon.tracker.references import Hold, TrajectoryReference
from ual_daemon.tracker.velocity_end_point import MOST_CHANGE_M_S2, ExpectedMotion
from ual_daemon.trajectory import Motion, PathWaypoint, StraightTrajectory, path

BESIDE_M = 0.3
MADE = 0.05
FLOWN_S = 15.0
_CORNER_AFTER_S = 3.0


@dataclass(frozen=True)
class Errors:
    """Errors of the estimate: amplitude (m/s, m) and period, the drag and the push of gusts."""

    velocity_m_s: Vector3 = field(default_factory=Vector3)
    position_m: Vector3 = field(default_factory=Vector3)
    period_s: float = 30.0
    phase_rad: float = 0.0
    drag_1_s: float = 0.0
    gusts_m_s2: Vector3 = field(default_factory=Vector3)

    def craft(self, responses: VelocityResponses, *, is_drag_known: bool = True) -> Craft:
        return Craft(
            responses,
            self._wave(self.velocity_m_s, 1.0),
            self._wave(self.position_m, 0.7),
            self._wave(self.gusts_m_s2, 4.0),
            self.drag_1_s,
            is_drag_known,
        )

    def _wave(self, amplitude: Vector3, pace: float) -> ErrorAt:
        def at(time_s: float) -> Vector3:
            angle_rad = math.tau * pace * time_s / self.period_s + self.phase_rad
            return Vector3(
                amplitude.x * math.sin(angle_rad), amplitude.y * math.cos(angle_rad), amplitude.z * math.sin(angle_rad)
            )

        return at


def hold(flown: FlightTrace) -> None:
    flown.fly(Hold(Vector3(), 0.0), 6.0)


def go_to(flown: FlightTrace) -> None:
    hold(flown)
    line = StraightTrajectory(Motion(Vector3(), 0.0), Vector3(30.0, -10.0, 2.0), 0.0, LIMITS)
    flown.fly(TrajectoryReference(line, flown.craft.now_s), 5.0)


def corner(flown: FlightTrace) -> None:
    hold(flown)
    waypoints = [PathWaypoint(Vector3(6.0), 0.0), PathWaypoint(Vector3(6.0, 20.0), 0.0)]
    chain = path(Motion(Vector3(), 0.0), waypoints, 3.0, LIMITS)
    flown.fly(TrajectoryReference(chain, flown.craft.now_s), _CORNER_AFTER_S)


def turn(flown: FlightTrace) -> None:
    hold(flown)
    flown.fly(flown.velocity(Vector3(1.0, -1.0)), 5.0)


def stopped(flown: FlightTrace) -> None:
    turn(flown)
    flown.fly(flown.velocity(Vector3()), 1.0)


BEGINNINGS: Sequence[Callable[[FlightTrace], None]] = (hold, go_to, corner, turn, stopped)
amplitudes = st.builds(Vector3, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.2, 0.2))
angles, speeds = st.floats(0.0, math.tau), st.floats(0.3, 3.0)
errors = st.builds(
    Errors,
    amplitudes,
    amplitudes.map(lambda each: each * 0.5),
    st.floats(25.0, 60.0),
    st.floats(0.0, math.tau),
    st.floats(0.0, 0.3),
    amplitudes.map(lambda each: each * 0.4),
)


@dataclass(frozen=True)
class Off:
    """Distances of a flight from its twin: when it began; then across the velocity, along it, in height, at most; and
    the speed of the correction's changes.
    """

    begun_m: float
    beside_m: float
    along_m: float
    height_m: float
    change_m_s2: float


def fly(craft: Craft, begin: Callable[[FlightTrace], None], velocities: Sequence[Vector3]) -> Off:
    """Flies the velocities, each for the same part of `FLOWN_S`."""
    flown, twin = FlightTrace(craft), FlightTrace(Craft(craft.responses))
    begin(flown)
    begin(twin)
    begun_m = (flown.craft.estimate - twin.craft.estimate).horizontal_norm()
    beside, along, height = [0.0], [0.0], [0.0]
    changes: list[float] = []
    for velocity in velocities:
        duration_s = FLOWN_S / len(velocities)
        ahead = velocity / velocity.norm() if velocity.norm() else Vector3()
        for here, there in zip(
            flown.fly(flown.velocity(velocity), duration_s), twin.fly(twin.velocity(velocity), duration_s), strict=True
        ):
            off = here - there
            beside.append((off - ahead * off.dot(ahead)).horizontal_norm())
            along.append(abs(off.dot(ahead)))
            height.append(abs(off.z))
        changes += flown.changes_m_s2
    return Off(begun_m, max(beside), max(along), max(height), max(changes))


def along(angle_rad: float, speed_m_s: float) -> Vector3:
    return Vector3(math.cos(angle_rad), math.sin(angle_rad)) * speed_m_s


@pytest.mark.parametrize("begin", BEGINNINGS)
@settings(max_examples=5, deadline=None)
@given(errors=errors, angle_rad=angles, speed_m_s=speeds)
def test_px4_is_led_from_the_first_moment_on(
    begin: Callable[[FlightTrace], None], errors: Errors, angle_rad: float, speed_m_s: float
) -> None:
    off = fly(errors.craft(PX4), begin, [along(angle_rad, speed_m_s)])
    assert off.beside_m < BESIDE_M + (off.begun_m if begin is go_to else 0.0)  # a fast go-to is off its way already
    assert off.height_m < BESIDE_M
    assert off.along_m < MADE * speed_m_s * FLOWN_S + 0.1
    assert off.change_m_s2 <= MOST_CHANGE_M_S2 + 1e-6


@pytest.mark.parametrize("begin", BEGINNINGS)
@settings(max_examples=3, deadline=None)
@given(errors=errors, angle_rad=angles, speed_m_s=speeds)
def test_arducopter_is_led_from_the_first_moment_on(
    begin: Callable[[FlightTrace], None], errors: Errors, angle_rad: float, speed_m_s: float
) -> None:
    errors = replace(errors, velocity_m_s=errors.velocity_m_s * 0.2, drag_1_s=0.0)  # its estimate errs by less
    off = fly(errors.craft(ARDUPILOT), begin, [along(angle_rad, speed_m_s)])
    assert off.beside_m < BESIDE_M
    assert off.height_m < BESIDE_M
    assert off.along_m < MADE * speed_m_s * FLOWN_S + 0.1
    assert off.change_m_s2 <= MOST_CHANGE_M_S2 + 1e-6


@settings(max_examples=5, deadline=None)
@given(errors=errors, turns=st.lists(angles, min_size=15, max_size=15), speed_m_s=speeds)
def test_a_change_of_direction_each_second_carries_it_nowhere_else(
    errors: Errors, turns: list[float], speed_m_s: float
) -> None:
    off = fly(errors.craft(PX4), hold, [along(angle_rad, speed_m_s) for angle_rad in turns])
    assert off.beside_m < BESIDE_M


@settings(max_examples=5, deadline=None)
@given(errors=errors, angle_rad=angles)
def test_drag_that_is_not_learned_yet_shortens_the_path_by_less_than_a_twentieth(
    errors: Errors, angle_rad: float
) -> None:
    errors = replace(errors, drag_1_s=1.0)  # that of PX4's simulator: of a real multirotor it is 0.1 to 0.5
    off = fly(errors.craft(PX4, is_drag_known=False), hold, [along(angle_rad, 1.0)])
    assert off.beside_m < BESIDE_M
    assert off.along_m < MADE * FLOWN_S + 0.1


@pytest.mark.parametrize("drag_1_s", [0.0, 0.3])
@pytest.mark.parametrize("commanded", [Vector3(), Vector3(0.0, 1.0), Vector3(-2.0)])
def test_px4_brakes_out_of_a_fast_go_to_as_is_expected(drag_1_s: float, commanded: Vector3) -> None:
    """Its integral, wound up while it brakes, held it 0.6 to 0.7 m before the place for seconds."""
    flown = FlightTrace(Errors(drag_1_s=drag_1_s).craft(PX4))
    hold(flown)
    line = StraightTrajectory(Motion(Vector3(), 0.0), Vector3(60.0), 0.0, replace(LIMITS, horizontal_speed_m_s=5.0))
    reference = TrajectoryReference(line, flown.craft.now_s)
    flown.fly(reference, 6.0)
    before = reference.motion(flown.craft.snapshot())
    expected = ExpectedMotion(before.position, before.velocity, before.acceleration, PX4.horizontal)
    velocity = flown.velocity(commanded)
    for _ in range(round(FLOWN_S / STEP_S)):
        (here,) = flown.fly(velocity, STEP_S)
        expected.advance(commanded, STEP_S, PX4.horizontal)
        assert (here - expected.position).horizontal_norm() < BESIDE_M


def test_a_velocity_of_0_after_a_hold_is_not_felt() -> None:
    flown = FlightTrace(Errors(velocity_m_s=Vector3(0.4, -0.4)).craft(PX4))
    hold(flown)
    before = flown.craft.acceleration
    still = flown.velocity(Vector3())
    for _ in range(25):
        flown.fly(still, STEP_S)
        assert (flown.craft.acceleration - before).norm() < 0.15


def test_it_rests_where_it_stops_and_is_not_pulled_back() -> None:
    for responses in (PX4, ARDUPILOT):
        flown = FlightTrace(Errors(drag_1_s=0.3).craft(responses))
        hold(flown)
        flown.fly(flown.velocity(Vector3(5.0)), 8.0)
        stop = [place.x for place in flown.fly(flown.velocity(Vector3()), 10.0)]
        assert max(stop) - stop[-1] < 0.35


@pytest.mark.parametrize("speed_m_s", [0.3, 1.0, 3.0])
def test_what_stops_it_is_pushed_for_moments_only_and_left_without_a_pull(speed_m_s: float) -> None:
    flown = FlightTrace(Craft(PX4))
    hold(flown)
    ahead = flown.velocity(Vector3(speed_m_s))
    flown.fly(ahead, 5.0)
    flown.craft.is_stuck = True
    flown.fly(ahead, 3.0)
    for is_stuck in (True, False):
        flown.craft.is_stuck = is_stuck
        for _ in range(100):
            flown.fly(ahead, STEP_S)
            assert flown.drift.velocity.x < 0.05
