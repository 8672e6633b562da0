"""Changes in flight around a real autopilot in simulation: fences, limits, home, and its controller.

A ground station changes it on its own link. UAL fits what it flies, stops before it, or ends it with a reason.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.backend_of import backend_of
from tests.sitl.copter_pilot import CopterPilot
from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.troubles import Change, changed, trouble
from ual.errors import GeofenceError, TaskAbortedError, WrongStateError
from ual.geometry import Pose, Vector3
from ual.types import AltitudeReference, State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

FAST_M_S, SLOW_M_S = 5.0, 2.0
AHEAD_M = 12.0
"""It brakes from 5 m/s within 8 m of the new fence's coming."""
TOO_NEAR_M = 2.5
WIDE_M = 150.0
BRAKES_S = 4.0
WANTED_M, MOVED_M = 9.0, 6.0
WORDS_S = 2.0
"""Within this time it is known what changed the mode."""
NO_WAY_S = 10.0
OUT_M, HALF_M = 18.0, 15.0
POLYGONS, ALL_KINDS = 4.0, 7.0
"""Values of ArduPilot's FENCE_TYPE."""


@pytest.fixture
def begin(flight: Flight) -> Vector3:
    """Takes off with the autopilot's home below. Returns where it hovers."""
    flight.set_home(0.0)  # another test may have left it elsewhere
    flight.take_off()
    return flight.position()


@pytest.fixture
def new_fence(flight: Flight, simulator: Simulator) -> Iterator[Callable[[float], None]]:
    """Narrows the autopilot's own fence to a radius around its home."""
    name = {"PX4": "GF_MAX_HOR_DIST", "ArduPilot": "FENCE_RADIUS"}[simulator.autopilot]
    is_switched = [Change("FENCE_ENABLE", 1.0, 0.0)] if simulator.autopilot == "ArduPilot" else []
    flight.pilot.set_parameter(name, WIDE_M)  # another test may have left it narrow
    with changed(flight.pilot, is_switched):
        yield lambda radius_m: flight.pilot.set_parameter(name, radius_m)
        flight.pilot.set_parameter(name, WIDE_M)


@pytest.fixture
def slow(flight: Flight, simulator: Simulator) -> Iterator[Callable[[], None]]:
    """Lowers the autopilot's own speed."""
    names = {
        "PX4": (("MPC_XY_CRUISE", 1.0, 5.0), ("MPC_XY_VEL_MAX", 1.0, 12.0)),
        "ArduPilot": (("WPNAV_SPEED", 100.0, 10.0),),
    }
    parameters = names[simulator.autopilot]

    def lower() -> None:
        for name, unit, _ in parameters:
            flight.pilot.set_parameter(name, SLOW_M_S * unit)

    yield lower
    for name, unit, usual_m_s in parameters:
        flight.pilot.set_parameter(name, usual_m_s * unit)


def come_to_rest(flight: Flight) -> None:
    flight.wait_for(lambda: flight.uav.velocity().twist.linear.norm() < 0.5, "its stop", 15.0)


def test_a_new_fence_stops_a_go_to_before_it(
    flight: Flight, uav: UAL, begin: Vector3, new_fence: Callable[[float], None]
) -> None:
    """PX4 flew through a fence that UAL knew at 6 m/s, 25.7 m out of 15."""
    task = uav.go_to_waypoint(flight.offset(60.0), blocking=False, max_speed_m_s=FAST_M_S)
    flight.wait_for_speed(0.9 * FAST_M_S)
    radius_m = (flight.position() - begin).horizontal_norm() + AHEAD_M
    new_fence(radius_m)
    with pytest.raises(GeofenceError, match="this has changed in flight"):
        task.wait(PATIENCE_S)
    come_to_rest(flight)
    print(f"the new fence was at {radius_m:.1f} m; it stopped at {(flight.position() - begin).horizontal_norm():.1f} m")
    assert (flight.position() - begin).horizontal_norm() < radius_m
    assert uav.state() is State.FLYING_AUTO
    uav.land()


