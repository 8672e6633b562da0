"""Flights of the light simulation with stepped time: each run gives the same figures."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from benchmarks.tracker import optimal
from benchmarks.tracker.methods import FAR, PURSUIT, WAYS
from benchmarks.tracker.tracked import TrackedFlight, TrackedPosition
from ual.geometry import Pose, PoseStamped, Vector3
from ual.types import FollowPathRequest, GoToWaypointRequest, Limits, TakeOffRequest, Telemetry
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import PositionSetpoint, Setpoint
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import Tracker, VehicleSettings
from ual_daemon.vehicle.vehicle import Vehicle

STEP_S = 0.02
HEIGHT_M = 5.0
DIAGONAL = Vector3(15.0, 10.0, 5.0)
TURN_RAD = math.pi / 2
WIND_M_S = 3.0
FAST: Mapping[str, object] = {
    "horizontal_speed_m_s": 8.0,
    "vertical_speed_m_s": 3.0,
    "horizontal_acceleration_m_s2": 3.0,
    "vertical_acceleration_m_s2": 2.0,
}
VEHICLES: Mapping[str, Mapping[str, object]] = {"light": {}, "fast light": FAST}
"""The default limits of the light UAV are those of a small UAV; those of the fast one are close to PX4's."""
CORNERS, LEG_M, CORNER_RADIUS_M, ZIGZAG_M_S = 50, 8.0, 1.0, 3.0
GOAL_PERIOD_S, GOALS_S, GOALS_WITHIN_M = 0.3, 60.0, 15.0
_CALM = Vector3()
_LONGEST_S = 600.0
_AFTER_S = 5.0


class _RecordingBackend(LightBackend):
    """Records the setpoints that it gets."""

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self.sent: list[tuple[float, Setpoint]] = []

    def send(self, setpoint: Setpoint) -> None:
        self.sent.append((self.world.now_s(), setpoint))
        super().send(setpoint)


class _Uav:
    """A UAV in the air, whose time is stepped."""

    def __init__(self, tracker: Tracker, limits: Mapping[str, object], wind: Vector3) -> None:
        light = {**limits, "wind_m_s": list(wind)}
        self.backend = _RecordingBackend(BackendOptions("uav_1", settings={**light, "speed_factor": 0}))
        self.vehicle = Vehicle(self.backend, VehicleSettings(tracker=tracker))
        self.vehicle.open()
        self.places: list[TrackedPosition] = []
        self.vehicle.subscribe(self._keep)
        self._simulation = self.vehicle.simulation()
        self.run(STEP_S)
        self._simulation.pilot_arm()
        self.run(STEP_S)
        self.end(self.vehicle.commands.prepare(TakeOffRequest(HEIGHT_M)).begin())
        self.run(_AFTER_S)

    @property
    def limits(self) -> Limits:
        return self.vehicle.info().limits

    def run(self, duration_s: float) -> None:
        self._simulation.step(duration_s)

    def end(self, task: VehicleTask) -> None:
        """Steps until a task has ended; raises its error."""
        for _ in range(round(_LONGEST_S / STEP_S)):
            if task.future.done():
                break
            self.run(STEP_S)
        task.future.result(timeout=0.0)

    def position(self) -> Vector3:
        return self.places[-1].position

    def _keep(self, telemetry: Telemetry) -> None:
        pose, velocity, wanted = telemetry.pose, telemetry.velocity, telemetry.reference_pose
        if pose is not None and velocity is not None:
            reference = None if wanted is None else wanted.position
            self.places.append(TrackedPosition(telemetry.stamp_s, pose.position, velocity.linear.norm(), reference))


@contextmanager
def _flying(tracker: Tracker, limits: Mapping[str, object], wind: Vector3 = _CALM) -> Iterator[_Uav]:
    uav = _Uav(tracker, limits, wind)
    try:
        yield uav
    finally:
        uav.vehicle.close()


@dataclass(frozen=True)
class DiagonalFlight:
    """A flight along the diagonal, its planned duration, and the shortest possible duration for the same limits."""

    flown: TrackedFlight
    planned_s: float
    optimal_s: float


VELOCITIES_ONLY: Mapping[str, object] = {"takes": "velocities"}
"""An autopilot that takes no positions."""


def diagonal_flight(way: str, limits: Mapping[str, object], *, wind_m_s: float = 0.0) -> DiagonalFlight:
    """Flies once along the diagonal with a quarter turn. The wind (if any) is across."""
    tracker = Tracker.PURSUIT if way == PURSUIT else Tracker.REFERENCE
    across = Vector3(-DIAGONAL.y, DIAGONAL.x, 0.0) / DIAGONAL.horizontal_norm() * wind_m_s
    with _flying(tracker, limits, across) as uav:
        start = uav.position()
        end = start + DIAGONAL
        goal = Pose.at(end.x, end.y, end.z, TURN_RAD)
        del uav.places[:-1]
        prepared = uav.vehicle.commands.prepare(GoToWaypointRequest(PoseStamped(goal)))
        planned_s = prepared.plan.duration_s
        if planned_s is None:
            raise AssertionError("a go-to was planned without a duration")
        least_s = optimal.straight_s(DIAGONAL, uav.limits)
        if way == FAR:
            uav.vehicle.commands.setpoints.set_pose(PoseStamped(goal))
            uav.run(least_s * 2.0)
        else:
            uav.end(prepared.begin())
        uav.run(_AFTER_S)
        return DiagonalFlight(TrackedFlight(start, goal.position, list(uav.places)), planned_s, least_s)


