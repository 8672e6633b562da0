"""The landing by velocities of `dji_vehicle_node`, where what it is flown by stops, or others take over."""

from __future__ import annotations

from tests.simulators.lockstep_dji import LockstepOsdkVehicle
from tests.ual_daemon.backends.dji.test_dji_flights import fly, ready, until, wait
from ual.types import State


def test_it_is_not_flown_aside_by_a_position_that_has_stopped() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav, 10.0)
        uav.land(blocking=False)
        wait(backend, 2.0)
        with backend.lock:
            north, east, down = backend.aircraft.body.position
            backend.aircraft.body.position = (north + 0.6, east, down)  # a gust
        wait(backend, 0.1)
        backend.bridge.faults.silent_topics.add("/dji_osdk_ros/gps_position")
        silent_s = backend.aircraft.now_s
        until(lambda: "it descends without a position" in backend.snapshot().status_text)
        until(lambda: backend.aircraft.height_m == 0.0)
        late = [velocity for time_s, velocity, _ in backend.aircraft.setpoints if time_s > silent_s + 1.1]
        assert late
        assert not [(north, east) for north, east, _ in late if north or east]
        assert abs(backend.aircraft.body.position[0] - north) < 1.5


def test_a_velocity_that_has_stopped_does_not_say_that_it_is_held_above_the_ground() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav, 10.0)
        uav.land(blocking=False)
        backend.bridge.faults.silent_topics.add("/dji_osdk_ros/velocity")
        until(lambda: "it descends without a velocity" in backend.snapshot().status_text)
        told: set[str] = set()
        while backend.aircraft.height_m > 0.0:
            told.add(backend.snapshot().status_text)
            wait(backend, 0.1)
        assert not [words for words in told if "does not descend" in words]


def test_a_position_that_comes_back_leads_it_over_the_place_again() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav, 10.0)
        uav.land(blocking=False)
        wait(backend, 1.0)
        backend.bridge.faults.silent_topics.add("/dji_osdk_ros/gps_position")
        wait(backend, 1.5)
        with backend.lock:
            _, east, down = backend.aircraft.body.position
            backend.aircraft.body.position = (2.0, east, down)
        backend.bridge.faults.silent_topics.clear()
        until(lambda: backend.aircraft.height_m == 0.0)
        until(lambda: uav.state() is State.LANDED_DISARMED)
        assert abs(backend.aircraft.body.position[0]) < 0.5
