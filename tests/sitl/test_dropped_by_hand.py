"""A pilot who drops it by hand, and gives control back: it takes no motion where it lies, but a landing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from tests.sitl.copter_pilot import CopterPilot
from tests.sitl.doing import HEIGHT_M
from tests.sitl.flights import Flight
from tests.sitl.transmitter import Sticks, Transmitter
from tests.sitl.troubles import Change, changed
from tests.sitl.truth import Truth
from ual.errors import WrongStateError
from ual.geometry import Pose, Twist, Vector3
from ual.types import State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300), pytest.mark.usefixtures("lands_in_the_end")]

MODES = {"STABILIZE": 0.0, "ACRO": 1.0}
SET_DOWN, DROPPED = Sticks(up=-0.25), Sticks(up=-1.0)
WATCHED_S, STAYS_M = 5.0, 0.3


@pytest.fixture(params=[*MODES])
def under_pilot(request: pytest.FixtureRequest, flight: Flight, pilot: Transmitter, truth: Truth) -> Iterator[Flight]:
    """In its hover, once the truth has seen the ground. By the pilot's switch nothing bounds its descent."""
    if not isinstance(pilot, CopterPilot):
        pytest.skip("an ArduCopter's switch")
    with changed(pilot, (Change("FLTMODE5", MODES[request.param], 5.0),)):
        flight.be_armed()
        flight.uav.take_off(HEIGHT_M)
        assert truth.height_m > HEIGHT_M - 1.0
        yield flight
        pilot.sticks = Sticks()
        pilot.stand_by()


@pytest.mark.parametrize("sticks", [SET_DOWN, DROPPED], ids=["set down", "dropped"])
def test_what_lies_after_a_flight_by_hand_is_not_lifted_off_by_a_motion(
    under_pilot: Flight, uav: UAL, pilot: Transmitter, truth: Truth, sticks: Sticks
) -> None:
    """It lifted off by the first go-to or velocity after the switch, though UAL said that it may lie there."""
    flight = under_pilot
    pilot.take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    pilot.sticks = sticks
    flight.wait_for(lambda: truth.is_down, "that it lies")
    time.sleep(1.0)  # it rebounds: ArduCopter goes on upwards where it is in GUIDED meanwhile
    pilot.sticks = Sticks()
    pilot.stand_by()
    heights_m, accepted, until_s = [truth.height_m], list[str](), time.monotonic() + WATCHED_S
    goal = Pose.at(flight.position().x + 3.0, flight.position().y, HEIGHT_M)
    motions: dict[str, Callable[[], object]] = {
        "go_to": partial(uav.go_to_waypoint, goal, blocking=False),
        "velocity": partial(uav.set_velocity, Twist(Vector3(0.5, 0.0, 0.5))),
        "take_off": partial(uav.take_off, HEIGHT_M, blocking=False),
    }
    while time.monotonic() < until_s:
        for name, motion in motions.items():
            try:
                motion()
            except WrongStateError:
                continue
            accepted.append(f"{name}: {uav.telemetry().state_reason}")
        heights_m.append(truth.height_m)
        time.sleep(0.1)  # between two tries
    print(f"{pilot.autopilot}: rose {max(heights_m) - heights_m[0]:.2f} m: {uav.telemetry().state_reason}")
    assert accepted == []
    assert max(heights_m) - heights_m[0] < STAYS_M
    if uav.state() is State.FLYING_AUTO:
        uav.land()
