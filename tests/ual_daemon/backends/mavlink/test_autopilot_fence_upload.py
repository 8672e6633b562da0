"""A fence that UAL uploads to simulated autopilots: kept by both, over a bad link too, and nothing is flown into it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators import ArduPilot, Faults
from tests.simulators.mission_store import FENCE, RALLY
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import HEIGHT_M, Flight
from ual.errors import GeofenceError, RejectedByAutopilotError, WrongStateError
from ual.fences import FencePlan, FenceZone, RallyPoint
from ual.geometry import Pose
from ual.types import AltitudeReference, State
from ual_daemon.backends.firmwares.mission_items import MissionItem
from ual_daemon.settings import GeofenceSettings, VehicleSettings

KINDS = ["px4", "ardupilot"]
Fly = Callable[..., Flight]


@pytest.fixture
def start() -> Iterator[Fly]:
    """Starts a daemon with an autopilot that has no fence, which then stands on the ground."""
    flights: list[Flight] = []

    def started(kind: str, settings: VehicleSettings | None = None) -> Flight:
        flight = Flight(kind)
        flights.append(flight)
        if kind == "px4":
            flight.autopilot.parameters["GF_ACTION"] = 0
        flight.kill()
        flight.settings = settings
        flight.start()
        flight.wait_for_state(State.LANDED_DISARMED)
        flight.wait_for(lambda: flight.uav.telemetry().position_geo is not None, "its place on Earth")
        return flight

    yield started
    for flight in flights:
        flight.uav.close()


def current_position(flight: Flight, north_m: float, east_m: float) -> tuple[float, float]:
    latitude, longitude, _ = flight.autopilot.geo((north_m, east_m, 0.0))
    return latitude / 1e7, longitude / 1e7


def field(flight: Flight, half_m: float = 30.0) -> FenceZone:
    corners = ((-half_m, -half_m), (half_m, -half_m), (half_m, half_m), (-half_m, half_m))
    return FenceZone(True, tuple(current_position(flight, *each) for each in corners))


def plan(flight: Flight) -> FencePlan:
    pond = FenceZone(False, (current_position(flight, 15.0, 0.0),), 5.0)
    points = (
        RallyPoint(*current_position(flight, 5.0, 5.0), 20),
        RallyPoint(*current_position(flight, -5.0, 5.0), 520, AltitudeReference.AMSL),
    )
    return FencePlan((field(flight), pond), points)


def known_count(flight: Flight) -> int:
    """Returns the number of zones that UAL knows of."""
    own = flight.backend.snapshot().autopilot_fence
    return 0 if own is None else len(own.zones)


def is_applied(flight: Flight) -> bool:
    parameters = flight.autopilot.parameters
    if isinstance(flight.autopilot, ArduPilot):
        return parameters["FENCE_ENABLE"] == 1 and bool(int(parameters["FENCE_TYPE"]) & 4)
    return parameters["GF_ACTION"] == 2


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_uploaded_is_kept_applied_and_respected_by_ual(start: Fly, kind: str) -> None:
    flight = start(kind)
    uav, wanted = flight.uav, plan(flight)
    kept = uav.fence.upload(wanted)
    assert (kept.zones, kept.rally_points, kept.is_enabled) == (wanted.zones, wanted.rally_points, True)
    assert is_applied(flight)
    assert len(flight.autopilot.missions.lists[FENCE]) == 5
    assert len(flight.autopilot.missions.lists[RALLY]) == 2
    flight.wait_for(lambda: known_count(flight) == 2, "what was uploaded is known")
    flight.take_off()
    with pytest.raises(GeofenceError, match=r"beyond the autopilot's own fence \(exclusion circle 1 of 1"):
        uav.go_to_waypoint(Pose.at(0.0, 25.0, HEIGHT_M))
    with pytest.raises(WrongStateError, match="the UAV is armed"):
        uav.fence.clear()
    flight.land()
    flight.wait_for_state(State.LANDED_DISARMED)
    cleared = uav.fence.clear(with_rally_points=True)
    assert (cleared.zones, cleared.rally_points) == ((), ())
    assert uav.fence.disable().is_enabled is False


@pytest.mark.parametrize("kind", KINDS)
def test_the_configured_polygon_is_uploaded_where_none_is_passed(start: Fly, kind: str) -> None:
    corners = ((-20.0, -20.0), (40.0, -20.0), (40.0, 20.0), (-20.0, 20.0))
    flight = start(kind, VehicleSettings(geofence=GeofenceSettings(polygon=corners)))
    [zone] = flight.uav.fence.upload().zones
    assert zone.is_inclusion
    for (x_m, y_m), (latitude_deg, longitude_deg) in zip(corners, zone.points, strict=True):
        assert (latitude_deg, longitude_deg) == pytest.approx(current_position(flight, y_m, x_m), abs=2e-7)  # x is east


@pytest.mark.parametrize("kind", KINDS)
def test_a_fence_is_whole_over_a_link_that_loses_a_fifth_and_doubles(start: Fly, kind: str) -> None:
    flight = start(kind)
    flight.link.down = flight.link.up = Faults(loss=0.2, jitter_s=0.05, duplication=0.1)
    wanted = plan(flight)
    kept = flight.uav.fence.upload(wanted)
    assert (kept.zones, kept.rally_points, kept.is_enabled) == (wanted.zones, wanted.rally_points, True)
    with flight.autopilot.lock:
        assert len(flight.autopilot.missions.lists[FENCE]) == 5


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_autopilot_refuses_is_reported_and_what_it_had_stays(start: Fly, kind: str) -> None:
    flight = start(kind)
    many = FencePlan((field(flight), *(FenceZone(False, (current_position(flight, 25.0, 25.0),), 1.0),) * 100))
    with pytest.raises(RejectedByAutopilotError, match="fence: the autopilot answers NO_SPACE"):
        flight.uav.fence.upload(many)
    assert flight.autopilot.missions.lists[FENCE] == []
    assert not is_applied(flight)
    flight.autopilot.missions.refusal = mavlink.MAV_MISSION_UNSUPPORTED
    with pytest.raises(RejectedByAutopilotError, match="UNSUPPORTED"):
        flight.uav.fence.get()


def test_a_fence_of_ual_that_the_autopilot_lacks_is_reported_once(start: Fly, caplog: pytest.LogCaptureFixture) -> None:
    def status_text() -> int:
        return [vars(each).get("ual_event") for each in caplog.records].count("autopilot_lacks_fence")

    configured = VehicleSettings(geofence=GeofenceSettings(polygon=((-20.0, -20.0), (40.0, -20.0), (40.0, 20.0))))
    with caplog.at_level(logging.WARNING):
        flight = start("px4", configured)
        flight.wait_for(lambda: status_text() == 1, "what the autopilot lacks")
        flight.let_pass(3.0)
        assert status_text() == 1
        caplog.clear()
        start("px4")  # without a geofence of its own
    assert status_text() == 0


@pytest.mark.parametrize("replace", [False, True])
def test_ardupilots_point_to_return_to_is_shown_and_kept_until_all_is_removed(start: Fly, replace: bool) -> None:
    flight = start("ardupilot")
    back = current_position(flight, 3.0, 4.0)
    point = MissionItem(0, mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT, x=round(back[0] * 1e7), y=round(back[1] * 1e7))
    flight.autopilot.missions.keep(FENCE, [point])
    assert flight.uav.fence.get().return_point == back
    kept = flight.uav.fence.upload(FencePlan((field(flight),)), replace=replace)
    assert (kept.return_point, kept.zones) == (back, (field(flight),))
    assert [each.command for each in flight.autopilot.missions.lists[FENCE]] == [5000, 5001, 5001, 5001, 5001]
    assert flight.uav.fence.clear().return_point is None
    assert flight.autopilot.missions.lists[FENCE] == []


def test_what_is_no_fence_is_replaced(start: Fly) -> None:
    flight = start("ardupilot")
    flight.autopilot.missions.keep(FENCE, [MissionItem(0, 5001, 4.0, x=470000000, y=80000000)])
    with pytest.raises(RejectedByAutopilotError, match="is no fence"):
        flight.uav.fence.upload(FencePlan((field(flight),)))
    assert flight.uav.fence.upload(FencePlan((field(flight),)), replace=True).zones == (field(flight),)
