"""Flights with a small AirSim: its quirks, and what goes wrong."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest
from typing_extensions import override

from tests.conftest import LIMIT_S
from tests.simulators.airsim import Vehicle
from tests.simulators.airsim_server import AirsimServer
from tests.simulators.lockstep_airsim import LockstepAirsim
from tests.waiting import until, until_state
from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError, TaskAbortedError, WrongStateError
from ual.geometry import Pose, Vector3
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.airsim import AirsimBackend
from ual_daemon.backends.airsim.procedures import Procedures
from ual_daemon.backends.airsim.rpc import RpcCaller
from ual_daemon.backends.base import BackendOptions

RATE_HZ = 25.0
FLYING = (State.FLYING_AUTO, State.FLYING_MANUAL, State.TAKING_OFF, State.LANDING)


@contextmanager
def connected(url: str, ns: str = "uav_1", **settings: Any) -> Iterator[UAL]:
    with UAL("airsim", ns, url=url, backend_settings={"rate_hz": RATE_HZ, **settings}) as uav:
        yield uav


@contextmanager
def stepped(server: AirsimServer, vehicle: Vehicle) -> Iterator[UAL]:
    """On the vehicle's own clock: a computer that stands still for a moment is no pause of UAL's."""
    with UAL(LockstepAirsim(BackendOptions("uav_1"), server, vehicle)) as uav:
        until(uav.is_ready, "its readiness")
        yield uav


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle("Drone1")


@pytest.fixture
def server(vehicle: Vehicle) -> Iterator[AirsimServer]:
    with AirsimServer([vehicle]) as server:
        yield server


@pytest.fixture
def uav(server: AirsimServer, vehicle: Vehicle) -> Iterator[UAL]:
    with stepped(server, vehicle) as uav:
        yield uav


def calls(server: AirsimServer, method: str) -> int:
    return sum(name == method for name, _ in server.calls)


def test_it_takes_off_to_any_height_and_is_disarmed_after_its_landing(
    uav: UAL, server: AirsimServer, vehicle: Vehicle
) -> None:
    assert uav.state() is State.LANDED_ARMED  # so the simulator starts
    uav.take_off(4.0)
    assert -vehicle.body.position[2] == pytest.approx(4.0, abs=0.3)
    uav.land()
    until_state(uav, State.LANDED_DISARMED)
    assert vehicle.body.is_on_ground
    assert not vehicle.is_armed
    assert not {name for name, _ in server.calls} & {"takeoff", "land", "moveToZ"}


@pytest.mark.parametrize("north_m", [math.nan, 3e38])
def test_a_position_that_cannot_be_true_is_no_pose_and_is_reported_once(
    uav: UAL, vehicle: Vehicle, north_m: float, caplog: pytest.LogCaptureFixture
) -> None:
    place = vehicle.body.position
    vehicle.current_position((north_m, 0.0, 0.0), 0.0)
    until_state(uav, State.UNINITIALIZED)
    assert uav.telemetry().pose is None
    assert "no position" in uav.telemetry().state_reason
    vehicle.current_position(place, 0.0)
    until_state(uav, State.LANDED_ARMED)
    assert [record.getMessage()[:19] for record in caplog.records if "dropped" in record.getMessage()] == [
        "dropped: position o"
    ]


def test_api_control_is_not_enabled_again_in_the_air(uav: UAL, server: AirsimServer) -> None:
    uav.take_off(3.0)
    uav.land()
    assert calls(server, "enableApiControl") == 1


def test_it_is_never_disarmed_in_the_air(uav: UAL, server: AirsimServer, vehicle: Vehicle) -> None:
    uav.take_off(3.0)
    with connected(server.url, "uav_2") as other:
        until_state(other, State.FLYING_AUTO)
        with pytest.raises(RejectedByAutopilotError, match="on the ground"):
            other.simulation.pilot_disarm()
    backend = AirsimBackend(BackendOptions("uav_3", server.url))
    assert isinstance(backend.disarm().exception(0.0), RejectedByAutopilotError)
    assert vehicle.is_armed


def test_a_vehicle_that_is_armed_again_flies_again(uav: UAL) -> None:
    for _ in range(2):
        uav.take_off(2.0)
        uav.land()
        until_state(uav, State.LANDED_DISARMED)
        uav.simulation.pilot_arm()


def test_a_daemon_that_ends_in_flight_leaves_it_hovering_and_the_next_one_knows_it(
    server: AirsimServer, vehicle: Vehicle
) -> None:
    with connected(server.url) as uav:
        until(uav.is_ready, "its readiness")
        uav.take_off(3.0)
    server.run(3.0)
    assert -vehicle.body.position[2] == pytest.approx(3.0, abs=0.5)
    with connected(server.url) as uav:
        until_state(uav, State.FLYING_AUTO)
        uav.go_to_waypoint(Pose.at(1.0, 0.0, 2.0))
        uav.land()


def test_the_end_of_the_flight_is_a_clean_handover_to_a_vehicle_that_hovers(uav: UAL, server: AirsimServer) -> None:
    uav.take_off(3.0)
    task = uav.go_to_waypoint(Pose.at(30.0, 0.0, 3.0), blocking=False)
    uav.vehicle.prepare_shutdown().result(LIMIT_S)
    assert task.done()
    until_state(uav, State.FLYING_MANUAL)
    assert uav.telemetry().flight_mode == "HOVER"
    sent = calls(server, "moveByVelocity")
    server.run(2.0)
    assert calls(server, "moveByVelocity") == sent


def test_a_pilot_who_takes_over_at_the_touch_down_keeps_the_control(
    uav: UAL, server: AirsimServer, vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the report that shows the ground and the disarming that follows it."""
    disarm, taken = Procedures.require_own_control, threading.Event()

    def after_the_take_over(self: Procedures, connection: RpcCaller) -> None:
        if not taken.is_set():
            vehicle.enable_api_control(False)
            server.calls.clear()
            taken.set()
        disarm(self, connection)

    monkeypatch.setattr(Procedures, "require_own_control", after_the_take_over)
    uav.take_off(2.0)
    uav.land(blocking=False)
    until(taken.is_set, "its landing")
    server.run(2.0)
    assert not vehicle.has_api_control
    assert calls(server, "enableApiControl") == calls(server, "armDisarm") == 0