def diagonal_flights(limits: Mapping[str, object]) -> dict[str, DiagonalFlight]:
    """Flies the same flight in each way."""
    return {way: diagonal_flight(way, limits) for way in WAYS}


@dataclass(frozen=True)
class Zigzag:
    """A flight along a zigzag: its corners, the flown places, and how far each is from the rounded path."""

    corners: Sequence[Vector3]
    flown: Sequence[Vector3]
    off_m: Sequence[float]
    peak_m_s: float


def zigzag(tracker: Tracker) -> Zigzag:
    """Flies fifty right angles, left and right."""
    with _flying(tracker, FAST) as uav:
        here = uav.position()
        legs = [Vector3(LEG_M, 0.0, 0.0), Vector3(0.0, LEG_M, 0.0)]
        corners = list(itertools.accumulate((legs[i % 2] for i in range(CORNERS + 1)), initial=here))
        uav.places.clear()
        path = [PoseStamped(Pose.at(*corner)) for corner in corners[1:]]
        motion = uav.vehicle.commands.prepare(FollowPathRequest(path, CORNER_RADIUS_M, ZIGZAG_M_S))
        uav.end(motion.begin())
        flown = [place.position for place in uav.places]
        off = [_off_rounded_m(position, corners) for position in flown]
        return Zigzag(corners, flown, off, max(place.speed_m_s for place in uav.places))


def _off_rounded_m(p: Vector3, corners: Sequence[Vector3]) -> float:
    """Returns the distance from the path, whose right-angled corners are quarter circles of the corner radius."""
    r = CORNER_RADIUS_M
    distances = []
    for number, (a, b) in enumerate(itertools.pairwise(corners)):
        way = (b - a) / LEG_M
        begin, end = (0.0 if number == 0 else r), (LEG_M if number == CORNERS else LEG_M - r)
        along = min(end, max(begin, (p - a).dot(way)))
        distances.append((p - a - way * along).norm())
    for a, b, c in zip(corners, corners[1:], corners[2:], strict=False):
        into, out = (b - a) / LEG_M, (c - b) / LEG_M
        centre = b + (out - into) * r
        from_centre = p - centre
        if from_centre.dot(into) >= 0.0 and from_centre.dot(out) <= 0.0:  # in the sector of its arc
            flat = Vector3(from_centre.dot(into), from_centre.dot(out), 0.0).norm()
            distances.append(math.hypot(flat - r, from_centre.z))
    return min(distances)


@dataclass(frozen=True)
class ChangingGoals:
    """The setpoints that were sent while the goal changed, as shares of the limits."""

    times_s: Sequence[float]
    shares: Mapping[str, Sequence[float]]


def changing_goals(seed: int = 1) -> ChangingGoals:
    """Sends goals at random places for a minute, a new one every 0.3 s."""
    chance = random.Random(seed)
    with _flying(Tracker.REFERENCE, FAST) as uav:
        centre = uav.position() + Vector3(0.0, 0.0, 2.0 * GOALS_WITHIN_M)
        uav.backend.sent.clear()
        for _ in range(round(GOALS_S / GOAL_PERIOD_S)):
            off = Vector3(*(chance.uniform(-GOALS_WITHIN_M, GOALS_WITHIN_M) for _ in range(3)))
            place = centre + off
            goal = Pose.at(place.x, place.y, place.z, chance.uniform(-math.pi, math.pi))
            uav.vehicle.commands.prepare(GoToWaypointRequest(PoseStamped(goal))).begin()
            uav.run(GOAL_PERIOD_S)
        sent = [(time_s, setpoint) for time_s, setpoint in uav.backend.sent if isinstance(setpoint, PositionSetpoint)]
        if len(sent) != len(uav.backend.sent):
            raise AssertionError("a go-to sent a setpoint without a position")
        return ChangingGoals([time_s for time_s, _ in sent[1:]], _shares(sent, uav.limits))


def _shares(sent: Sequence[tuple[float, PositionSetpoint]], limits: Limits) -> dict[str, list[float]]:
    """Returns how much each setpoint differs from the one before, as a share of the limit."""

    def of(difference: Callable[[PositionSetpoint], Vector3], horizontal: float, vertical: float) -> list[float]:
        found = []
        for (before_s, before), (after_s, after) in itertools.pairwise(sent):
            change = (difference(after) - difference(before)) / (after_s - before_s)
            found.append(max(change.horizontal_norm() / horizontal, abs(change.z) / vertical))
        return found

    speeds = limits.horizontal_speed_m_s, max(limits.climb_speed_m_s, limits.descent_speed_m_s)
    accelerations = limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2
    jerks = (accelerations[0] / optimal.RAMP_S, accelerations[1] / optimal.RAMP_S)
    return {
        "step of the position": of(lambda setpoint: setpoint.position, *speeds),
        "step of the velocity": of(lambda setpoint: setpoint.velocity, *accelerations),
        "step of the acceleration": of(lambda setpoint: setpoint.acceleration, *jerks),
    }
