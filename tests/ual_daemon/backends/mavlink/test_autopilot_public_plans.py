"""Plans that others have published: dry run, upload and flight on both simulated autopilots agree with the file.

Continuous integration flies the short ones. All of them: ``UAL_TEST_ALL_PLANS=1 pytest <this file>``.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterator

import pytest

from tests.conftest import LIMIT_S
from tests.simulators.autopilot import Autopilot
from tests.simulators.lockstep import LockstepBackend
from tests.ual.missions.public_plans import FLOWN, Place, Public
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import stand_armed, wait_for_position
from ual.missions import Item, Land, Waypoint, parse
from ual.types import State, TaskStatus
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.geodesy import FlatProjection

KINDS = ("px4", "ardupilot")
SHORT = (("px4_box", "px4"), ("px4_safe_landing", "ardupilot"))
NEAR_M = 1.6
"""Within this distance the simulated autopilots pass a waypoint."""
SPEED = 200.0
"""Nothing is done amid these flights, so that they need not wait for the test."""


class Planned(Flight):
    """A UAV that stands where a plan is to begin, and what way it has flown."""

    def __init__(self, kind: str, public: Public) -> None:
        self.public = public
        super().__init__(kind)

    def start(self) -> None:
        self.way: list[Place] = []
        self.seen, self.started_s = [], self.now_s
        self.autopilot.projection = FlatProjection(*self.public.home)
        self.backend = LockstepBackend(BackendOptions("uav_1"), self.autopilot, self.port, SPEED)
        self.uav = UAL(self.backend)
        self.uav.vehicle.subscribe(lambda _: self.way.append(self.autopilot.current_position))

    def local(self, place: Place) -> Place:
        """The place in the simulated world: north, east, up from home."""
        point = self.autopilot.projection.to_local(place[0], place[1], 0.0)
        return point.y, point.x, place[2]

    def goal_of(self, last: Item) -> Place:
        """Returns the position to which a landing or a return leads."""
        place = (last.latitude_deg, last.longitude_deg) if isinstance(last, Land) else self.public.home[:2]
        return self.local((*place, 0.0))

    def items(self) -> list[Item]:
        return list(parse(self.public.text.encode(), self.public.file_name).items)


def stand_placed(flight: Planned) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    wait_for_position(flight)


def expected(public: Public, flight: Planned) -> tuple[Place, ...]:
    return tuple(flight.local(each) for each in public.way)


def passed(flown: list[Place], way: tuple[Place, ...], home: Autopilot) -> list[Place]:
    """Returns the places that were passed in their order."""
    ground_m = home.home[2] if home.home else 0.0
    found: list[Place] = []
    for north, east, down in flown:
        if len(found) < len(way) and math.dist((north, east, ground_m - down), way[len(found)]) < NEAR_M:
            found.append(way[len(found)])
    return found


def length_m(way: tuple[Place, ...]) -> float:
    return sum(math.dist(*pair) for pair in itertools.pairwise(way))


@pytest.fixture
def planned(public: Public, kind: str) -> Iterator[Planned]:
    flight = Planned(kind, public)
    yield flight
    flight.uav.close()


FIELDS = {
    round(public.home[0]): [each for each in FLOWN if round(each.home[0]) == round(public.home[0])] for public in FLOWN
}
"""The plans of one place on Earth, by its latitude."""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("publics", FIELDS.values(), ids=FIELDS.keys())
def test_what_was_uploaded_of_each_plan_is_read_back_as_the_file_has_it(kind: str, publics: list[Public]) -> None:
    flight = Planned(kind, publics[0])
    try:
        stand_placed(flight)
        for flight.public in publics:
            items = flight.items()
            kept = flight.uav.mission.upload(items)
            places = [each for each in kept.items if isinstance(each, Waypoint)]
            read = [(each.latitude_deg, each.longitude_deg, each.altitude_m) for each in places]
            assert read == [pytest.approx(each, abs=6e-8) for each in flight.public.way], flight.public.name
            assert [type(each) for each in kept.items] == [type(each) for each in items]
    finally:
        flight.uav.close()


FLIGHTS = [
    (public, kind)
    for public in FLOWN
    for kind in KINDS
    if (public.name, kind) in SHORT or "UAL_TEST_ALL_PLANS" in os.environ
]


@pytest.mark.parametrize(("public", "kind"), FLIGHTS, ids=lambda each: each if isinstance(each, str) else each.name)
def test_dry_run_and_flight_agree_with_the_file(planned: Planned, public: Public) -> None:
    stand_armed(planned)
    way, items = expected(public, planned), planned.items()
    plan = planned.uav.mission.plan(items)
    start = planned.local((*public.home[:2], 0.0))
    end = planned.goal_of(items[-1]) if public.lands else way[-1]
    down = ((*end[:2], way[-1][2]), end) if public.lands else ()
    climb = (start, (*start[:2], public.take_off_m))
    assert plan.length_m == pytest.approx(length_m((*climb, *way, *down)), rel=0.01, abs=1.0)
    assert plan.highest_m == pytest.approx(max(each[2] for each in way), abs=0.5)
    assert plan.executed_count == len(items)
    planned.uav.mission.upload(items)
    planned.way.clear()
    task = planned.uav.task(planned.uav.mission.start().id)
    assert task.wait(10.0 * LIMIT_S).status is TaskStatus.SUCCEEDED
    assert passed(list(planned.way), way, planned.autopilot) == list(way)
    if public.lands:
        planned.wait_for_state(State.LANDED_DISARMED)
        assert math.dist(planned.autopilot.current_position[:2], end[:2]) < NEAR_M
    else:
        assert planned.uav.state() is State.FLYING_AUTO