def test_what_was_reported_of_the_vehicles_ends_with_the_simulator(vehicle: Vehicle) -> None:
    with AirsimServer([vehicle, Vehicle("Drone2")]) as server, connected(server.url) as uav:
        until(lambda: "set airsim.vehicle_name" in uav.telemetry().state_reason, "the question for a name")
        server.close()
        until(lambda: "nothing heard" in uav.telemetry().state_reason, "the end of what it said of vehicles")


def test_a_simulator_that_ended_is_found_again(vehicle: Vehicle) -> None:
    with ExitStack() as stack:
        server = stack.enter_context(AirsimServer([vehicle]))
        uav = stack.enter_context(connected(server.url))
        until(uav.is_ready, "its readiness")
        uav.take_off(3.0)
        task = uav.go_to_waypoint(Pose.at(30.0, 0.0, 3.0), blocking=False)
        server.close()
        until_state(uav, State.UNINITIALIZED)
        with pytest.raises(LinkLostError):
            task.wait()
        stack.enter_context(AirsimServer([Vehicle("Drone1")], server.port))
        until_state(uav, State.LANDED_ARMED)
        uav.take_off(2.0)


def test_a_lost_connection_is_made_again_and_the_flight_goes_on(uav: UAL, server: AirsimServer) -> None:
    uav.take_off(3.0)
    task = uav.go_to_waypoint(Pose.at(4.0, 0.0, 3.0), blocking=False)
    server.drop_connections()
    task.wait()


def test_a_paused_simulator_stops_the_clock_and_nothing_piles_up(uav: UAL, server: AirsimServer) -> None:
    uav.take_off(3.0)
    task = uav.go_to_waypoint(Pose.at(3.0, 0.0, 3.0), blocking=False)
    uav.simulation.set_speed_factor(0.0)
    until(lambda: server.is_paused, "the pause")
    began_s = uav.telemetry().stamp_s
    deadline_s = time.monotonic() + 0.5
    while time.monotonic() < deadline_s:  # it is asked again and again, and answers
        assert uav.state() is State.FLYING_AUTO
        assert uav.telemetry().stamp_s - began_s < 0.1
    assert server.pending_count <= 2
    uav.simulation.step(0.5)
    until(lambda: uav.telemetry().stamp_s - began_s > 0.4, "the time to pass")
    uav.simulation.set_speed_factor(5.0)
    task.wait()


def test_velocities_that_are_never_answered_do_not_end_the_flight(uav: UAL, server: AirsimServer) -> None:
    uav.take_off(3.0)
    task = uav.go_to_waypoint(Pose.at(6.0, 0.0, 3.0), blocking=False)
    server.forgets_count = 2
    until(lambda: server.forgets_count == 0, "the velocity")
    task.wait()


def test_a_step_needs_time_that_stands_still(uav: UAL) -> None:
    with pytest.raises(WrongStateError):
        uav.simulation.step(1.0)
    with pytest.raises(NotSupportedError, match="ClockSpeed"):
        uav.simulation.set_speed_factor(3.0)


def test_a_collision_ends_the_task_and_says_with_what() -> None:
    vehicle = Vehicle("Drone1", wall_north_m=3.0)
    with AirsimServer([vehicle]) as server, stepped(server, vehicle) as uav:
        uav.take_off(3.0)
        with pytest.raises(TaskAbortedError, match="collision"):
            uav.go_to_waypoint(Pose.at(0.0, 10.0, 3.0))
        assert uav.telemetry().status_text == "collision with Wall"
        health = uav.telemetry().health
        assert health is not None
        assert "autopilot: collision with Wall" in health.failing_checks
        until_state(uav, State.FLYING_MANUAL)
        with pytest.raises(WrongStateError, match="collision"):
            uav.recover_from_manual()
        uav.recover_from_manual(force=True)
        uav.go_to_waypoint(Pose.at(0.0, 0.0, 3.0))
        uav.land()