def test_a_new_fence_that_is_too_near_ends_the_go_to_and_then_the_failsafe_is_named(
    flight: Flight, uav: UAL, begin: Vector3, new_fence: Callable[[float], None]
) -> None:
    """UAL's own rule ends its task at once; no braking can do it, and the autopilot's failsafe takes the flight."""
    task = uav.go_to_waypoint(flight.offset(60.0), blocking=False, max_speed_m_s=FAST_M_S)
    flight.wait_for_speed(0.9 * FAST_M_S)
    new_fence((flight.position() - begin).horizontal_norm() + TOO_NEAR_M)
    with pytest.raises(GeofenceError, match="this has changed in flight"):
        task.wait(PATIENCE_S)
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.wait_for(lambda: "fence" in uav.telemetry().state_reason, "the fence's name", WORDS_S)
    with pytest.raises(WrongStateError, match="fence") as refused:
        uav.recover_from_manual()
    assert refused.value.metadata["needed"] == "force"
    uav.recover_from_manual(force=True)
    uav.land()


def test_a_speed_limit_that_is_lowered_reaches_the_running_go_to(
    flight: Flight, uav: UAL, begin: Vector3, slow: Callable[[], None], simulator: Simulator
) -> None:
    """ArduPilot flew on at 9.4 m/s for 150 m after WPNAV_SPEED had become 1.5 m/s."""
    task = uav.go_to_waypoint(Pose.at(begin.x + 70.0, begin.y, begin.z), blocking=False, max_speed_m_s=FAST_M_S)
    flight.wait_for_speed(0.9 * FAST_M_S)
    slow()
    time.sleep(BRAKES_S)
    speeds = []
    until_s = time.monotonic() + BRAKES_S
    while time.monotonic() < until_s:
        speeds.append(uav.velocity().twist.linear.horizontal_norm())
        time.sleep(0.05)
    assert not task.done()
    uav.abort()
    print(f"{simulator.autopilot}: at most {max(speeds):.1f} m/s with a limit of {SLOW_M_S:g} m/s")
    assert max(speeds) < 1.15 * SLOW_M_S + simulator.estimate_m_s
    uav.land()


@pytest.mark.parametrize("moved_m", [-MOVED_M, MOVED_M])
def test_a_height_above_home_counts_from_the_home_that_was_set_just_before(
    flight: Flight, uav: UAL, begin: Vector3, simulator: Simulator, moved_m: float
) -> None:
    """PX4 tells its home every 2 s: "9 m above home" ended at 2.8 m."""
    assert begin.z > 0.0
    here = uav.telemetry().position_geo
    assert here is not None
    assert here.altitude_amsl_m is not None
    assert here.altitude_home_m is not None
    home_m = here.altitude_amsl_m - here.altitude_home_m + moved_m
    place = (here.latitude_deg, here.longitude_deg)
    flight.pilot.order(mavlink.MAV_CMD_DO_SET_HOME, (0.0, 0.0, 0.0, 0.0, *place, home_m))
    uav.go_to_waypoint_geo(*place, WANTED_M, altitude_reference=AltitudeReference.HOME)
    there = uav.telemetry().position_geo
    assert there is not None
    assert there.altitude_amsl_m is not None
    print(f"{simulator.autopilot}: {there.altitude_amsl_m - home_m:.2f} m above the home that was set")
    assert there.altitude_amsl_m - home_m == pytest.approx(WANTED_M, abs=0.3 + simulator.wanders_m)
    uav.land()


