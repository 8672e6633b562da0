"""A Crazyflie with all of UAL above its backend."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.simulators.crazyflie import REST_Z_M, Supervisor
from tests.ual_daemon.backends.crazyflie.simulated_crazyflie import SimulatedCrazyflie
from ual.geometry import Pose, Vector3
from ual.types import LandRequest, State, TakeOffRequest
from ual_daemon.backends.crazyflie.ground import LANDING_DEPTH_M, KnownGround
from ual_daemon.backends.values import Control, ExternalPose


@pytest.mark.parametrize("daemon", ["the same", "restarted", "restarted as it is lifted"])
def test_motors_stay_off_in_the_hand_that_lifts_it_soon_after_its_landing(tmp_path: Path, daemon: str) -> None:
    flown = SimulatedCrazyflie(tmp_path)
    flown.take_off(0.5)
    flown.land()
    flown.run(0.2)
    if daemon != "the same":
        flown.restart_daemon()
    if daemon == "restarted":
        flown.ready()
    since_s = flown.now_s
    assert flown.crazyflie.supervisor is Supervisor.FLYING
    while flown.now_s < since_s + 1.2:
        flown.lift(0.5, 0.01)
        assert flown.state in (State.LANDED_ARMED, State.UNINITIALIZED)
    assert flown.session.is_connected
    flown.run(3.0)
    assert flown.crazyflie.thrust == 0
    assert flown.setpoints_since(since_s) == 0


@pytest.mark.parametrize("has_seen_ground", [True, False])
@pytest.mark.parametrize("jump_m", [Vector3(0.0, 0.0, -1.2), Vector3(0.0, 0.0, -4.0), Vector3(1.0, 0.0, 0.8)])
def test_a_landing_after_a_jump_of_the_position_stops_the_motors_on_the_ground(
    tmp_path: Path, jump_m: Vector3, has_seen_ground: bool
) -> None:
    """As a source of poses does that has moved its origin: the ground moves with it."""
    flown = SimulatedCrazyflie(tmp_path)
    flown.take_off(1.5)
    if not has_seen_ground:
        flown.restart_daemon()
        flown.ready()
    flown.run(1.0)
    flown.move_origin(jump_m)
    flown.run(3.0)
    assert flown.crazyflie.current_position[2] == pytest.approx(1.5 + jump_m.z, abs=0.1)
    landed = flown.begin_landing()
    while flown.crazyflie.thrust > 0:
        flown._turn()
    assert flown.crazyflie.body.is_on_ground
    assert flown.crazyflie.current_position[2] == pytest.approx(REST_Z_M + jump_m.z, abs=0.01)
    flown.end(landed)


def test_a_source_that_moves_slowly_makes_the_ground_unknown(tmp_path: Path) -> None:
    flown = SimulatedCrazyflie(tmp_path)
    flown.take_off(0.5)
    here = Vector3(*flown.crazyflie.current_position)
    assert flown.session.telemetry.ground.landing_z_m(here) == pytest.approx(REST_Z_M, abs=0.01)
    flown.backend.set_external_pose(ExternalPose(Pose(here), flown.now_s, 0.0, resets_count=1))
    flown.run(0.1)
    assert flown.session.telemetry.ground.landing_z_m(here) == pytest.approx(REST_Z_M - LANDING_DEPTH_M, abs=0.01)


def test_the_ground_is_at_its_lowest_after_jumps_until_it_stands_again() -> None:
    here = Vector3(2.0, 0.0, 1.0)
    ground = KnownGround.standing_at(here).jumped(Vector3(0.0, 0.0, -2.0)).jumped(Vector3(0.0, 0.0, 2.0))
    assert ground.landing_z_m(here) == -1.0 - LANDING_DEPTH_M
    assert KnownGround.standing_at(here).landing_z_m(here) == 1.0


@pytest.mark.parametrize("is_in_air", [False, True])
def test_a_source_of_poses_in_the_default_frame_that_moves_is_followed_and_set_home_repairs_it(
    tmp_path: Path, is_in_air: bool
) -> None:
    """Its own move makes home lost, and nothing else tells the UAV where it is."""
    flown = SimulatedCrazyflie(tmp_path)
    flown.crazyflie.has_positioning = False
    flown.measure_outside()
    flown.run(0.5)
    if is_in_air:
        flown.take_off(1.0)
    flown.measure_outside(Vector3(1.5, 0.0, 0.0))
    flown.run(5.0)
    assert flown.state is (State.FLYING_AUTO if is_in_air else State.LANDED_ARMED)
    assert flown.vehicle.telemetry().frame_lost
    if is_in_air:
        flown.land()
    flown.vehicle.commands.set_home()
    flown.run(5.0)
    telemetry = flown.vehicle.telemetry()
    assert not telemetry.frame_lost
    assert telemetry.pose is not None
    assert telemetry.pose.position.norm() < 0.1


@pytest.mark.parametrize(("hover_s", "silent_s"), [(1.0, 0.0), (1.0, 15.0), (0.0, 15.0)])
@pytest.mark.parametrize("arms_itself", [True, False])
@pytest.mark.parametrize("deck", ["", "deck.bcFlow2"])
def test_a_firmware_that_has_booted_in_flight_stays_down_and_was_not_controlled_by_others(
    tmp_path: Path, deck: str, hover_s: float, silent_s: float, *, arms_itself: bool
) -> None:
    """It has fallen, out of a hover of its own or out of setpoints, and may take off again."""
    flown = SimulatedCrazyflie(tmp_path, deck, arms_itself=arms_itself)
    if not arms_itself:
        flown.arm()
    flown.take_off(1.0)
    flown.run(hover_s)
    flown.crazyflie.is_silent = silent_s > 0.0
    flown.run(silent_s)
    flown.crazyflie.boot()
    flown.crazyflie.is_silent = False
    booted_s = flown.now_s
    while flown.now_s < booted_s + 5.0:
        flown._turn()
        assert flown.crazyflie.thrust == 0
    if not arms_itself:
        assert flown.state is State.LANDED_DISARMED
        flown.arm()
    flown.take_off(0.5)
    assert flown.state is State.FLYING_AUTO


def test_a_daemon_that_ends_has_reported_that_setpoints_stop_also_if_most_of_that_is_lost(tmp_path: Path) -> None:
    flown = SimulatedCrazyflie(tmp_path)
    flown.take_off(1.0)
    flown.begin_go_to(Pose.at(8.0, 0.0, 1.0))
    flown.run(1.5)
    flown.lose_notifications(14)
    flown.end(flown.vehicle.prepare_shutdown())
    flown.crazyflie.run(6.0)
    assert flown.crazyflie.supervisor is Supervisor.FLYING
    assert flown.crazyflie.current_position[2] == pytest.approx(1.0, abs=0.1)


def test_an_end_out_of_a_motion_takes_a_second(tmp_path: Path) -> None:
    flown = SimulatedCrazyflie(tmp_path)
    flown.take_off(1.0)
    flown.begin_go_to(Pose.at(8.0, 0.0, 1.0))
    flown.run(1.5)
    begin_s = flown.now_s
    flown.end(flown.vehicle.prepare_shutdown())
    assert flown.now_s - begin_s < 1.0


def test_an_abort_and_a_landing_do_not_wait_for_the_notifications(tmp_path: Path) -> None:
    flown = SimulatedCrazyflie(tmp_path)
    flown.take_off(1.0)
    flown.begin_go_to(Pose.at(8.0, 0.0, 1.0))
    flown.run(1.5)
    flown.vehicle.commands.abort()
    flown.run(0.05)
    assert flown.state is State.FLYING_AUTO
    flown.begin_landing()
    assert flown.until(lambda: _control(flown) is Control.LAND) < 0.1
    flown.until(lambda: flown.state is State.LANDED_ARMED)
    flown.take_off(0.5)
    assert flown.state is State.FLYING_AUTO


def test_a_take_off_and_a_landing_go_on_where_their_caller_has_gone_and_no_pilot_could_end_them(tmp_path: Path) -> None:
    flown = SimulatedCrazyflie(tmp_path)
    commands = flown.vehicle.commands
    take_off = commands.prepare(TakeOffRequest(1.0)).begin()
    flown.until(lambda: flown.state is State.TAKING_OFF)
    assert not commands.abandon(take_off)
    flown.end(take_off.future)
    landing = commands.prepare(LandRequest()).begin()
    flown.until(lambda: flown.state is State.LANDING)
    assert not commands.abandon(landing)
    flown.end(landing.future)
    assert flown.state is State.LANDED_ARMED


def _control(flown: SimulatedCrazyflie) -> Control:
    mode = flown.backend.snapshot().control.mode
    assert mode is not None
    return mode.value.control