class CountingVehicle(Vehicle):
    """Counts how often it is asked for its state, and for its last collision."""

    states_count = collisions_count = 0

    @override
    def state(self, epoch_s: float) -> dict[str, Any]:
        self.states_count += 1
        return super().state(epoch_s)

    @override
    def read_collision(self, epoch_s: float) -> dict[str, Any]:
        self.collisions_count += 1
        return super().read_collision(epoch_s)


def test_collisions_are_requested_rarely_as_each_answer_resets_them() -> None:
    vehicle = CountingVehicle("Drone1")
    with AirsimServer([vehicle]) as server, connected(server.url):
        until(lambda: vehicle.states_count > 40, "polls", seen=lambda: vehicle.states_count)
        assert 1 <= vehicle.collisions_count <= vehicle.states_count // 5 + 1


def test_after_a_collision_it_can_be_landed() -> None:
    vehicle = Vehicle("Drone1", wall_north_m=3.0)
    with AirsimServer([vehicle]) as server, stepped(server, vehicle) as uav:
        uav.take_off(3.0)
        with pytest.raises(TaskAbortedError, match="collision"):
            uav.go_to_waypoint(Pose.at(0.0, 10.0, 3.0))
        until_state(uav, State.FLYING_MANUAL)
        uav.land()
        until_state(uav, State.LANDED_DISARMED)


@pytest.mark.parametrize(
    ("name", "why"),
    [("", "set airsim.vehicle_name: the simulator's vehicles are Drone1, Drone2"), ("Nobody", "it has Drone1, Drone2")],
)
def test_a_vehicle_that_is_not_clear_is_named(name: str, why: str) -> None:
    with (
        AirsimServer([Vehicle("Drone1"), Vehicle("Drone2")]) as server,
        connected(server.url, vehicle_name=name) as uav,
    ):
        until(lambda: why in uav.telemetry().state_reason, "the reason")
        assert uav.state() is State.UNINITIALIZED


def test_two_vehicles_of_one_simulator_fly_at_once() -> None:
    vehicles = [Vehicle("Drone1"), Vehicle("Drone2")]
    with ExitStack() as stack:
        server = stack.enter_context(AirsimServer(vehicles))
        first, second = (
            stack.enter_context(connected(server.url, f"uav_{each.name[-1]}", vehicle_name=each.name))
            for each in vehicles
        )
        for uav in (first, second):
            until(uav.is_ready, "its readiness")
        tasks = [uav.take_off(height_m, blocking=False) for uav, height_m in ((first, 2.0), (second, 4.0))]
        for task in tasks:
            task.wait()
        assert [-each.body.position[2] for each in vehicles] == pytest.approx([2.0, 4.0], abs=0.4)


def test_a_vehicle_with_a_remote_control_leaves_the_pilot_to_that(uav: UAL, vehicle: Vehicle) -> None:
    uav.take_off(3.0)
    vehicle.keeps_rc = False
    with pytest.raises(RejectedByAutopilotError, match="does not keep the sticks"):
        uav.simulation.pilot_take_over()
    vehicle.rc = {"is_valid": True, "pitch": 0.0, "roll": 0.0, "yaw": 0.0, "throttle": 0.61}
    seen_s = uav.telemetry().stamp_s
    until(lambda: uav.telemetry().stamp_s > seen_s + 0.1, "a state")
    with pytest.raises(RejectedByAutopilotError, match="take over with that"):
        uav.simulation.pilot_take_over()
    assert uav.state() is State.FLYING_AUTO


def test_api_control_that_is_not_allowed_is_reported(vehicle: Vehicle, uav: UAL) -> None:
    vehicle.allows_api = False
    with pytest.raises(RejectedByAutopilotError, match="AllowAPIAlways"):
        uav.take_off(3.0)


def test_wind_and_a_new_position(uav: UAL, vehicle: Vehicle) -> None:
    uav.simulation.set_wind(Vector3(1.0, 2.0, 0.0))
    assert vehicle.wind == (2.0, 1.0, 0.0)
    uav.take_off(3.0)
    uav.simulation.place_on_ground(Vector3(5.0, 6.0, 0.0), 0.0)
    assert vehicle.body.position == (6.0, 5.0, 0.0)
    until_state(uav, State.LANDED_DISARMED)
    assert uav.telemetry().pose is not None


def test_it_is_armed_by_its_simulated_pilot(uav: UAL, server: AirsimServer) -> None:
    uav.simulation.pilot_disarm()
    until_state(uav, State.LANDED_DISARMED)
    backend = AirsimBackend(BackendOptions("uav_2", server.url))
    assert not backend.safety_pilot().may_arm()  # it is not connected
    uav.simulation.pilot_arm()
    until_state(uav, State.LANDED_ARMED)
