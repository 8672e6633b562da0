"""Returning home. In stepped time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import Future

import pytest

from tests.snapshots import changed
from tests.ual_daemon.stepped import STEP_S, Stepped, at, stepped
from ual.errors import GeofenceError, InvalidArgumentError, TaskAbortedError, WrongStateError
from ual.geometry import Vector3
from ual.simulation import AckLost, Command, CommandRefused, FailsafeTriggered
from ual.types import GeoPoint, ReturnToLaunchRequest, State, TaskStatus
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.light.physics import FlightMode
from ual_daemon.settings import GeofenceSettings, VehicleSettings

HOME = Vector3(2.0, -1.0, 0.0)
LIGHT = {"start": [HOME.x, HOME.y, 0.0]}


@pytest.fixture
def flying() -> Iterator[Stepped]:
    with stepped(light=LIGHT) as uav:
        uav.fly()
        uav.keep_samples()
        yield uav


def go(uav: Stepped, x: float, y: float, z: float) -> None:
    uav.end(uav.prepare.go_to_waypoint(at(x, y, z)).begin().future)
    uav.keep_samples()


def positions(uav: Stepped) -> list[Vector3]:
    return [sample.pose.position for sample in uav.samples if sample.pose is not None]


def from_home_m(place: Vector3) -> float:
    return math.hypot(place.x - HOME.x, place.y - HOME.y)


def test_it_climbs_flies_home_and_lands_as_one_task(flying: Stepped) -> None:
    flying.update_each_step()
    go(flying, 12.0, -9.0, 5.0)
    task = flying.prepare.return_to_launch().begin()
    progress = []
    while not task.future.done():
        flying.run(0.1)
        progress.append(task.info().progress)
    task.future.result()
    assert task.info().status is TaskStatus.SUCCEEDED
    flown = positions(flying)
    assert max(p.z for p in flown) == pytest.approx(15.0, abs=0.1)  # rtl_height_m
    climb = [p for p in flown if p.z < 14.5 and from_home_m(p) > 5.0]
    assert max(math.hypot(p.x - 12.0, p.y + 9.0) for p in climb) < 0.1  # straight up
    assert all(p.z > 14.5 for p in flown if 1.0 < from_home_m(p) < 12.0)
    assert from_home_m(flying.pose.position) < 0.2
    assert flying.pose.position.z < 0.1
    assert flying.states[0] is State.FLYING_AUTO
    assert State.LANDING in flying.states
    assert State.FLYING_MANUAL not in flying.states
    known = [each for each in progress if each is not None]
    assert known == sorted(known)
    assert 0.0 < known[0] < 0.1
    assert "place of the take-off at 15.0 m" in task.description


def test_it_stays_at_its_height_where_that_is_larger(flying: Stepped) -> None:
    go(flying, 6.0, -1.0, 20.0)
    flying.end(flying.prepare.return_to_launch().begin().future, 200.0)
    assert max(p.z for p in positions(flying)) < 20.1


def test_the_height_may_be_passed(flying: Stepped) -> None:
    go(flying, 6.0, -1.0, 3.0)
    assert flying.prepare.return_to_launch(6.0).plan.length_m == pytest.approx(7.0, abs=0.1)
    flying.end(flying.prepare.return_to_launch(6.0).begin().future)
    assert max(p.z for p in positions(flying)) == pytest.approx(6.0, abs=0.1)


def test_over_home_it_lands_without_a_climb(flying: Stepped) -> None:
    assert flying.prepare.return_to_launch().plan.length_m == pytest.approx(0.0, abs=0.1)
    flying.end(flying.prepare.return_to_launch().begin().future)
    assert max(p.z for p in positions(flying)) < 3.2


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, 1e9])
def test_a_height_that_is_none_is_refused(flying: Stepped, value: float) -> None:
    with pytest.raises(InvalidArgumentError, match="height_m"):
        flying.prepare.return_to_launch(value)


@pytest.mark.parametrize(("ceiling_m", "fence"), [(10.0, None), (120.0, GeofenceSettings(max_height_m=10.0))])
def test_it_stays_below_the_ceiling_and_the_fence(ceiling_m: float, fence: GeofenceSettings | None) -> None:
    with stepped(VehicleSettings(ceiling_m=ceiling_m, geofence=fence), light=LIGHT) as uav:
        uav.fly()
        go(uav, 8.0, -1.0, 3.0)
        with pytest.raises(GeofenceError, match="give another height_m"):
            uav.prepare.return_to_launch(30.0)
        uav.end(uav.prepare.return_to_launch().begin().future)
        assert max(p.z for p in positions(uav)) == pytest.approx(10.0, abs=0.1)


def test_a_path_that_crosses_the_fence_is_refused_and_nothing_moves() -> None:
    l_shape = ((-10.0, -10.0), (10.0, -10.0), (10.0, 0.0), (0.0, 0.0), (0.0, 10.0), (-10.0, 10.0))
    settings = VehicleSettings(geofence=GeofenceSettings(polygon=l_shape))
    with stepped(settings, light={"start": [-5.0, 8.0, 0.0]}) as uav:
        uav.fly()
        go(uav, -5.0, -5.0, 3.0)
        go(uav, 8.0, -5.0, 3.0)
        with pytest.raises(GeofenceError, match=r"fly \(go_to_waypoint\) to a place from which .* home is free"):
            uav.prepare.return_to_launch()
        uav.run(1.0)
        assert uav.vehicle.telemetry().task is None
        assert (uav.pose.position - Vector3(8.0, -5.0, 3.0)).norm() < 0.1
        go(uav, -5.0, -5.0, 3.0)
        uav.end(uav.prepare.return_to_launch().begin().future)


def test_from_a_motion_it_first_comes_to_rest(flying: Stepped) -> None:
    flying.prepare.go_to_waypoint(at(30.0, -1.0, 3.0)).begin()
    flying.run(4.0)
    begun = flying.pose.position
    flying.keep_samples()
    flying.end(flying.prepare.return_to_launch(8.0).begin().future)
    flown = positions(flying)
    assert max(p.x for p in flown) < begun.x + 2.0
    assert max(abs(p.y + 1.0) for p in flown) < 0.1
    assert all(p.z > 7.5 for p in flown if HOME.x + 1.0 < p.x < begun.x - 0.5)


def test_it_can_be_cancelled_until_the_landing_begins(flying: Stepped) -> None:
    go(flying, 8.0, -1.0, 3.0)
    for _ in range(2):
        task = flying.prepare.return_to_launch(5.0).begin()
        flying.run(2.0)
        flying.vehicle.commands.cancel(task)
        with pytest.raises(TaskAbortedError, match="cancelled"):
            flying.end(task.future)
        flying.run(3.0)
        assert flying.state is State.FLYING_AUTO
        assert flying.speed < 0.05
    task = flying.prepare.return_to_launch(5.0).begin()
    flying.until(lambda: flying.is_in(State.LANDING))
    commands = flying.vehicle.commands
    with pytest.raises(WrongStateError, match="only the safety pilot"):
        commands.cancel(task)
    assert not commands.abandon(task)
    for refused in (commands.abort, commands.pause, lambda: flying.prepare.go_to_waypoint(at(0, 0, 3))):
        with pytest.raises(WrongStateError):
            refused()
    flying.run(STEP_S)
    flying.end(task.future)


def test_the_pilot_ends_it_en_route_and_in_the_landing(flying: Stepped) -> None:
    for state in (State.FLYING_AUTO, State.LANDING):
        go(flying, 8.0, -1.0, 4.0)
        task = flying.prepare.return_to_launch(5.0).begin()
        flying.run(1.0)
        flying.until(lambda state=state: flying.is_in(state))  # type: ignore[misc]
        flying.run(0.2)
        flying.sim.pilot_take_over()
        with pytest.raises(TaskAbortedError, match="return_to_launch: the safety pilot took over"):
            flying.end(task.future)
        flying.end(flying.vehicle.commands.recover_from_manual().begin())


def test_a_dry_run_moves_nothing_and_needs_what_the_command_needs(flying: Stepped) -> None:
    go(flying, 6.0, 2.0, 3.0)
    plan = flying.vehicle.commands.plan(ReturnToLaunchRequest(8.0))
    assert plan.length_m == pytest.approx(5.0 + 5.0, abs=0.1)
    assert plan.duration_s is not None
    flying.run(1.0)
    assert flying.vehicle.telemetry().task is None
    flying.end(flying.prepare.land().begin().future)
    with pytest.raises(WrongStateError, match="FLYING_AUTO"):
        flying.vehicle.commands.plan(ReturnToLaunchRequest())


def test_the_autopilots_home_goes_before_the_position_of_the_take_off(
    flying: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    backend = flying.vehicle.backend
    projection = backend.snapshot().earth.projection
    assert projection is not None
    at_boat = projection.to_geo(Vector3(9.0, 9.0, 0.0))
    home = GeoPoint(at_boat.latitude_deg, at_boat.longitude_deg)
    original = backend.snapshot
    monkeypatch.setattr(backend, "snapshot", lambda: changed(original(), home_geo=home))
    flight = flying.vehicle._flight
    step = flight.step
    monkeypatch.setattr(flight, "step", lambda snapshot: step(changed(snapshot, home_geo=home)))
    task = flying.prepare.return_to_launch(5.0).begin()
    assert "the autopilot's home" in task.description
    flying.end(task.future)
    assert math.hypot(flying.pose.position.x - 9.0, flying.pose.position.y - 9.0) < 0.2


def test_without_a_home_it_is_refused_with_words(flying: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    flying.sim.set_speed_factor(0.0)
    monkeypatch.setattr(flying.vehicle._flight.geofence.ground, "place", None)
    with pytest.raises(WrongStateError, match="no home is known"):
        flying.prepare.return_to_launch()


def test_out_of_a_mode_of_the_autopilot_it_takes_control_back_and_flies_home_as_one_task(flying: Stepped) -> None:
    go(flying, 12.0, -9.0, 5.0)
    flying.sim.begin_fault(FailsafeTriggered("setpoint failsafe"), 0.5)
    flying.run(1.0)
    assert flying.is_in(State.FLYING_MANUAL)
    task = flying.prepare.return_to_launch().begin()
    flying.end(task.future)
    assert task.info().status is TaskStatus.SUCCEEDED
    assert from_home_m(flying.pose.position) < 0.2
    assert flying.pose.position.z < 0.1


def test_a_failsafe_is_not_replaced_by_a_return_path_and_the_refusal_says_what_can_be_done(flying: Stepped) -> None:
    go(flying, 12.0, -9.0, 5.0)
    flying.sim.begin_fault(FailsafeTriggered("battery failsafe"))
    flying.run(0.1)
    with pytest.raises(WrongStateError, match=r"battery failsafe has taken control.*land ends the flight") as caught:
        flying.prepare.return_to_launch()
    assert caught.value.metadata["by"] == "battery failsafe"


def test_it_is_never_controlled_out_of_a_mode_of_the_pilots(flying: Stepped) -> None:
    go(flying, 12.0, -9.0, 5.0)
    flying.sim.pilot_take_over()
    flying.run(0.1)
    with pytest.raises(WrongStateError, match=r"the safety pilot flies in mode MANUAL.*recover_from_manual"):
        flying.prepare.return_to_launch()


def test_a_pilot_who_takes_over_while_control_is_taken_back_ends_it(flying: Stepped) -> None:
    go(flying, 12.0, -9.0, 5.0)
    flying.sim.begin_fault(FailsafeTriggered("setpoint failsafe"), 0.5)
    flying.run(1.0)
    flying.sim.begin_fault(CommandRefused(Command.TAKE_CONTROL, "not now"))
    flying.sim.begin_fault(AckLost(Command.TAKE_CONTROL))
    task = flying.prepare.return_to_launch().begin()
    flying.run(0.5)
    assert not task.future.done()
    flying.sim.pilot_take_over()
    flying.run(0.1)
    error = task.future.exception(timeout=0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"


@pytest.mark.parametrize("by_id", [True, False])
def test_an_abort_ends_a_return_that_still_takes_the_control_back(
    flying: Stepped, by_id: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The abort was refused, and the UAV flew home once it followed UAL."""
    backend = flying.vehicle.backend
    assert isinstance(backend, LightBackend)
    go(flying, 12.0, -9.0, 5.0)
    backend.pilot_switch(FlightMode.HOLD)
    flying.run(STEP_S)
    asked: list[Future[None]] = []

    def take_control() -> Future[None]:
        asked.append(Future())
        return asked[-1]

    monkeypatch.setattr(backend, "take_control", take_control)
    task = flying.prepare.return_to_launch().begin()
    flying.run(0.5)
    assert flying.state is State.FLYING_MANUAL
    flying.vehicle.commands.abort(task_id=task.id if by_id else "")
    with pytest.raises(TaskAbortedError, match="cancelled"):
        task.future.result(0)
    assert asked[0].cancelled()
