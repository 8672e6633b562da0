"""A goal that no one can mean is refused: too far away, swapped, or at latitude and longitude 0."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.ual_daemon.stepped import Stepped, at, stepped
from ual.errors import GeofenceError
from ual.types import GeoWaypoint
from ual_daemon.settings import ConfigError, GeofenceSettings, VehicleSettings


def here(uav: Stepped) -> tuple[float, float]:
    place = uav.vehicle.telemetry().position_geo
    assert place is not None
    return place.latitude_deg, place.longitude_deg


FAR: dict[str, Callable[[Stepped, float], object]] = {
    "waypoint": lambda uav, x: uav.prepare.go_to_waypoint(at(x, 0.0, 5.0)),
    "path": lambda uav, x: uav.prepare.follow_path([at(2.0, 0.0, 5.0), at(x, 0.0, 5.0)]),
    "pose": lambda uav, x: uav.vehicle.commands.setpoints.set_pose(at(x, 0.0, 5.0)),
    "in the body's frame": lambda uav, x: uav.prepare.go_to_waypoint(at(x, 0.0, 0.0, frame_id="uav_1/base_link")),
}


@pytest.mark.parametrize("move", FAR.values(), ids=FAR)
def test_a_goal_beyond_the_distance_limit_is_refused(move: Callable[[Stepped, float], object]) -> None:
    with stepped() as uav:
        uav.fly()
        with pytest.raises(
            GeofenceError, match=r"reach of 10\.0 km \(reach_m: 10000 in the configuration\)"
        ) as refused:
            move(uav, 10_100.0)
        assert refused.value.metadata == {"setting": "reach_m"}
        move(uav, 9_900.0)


def test_the_refusal_names_the_waypoint() -> None:
    with stepped() as uav:
        uav.fly()
        with pytest.raises(GeofenceError, match=r"waypoint 1: the goal is 12\.0 km from the UAV"):
            uav.prepare.follow_path([at(1.0, 0.0, 5.0), at(12_000.0, 0.0, 5.0)])


def test_swapped_coordinates_are_recognized() -> None:
    with stepped() as uav:
        uav.fly()
        latitude_deg, longitude_deg = here(uav)
        with pytest.raises(GeofenceError, match=r"with latitude and longitude swapped it is \d+ m away"):
            uav.prepare.go_to_waypoint_geo(longitude_deg, latitude_deg + 0.0001, 10.0)
        uav.prepare.go_to_waypoint_geo(latitude_deg + 0.0001, longitude_deg, 10.0)


@pytest.mark.parametrize(
    ("latitude_sign", "longitude_sign", "mistake"),
    [(1, -1, "the longitude"), (-1, 1, "the latitude"), (-1, -1, "both")],
)
def test_a_forgotten_sign_is_recognized(latitude_sign: int, longitude_sign: int, mistake: str) -> None:
    with stepped() as uav:
        uav.fly()
        latitude_deg, longitude_deg = here(uav)
        with pytest.raises(GeofenceError, match=rf"; with the other sign of {mistake} it is 11 m away"):
            uav.prepare.go_to_waypoint_geo(
                latitude_sign * (latitude_deg + 0.0001), longitude_sign * longitude_deg, 10.0
            )


def test_a_position_that_is_far_away_by_any_sign_is_only_refused() -> None:
    with stepped() as uav:
        uav.fly()
        with pytest.raises(GeofenceError, match=r"reach_m: 10000 in the configuration\)$"):
            uav.prepare.go_to_waypoint_geo(47.0, 120.0, 10.0)


def test_latitude_and_longitude_0_are_refused_by_name() -> None:
    with stepped() as uav:
        uav.fly()
        said = "latitude and longitude 0 are what is left where none were given"
        with pytest.raises(GeofenceError, match=said):
            uav.prepare.go_to_waypoint_geo(0.0, 0.0, 10.0)
        with pytest.raises(GeofenceError, match=said):
            uav.prepare.follow_path([GeoWaypoint(0.0, 0.0, 10.0)])


@pytest.mark.parametrize(
    "settings",
    [
        VehicleSettings(map_origin_geo=(0.0, 0.0, 10.0)),
        VehicleSettings(geofence=GeofenceSettings(polygon_geo=((47.0, 8.0), (0.0, 0.0), (47.1, 8.1)))),
    ],
)
def test_a_position_of_the_configuration_is_none_at_0_0(settings: VehicleSettings) -> None:
    with pytest.raises(ConfigError, match="latitude and longitude 0"), stepped(settings):
        pass


def test_one_message_lifts_it() -> None:
    with stepped(VehicleSettings(reach_m=None)) as uav:
        uav.fly()
        uav.prepare.go_to_waypoint(at(500_000.0, 0.0, 5.0))
    with stepped(VehicleSettings(reach_m=50.0)) as uav:
        uav.fly()
        with pytest.raises(GeofenceError, match="60 m from the UAV, beyond its reach of 50 m"):
            uav.prepare.go_to_waypoint(at(60.0, 0.0, 5.0))