@pytest.fixture
def outside(flight: Flight, uav: UAL, begin: Vector3, copter: CopterPilot) -> Iterator[Vector3]:
    """It is 3 m outside of a polygon that was uploaded in flight, and is recovered from the fence's return."""
    uav.go_to_waypoint(flight.offset(OUT_M))
    projection = backend_of(uav).snapshot().earth.projection
    assert projection is not None
    corners = [
        projection.to_geo(begin + Vector3(east, north, 0.0) * HALF_M)
        for east, north in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    inclusion = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    polygon = [(inclusion, float(len(corners)), corner.latitude_deg, corner.longitude_deg) for corner in corners]
    with changed(copter, (Change("FENCE_TYPE", POLYGONS, ALL_KINDS), Change("FENCE_ENABLE", 1.0, 0.0))):
        copter.upload_fence(polygon)
        flight.wait_for_state(State.FLYING_MANUAL)
        uav.recover_from_manual(force=True)
        yield begin
        copter.upload_fence([])


@pytest.fixture
def copter(pilot: Transmitter) -> CopterPilot:
    if not isinstance(pilot, CopterPilot):
        pytest.skip("an ArduCopter's ground station")
    return pilot


def test_a_go_to_leads_back_into_a_fence_that_it_is_outside_of(flight: Flight, uav: UAL, outside: Vector3) -> None:
    """ArduPilot drops a position outside its fence without a word: the go-to hung for ever."""
    uav.go_to_waypoint(Pose.at(outside.x + 5.0, outside.y, outside.z + 3.0), timeout_s=2.0 * NO_WAY_S)
    assert abs(flight.position().x - outside.x - 5.0) < 1.0
    uav.land()


def test_a_return_leads_back_into_a_fence_that_it_is_outside_of(flight: Flight, uav: UAL, outside: Vector3) -> None:
    uav.return_to_launch()
    flight.wait_for_state(State.LANDED_DISARMED)
    assert (flight.position() - outside).horizontal_norm() < 2.0


def order_landing(flight: Flight) -> None:
    """A ground station has it land here."""
    nan = float("nan")
    flight.pilot.order(mavlink.MAV_CMD_NAV_LAND, (0.0, 0.0, 0.0, 0.0, nan, nan, nan))


def reason_of_landing(flight: Flight) -> str:
    """Returns what the state's reason says of a ground station's landing, at last."""
    order_landing(flight)
    flight.wait_for_state(State.LANDING)
    time.sleep(WORDS_S)
    assert flight.uav.state() is State.LANDING
    return flight.uav.telemetry().state_reason


def test_a_ground_stations_landing_is_reported_as_that(flight: Flight, uav: UAL, begin: Vector3) -> None:
    task = uav.go_to_waypoint(Pose.at(begin.x + 20.0, begin.y, 10.0), blocking=False)
    flight.wait_for_speed(1.0)
    reason = reason_of_landing(flight)
    with pytest.raises(TaskAbortedError, match="the ground station took over") as caught:
        task.wait(PATIENCE_S)
    assert caught.value.metadata["by"] == "ground station"
    assert caught.value.metadata["state"] == State.LANDING.name
    assert "recover_from_manual" not in caught.value.message
    assert "ground station" in reason
    flight.wait_for_state(State.LANDED_DISARMED)


def test_a_ground_stations_landing_beyond_a_breached_fence_is_not_the_fences(
    flight: Flight, uav: UAL, begin: Vector3, simulator: Simulator, pilot: Transmitter
) -> None:
    """It was told as "the autopilot lands (mode POSCTL): fence"."""
    uav.go_to_waypoint(Pose.at(begin.x + 14.0, begin.y, 10.0))
    with trouble(pilot, simulator.autopilot, "fence"):
        flight.wait_for_state(State.FLYING_MANUAL)
        time.sleep(WORDS_S)
        assert "fence" in uav.telemetry().state_reason
        pilot.take_over()
        flight.wait_for(lambda: uav.telemetry().flight_mode == simulator.pilots_mode, "the pilot's mode")
        time.sleep(WORDS_S)
        reason = reason_of_landing(flight)
        assert "ground station" in reason
        assert "fence" not in reason
    flight.wait_for_state(State.LANDED_DISARMED)  # not given back before, which would end the landing


def test_a_flight_that_the_pilot_gave_back_was_commanded(
    flight: Flight, uav: UAL, begin: Vector3, copter: CopterPilot
) -> None:
    """It was told as "UAL has not been commanded in this flight", which it had flown."""
    uav.go_to_waypoint(Pose.at(begin.x + 3.0, begin.y, begin.z))
    copter.take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    copter.stand_by()
    flight.wait_for_state(State.FLYING_AUTO)
    time.sleep(WORDS_S)
    reason = uav.telemetry().state_reason
    assert "the safety pilot took it" in reason
    assert "has not been commanded" not in reason
    uav.land()
