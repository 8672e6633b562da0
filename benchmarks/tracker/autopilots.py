"""Flights of a real autopilot in its simulator, which already runs: out and back along a diagonal, in all ways.

The URLs of the autopilot and of its safety pilot come from the environment variables of tests/sitl.
"""

from __future__ import annotations

import itertools
import math
import os
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from urllib.parse import urlsplit

from typing_extensions import Self

from benchmarks.children import ChildError
from benchmarks.tracker.methods import FAR, OURS, PURSUIT
from benchmarks.tracker.tracked import NEAR_M, TrackedFlight, TrackedPosition
from benchmarks.tracker.truth import Truth
from tests.sitl.copter_pilot import CopterPilot
from tests.sitl.pilot import SafetyPilot
from tests.sitl.transmitter import Transmitter
from ual.geometry import Pose, Vector3
from ual.types import Limits, State, Telemetry
from ual_daemon import UAL
from ual_daemon.settings import Tracker, VehicleSettings

DIAGONAL = Vector3(15.0, 10.0, 5.0)
TURN_RAD = math.pi / 2
LOW_M = 3.0
_PATIENCE_S = 90.0
_AFTER_S = 5.0
"""Seconds for which each flight is recorded after it came near its goal; then the next one begins."""
_LONGEST_S = 60.0


@dataclass(frozen=True)
class TrackedAutopilot:
    """The URLs of one autopilot."""

    name: str
    url_variable: str
    pilot_variable: str
    make_pilot: Callable[[str, int], Transmitter]

    @property
    def missing(self) -> str:
        """Returns the variables that are not set; empty if it can be flown."""
        return " and ".join(name for name in (self.url_variable, self.pilot_variable) if not os.environ.get(name))

    @contextmanager
    def pilot(self) -> Iterator[Transmitter]:
        """Provides its safety pilot, which must be connected as long as it flies."""
        address = urlsplit(os.environ[self.pilot_variable])
        if address.hostname is None or address.port is None:
            raise ChildError(f"{self.pilot_variable} is no URL with a host and a port")
        pilot = self.make_pilot(address.hostname, address.port)
        try:
            pilot.begin()
            yield pilot
        finally:
            pilot.close()


PX4 = TrackedAutopilot("PX4", "UAL_TEST_PX4_URL", "UAL_TEST_PX4_PILOT", SafetyPilot)
ARDUPILOT = TrackedAutopilot("ArduPilot", "UAL_TEST_ARDUPILOT_URL", "UAL_TEST_ARDUPILOT_PILOT", CopterPilot)


@dataclass(frozen=True)
class AutopilotFlights:
    """Returns all flights of one autopilot, by way."""

    version: str
    limits: Limits
    flights: Mapping[str, list[TrackedFlight]]


def fly(autopilot: TrackedAutopilot, flights: int) -> AutopilotFlights:
    """Flies several times in each way, half of them out (up) and half of them back; one daemon for each tracker."""
    found: dict[str, list[TrackedFlight]] = defaultdict(list)
    rounds = math.ceil(flights / 2)
    with autopilot.pilot() as pilot:
        low: Pose | None = None
        truth = Truth()
        truth.listen(pilot)
        for tracker, ways in ((Tracker.REFERENCE, (OURS, FAR)), (Tracker.PURSUIT, (PURSUIT,))):
            with RealUav(autopilot, tracker, truth) as uav:
                if low is None:
                    low = uav.take_off(pilot)
                    version, limits = f"{autopilot.name} {uav.ual.info().autopilot_version}", uav.ual.info().limits
                    end = low.position + DIAGONAL
                    high = Pose.at(end.x, end.y, end.z, low.yaw_rad + TURN_RAD)
                uav.take_control(low)
                for number, way in itertools.product(range(1, rounds + 1), ways):
                    print(f"{version}, {way}: {number} of {rounds}, out and back", file=sys.stderr, flush=True)
                    for start, goal in ((low, high), (high, low)):
                        found[way].append(uav.fly(way, start, goal))
                if tracker is Tracker.PURSUIT:
                    uav.land()
    return AutopilotFlights(version, limits, found)


class RealUav:
    """The UAV, flown with the class interface; made anew, in the air, for another tracker."""

    def __init__(self, autopilot: TrackedAutopilot, tracker: Tracker, truth: Truth | None = None) -> None:
        self.ual = UAL(
            "mavlink", "uav_1", url=os.environ[autopilot.url_variable], settings=VehicleSettings(tracker=tracker)
        )
        self._places: list[TrackedPosition] = []
        self.truth = truth or Truth()
        self.ual.subscribe(self._keep)

    def __enter__(self) -> Self:
        try:
            self._until(self.ual.is_ready, "a state")
            # The parameters come one by one; until then defaults are used.
            self._until(lambda: self.ual.info().limits.horizontal_speed_m_s > Limits().horizontal_speed_m_s, "limits")
            self._until(lambda: self.ual.info().limits.yaw_rate_rad_s != Limits().yaw_rate_rad_s, "limits")
        except BaseException:
            self.ual.close()
            raise
        return self

    def __exit__(self, *exc: object) -> None:
        self.ual.close()

    def take_off(self, pilot: Transmitter) -> Pose:
        """Returns where it hovers afterwards."""
        pilot.wait_until_ready()
        pilot.arm()
        self._until(lambda: self.ual.state() is State.LANDED_ARMED, "armed")
        self.ual.take_off(LOW_M)
        time.sleep(_AFTER_S)
        return self.ual.pose().pose

    def take_control(self, at: Pose) -> None:
        """Takes control from the autopilot's hold, in which the previous daemon has left it."""
        self._until(lambda: self.ual.state() in (State.FLYING_AUTO, State.FLYING_MANUAL), "in the air")
        if self.ual.state() is State.FLYING_MANUAL:
            self.ual.recover_from_manual()
        self.ual.set_pose(at)
        time.sleep(_AFTER_S)

    def land(self) -> None:
        self.ual.land()
        self._until(lambda: self.ual.state() is State.LANDED_DISARMED, "disarmed")

    def fly(self, way: str, start: Pose, goal: Pose) -> TrackedFlight:
        """Flies from one hover to the next."""
        self._places = []
        if way == FAR:
            self.ual.set_pose(goal)
        else:
            self.ual.go_to_waypoint(goal, blocking=False)
        self._until(lambda: self._is_near(goal.position), f"at its goal ({way})", _LONGEST_S)
        time.sleep(_AFTER_S)
        return TrackedFlight(start.position, goal.position, list(self._places))

    def _is_near(self, goal: Vector3) -> bool:
        return bool(self._places) and (self._places[-1].position - goal).norm() <= NEAR_M

    def _keep(self, telemetry: Telemetry) -> None:
        pose, velocity, wanted = telemetry.pose, telemetry.velocity, telemetry.reference_pose
        if pose is not None and velocity is not None:
            reference = None if wanted is None else wanted.position
            true = self.truth.position
            speed_m_s, has_task = velocity.linear.norm(), telemetry.task is not None
            self._places.append(TrackedPosition(telemetry.stamp_s, pose.position, speed_m_s, reference, true, has_task))

    def _until(self, condition: Callable[[], bool], what: str, limit_s: float = _PATIENCE_S) -> None:
        until_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > until_s:
                raise ChildError(f"it is not {what} after {limit_s:g} s: {self.ual.telemetry()}")
            time.sleep(0.01)
