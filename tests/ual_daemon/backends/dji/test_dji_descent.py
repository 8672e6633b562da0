"""The landing by velocities of `dji_vehicle_node`, where what it is flown by stops, or others take over."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.simulators.dji import STEP_S
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdkVehicle
from tests.simulators.rosbridge import RefusedError
from tests.ual_daemon.backends.dji.test_dji_flights import fly, ready, thread_paused, wait
from tests.waiting import LIMIT_S, until
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError
from ual.types import State


def test_it_is_not_executed_aside_by_a_position_that_has_stopped() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav, 10.0)
        task = uav.land(blocking=False)
        wait(backend, 2.0)
        with backend.lock:
            north, east, down = backend.aircraft.body.position
            backend.aircraft.body.position = (north + 0.6, east, down)  # a gust
        wait(backend, 0.1)
        backend.bridge.faults.silent_topics.add("/dji_osdk_ros/gps_position")
        silent_s = backend.aircraft.now_s
        until(lambda: "it descends without a position" in task.info().description)
        until(lambda: backend.aircraft.height_m == 0.0)
        late = [velocity for time_s, velocity, _ in backend.aircraft.setpoints if time_s > silent_s + 1.1]
        assert late
        assert not [(north, east) for north, east, _ in late if north or east]
        assert abs(backend.aircraft.body.position[0] - north) < 1.5


def test_a_velocity_that_has_stopped_does_not_say_that_it_is_held_above_the_ground() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav, 10.0)
        task = uav.land(blocking=False)
        backend.bridge.faults.silent_topics.add("/dji_osdk_ros/velocity")
        until(lambda: "it descends without a position and a velocity" in task.info().description)
        told: set[str] = set()
        while backend.aircraft.height_m > 0.0:
            told.add(task.info().description)
            wait(backend, 0.1)
        assert not [text for text in told if "has not descended" in text]


def test_a_position_that_comes_back_leads_it_over_the_position_again() -> None:
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


def stall(backend: LockstepDji, seconds: float, meanwhile: Callable[[], None]) -> None:
    """The wrapper is silent for a while, and something happens in the beginning."""
    backend.bridge.faults.silent_topics.update(backend.bridge.nodes[0].topics)
    wait(backend, 0.3)
    with backend.lock:
        meanwhile()
    wait(backend, seconds - 0.3)
    backend.bridge.faults.silent_topics.clear()


def pause(backend: LockstepDji, seconds: float, meanwhile: Callable[[], None]) -> None:
    """The thread that hears the aircraft does not run for a while, and something happens in the beginning."""
    with thread_paused(backend):
        end_s = backend.aircraft.now_s + seconds
        meanwhile()
        while backend.aircraft.now_s < end_s:
            with backend.lock:
                backend.bridge.step(backend.bridge.now_s + STEP_S)


def let_another_program_hold_it(backend: LockstepDji) -> None:
    """Another program flies it from now on, with the authority that it got from the pilot."""
    aircraft = backend.aircraft
    step = aircraft.step

    def step_held() -> None:
        aircraft.command((0.0, 0.0, 0.0), 0.0)
        step()

    aircraft.step = step_held  # type: ignore[method-assign]


@pytest.mark.parametrize("blinded", [stall, pause])
@pytest.mark.parametrize("seconds", [1.3, 5.0])
def test_it_does_not_go_on_in_the_flight_of_another_after_a_silence(
    blinded: Callable[[LockstepDji, float, Callable[[], None]], None], seconds: float
) -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav, 20.0)
        task = uav.land(blocking=False)
        wait(backend, 1.5)
        blinded(backend, seconds, lambda: let_another_program_hold_it(backend))
        back_s, height_m = backend.aircraft.now_s, backend.aircraft.height_m
        with pytest.raises((LinkLostError, TaskAbortedError), match=r"nothing heard|others may fly|mode"):
            task.wait(LIMIT_S)
        wait(backend, 4.0)
        assert not [time_s for time_s, (_, _, down), _ in backend.aircraft.setpoints if time_s > back_s and down > 0.2]
        assert backend.aircraft.height_m > height_m - 0.5


def test_it_hovers_after_a_silence_until_it_is_commanded_again() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav, 10.0)
        uav.land(blocking=False)
        wait(backend, 1.5)
        stall(backend, 1.3, lambda: None)
        until(lambda: uav.state() is State.FLYING_AUTO)
        height_m = backend.aircraft.height_m
        wait(backend, 3.0)
        assert backend.aircraft.height_m == pytest.approx(height_m, abs=0.3)
        uav.land()
        assert uav.state() is State.LANDED_DISARMED


def refuse_to_stop(backend: LockstepDji, count: int) -> list[tuple[float, int]]:
    """The motors do not stop so many times. Returns the time of the request, and the holder of the authority."""
    asked: list[tuple[float, int]] = []
    aircraft = backend.aircraft
    stop_motors = aircraft.stop_motors

    def stop_or_refuse() -> None:
        asked.append((aircraft.now_s, aircraft.device))
        if len(asked) <= count:
            raise RefusedError("busy")
        stop_motors()

    aircraft.stop_motors = stop_or_refuse  # type: ignore[method-assign]
    return asked


def test_motors_that_do_not_stop_at_first_are_stopped_again() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav)
        asked = refuse_to_stop(backend, 1)
        uav.land()
        until(lambda: uav.state() is State.LANDED_DISARMED)
        assert len(asked) == 2


def test_motors_that_do_not_stop_are_reported() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav)
        asked = refuse_to_stop(backend, 100)
        with pytest.raises(RejectedByAutopilotError, match="its motors do not stop"):
            uav.land()
        assert uav.state() is State.LANDED_ARMED
        wait(backend, 8.0)
        assert len(asked) == 3


@pytest.mark.parametrize("after_s", [0.02, 1.0, 4.0])
def test_the_motors_of_a_pilot_who_took_over_on_the_ground_are_not_stopped(after_s: float) -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav)
        asked = refuse_to_stop(backend, 100)
        task = uav.land(blocking=False)
        until(lambda: asked)
        wait(backend, after_s)
        with backend.lock:
            backend.aircraft.pilot_takes_over()
            taken_s = backend.aircraft.now_s
        with pytest.raises(TaskAbortedError, match="the safety pilot took over"):
            task.wait(LIMIT_S)
        assert uav.state() is State.LANDED_ARMED
        wait(backend, 8.0)
        assert not [time_s for time_s, _ in asked if time_s > taken_s]
        assert not [time_s for time_s, _, _ in backend.aircraft.setpoints if time_s > taken_s + 0.2]
        backend.aircraft.obtain()  # another program
    assert backend.aircraft.device == 4
