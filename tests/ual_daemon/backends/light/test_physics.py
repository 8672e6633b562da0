from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.strategies import ANGLES, vectors
from tests.ual_daemon.backends.light.drone import Drone, hold, velocity
from tests.ual_daemon.stepped import stepped
from ual.errors import InvalidArgumentError, RejectedByAutopilotError, WrongStateError
from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.backends.light.physics import SETPOINT_TIMEOUT_S, SIM_STEP_S, FlightMode
from ual_daemon.backends.values import LandedState, PositionSetpoint, Setpoint, VelocitySetpoint

SLACK = 1.0 + 1e-9


# --- Motion -----------------------------------------------------------------------------------------------------------

SETPOINTS: st.SearchStrategy[Setpoint] = st.builds(
    PositionSetpoint, vectors(50.0), ANGLES, vectors(20.0), vectors(20.0), st.floats(-10.0, 10.0)
) | st.builds(VelocitySetpoint, vectors(20.0), st.floats(-10.0, 10.0))


@settings(max_examples=20)
@given(
    st.lists(SETPOINTS, min_size=1, max_size=5),
    st.builds(
        dict,
        horizontal_speed_m_s=st.floats(0.5, 10.0),
        vertical_speed_m_s=st.floats(0.5, 5.0),
        horizontal_acceleration_m_s2=st.floats(0.5, 10.0),
        vertical_acceleration_m_s2=st.floats(0.5, 5.0),
        yaw_rate_rad_s=st.floats(0.1, 5.0),
        response_s=st.floats(0.05, 2.0),
    ),
)
def test_whatever_is_queried_the_limits_are_held(asked: list[Setpoint], limits: dict[str, Any]) -> None:
    drone = Drone(**limits)
    drone.fly(2.0)
    before = drone.true("velocity")
    for setpoint in asked:
        for _ in range(50):
            drone.run(SIM_STEP_S, setpoint)
            now = drone.true("velocity")
            assert math.hypot(now[0], now[1]) <= limits["horizontal_speed_m_s"] * SLACK
            assert abs(now[2]) <= limits["vertical_speed_m_s"] * SLACK
            assert abs(drone.true("yaw_rate")) <= limits["yaw_rate_rad_s"] * SLACK
            assert drone.true("position")[2] >= 0.0
            if drone.true("position")[2] > 0.0:  # the ground stops as hard as it likes
                change = (now - before) / SIM_STEP_S
                assert math.hypot(change[0], change[1]) <= limits["horizontal_acceleration_m_s2"] * SLACK
                assert abs(change[2]) <= limits["vertical_acceleration_m_s2"] * SLACK
            before = now


@pytest.mark.parametrize("response_s", [0.1, 0.3, 1.0])
def test_a_velocity_is_answered_with_first_order(response_s: float) -> None:
    drone = Drone(response_s=response_s, horizontal_acceleration_m_s2=100.0)
    drone.fly()
    for _ in range(round(3 * response_s / SIM_STEP_S)):
        begin = drone.true("velocity")[0]
        drone.run(SIM_STEP_S, velocity(1.0))
        # Each step takes it the same part of the way that is left.
        assert drone.true("velocity")[0] - begin == pytest.approx((1.0 - begin) * SIM_STEP_S / response_s, abs=1e-9)
    assert drone.true("velocity")[0] == pytest.approx(1.0 - math.exp(-3.0), abs=0.03)


def test_a_velocity_is_reached_and_kept() -> None:
    drone = Drone()
    drone.fly()
    drone.run(5.0, velocity(0.8, -0.6, 0.5, 0.3))
    assert tuple(drone.twist.linear) == pytest.approx((0.8, -0.6, 0.5), abs=1e-3)
    assert drone.twist.angular.z == pytest.approx(0.3)


def test_a_position_is_reached_without_overshoot() -> None:
    drone = Drone()
    drone.fly()
    xs = []
    for _ in range(500):
        drone.run(SIM_STEP_S, hold(4.0, 0.0, 5.0, 2.0))
        xs.append(drone.true("position")[0])
    assert max(xs) <= 4.05
    assert tuple(drone.pose.position) == pytest.approx((4.0, 0.0, 5.0), abs=0.01)
    assert drone.pose.yaw_rad == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize(("begin", "end"), [(3.0, -3.0), (-3.0, 3.0), (0.0, 3.1), (0.0, -3.1)])
def test_a_heading_is_reached_by_the_shortest_turn(begin: float, end: float) -> None:
    drone = Drone(start_yaw_rad=begin)
    drone.fly()
    turned = 0.0
    for _ in range(400):
        drone.run(SIM_STEP_S, hold(0.0, 0.0, 5.0, end))
        turned += drone.true("yaw_rate") * SIM_STEP_S
    assert turned == pytest.approx(math.remainder(end - begin, math.tau), abs=0.02)
    assert -math.pi <= drone.true("yaw") <= math.pi


# --- Wind -------------------------------------------------------------------------------------------------------------


def test_wind_pushes_a_held_position_a_little_to_where_it_blows() -> None:
    drone = Drone(wind_m_s=[3.0, -4.0, 0.0])
    drone.fly()
    x, y, _ = drone.pose.position
    assert (x, y) == pytest.approx((0.06, -0.08), abs=0.01)


def test_wind_can_begin_and_end() -> None:
    drone = Drone()
    drone.fly()
    drone.sim.set_wind(Vector3(5.0, 0.0, 0.0))
    drone.run(5.0, hold(0.0, 0.0, 5.0))
    assert drone.pose.position.x == pytest.approx(0.1, abs=0.02)
    drone.sim.set_wind(Vector3())
    drone.run(5.0, hold(0.0, 0.0, 5.0))
    assert drone.pose.position.x == pytest.approx(0.0, abs=0.01)


def test_a_storm_carries_away_no_faster_than_the_speed_limit_and_nothing_that_stands() -> None:
    drone = Drone(wind_m_s=[60.0, 0.0, 0.0])
    drone.run(5.0)
    assert tuple(drone.pose.position) == (0.0, 0.0, 0.0)
    drone.fly()
    assert drone.pose.position.x > 1.0
    assert drone.twist.linear.horizontal_norm() <= 1.6 * SLACK


# --- Ground -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start_z", [0.0, 5.0, -3.0])
def test_a_landing_is_noticed_after_a_moment_and_disarms_later(start_z: float) -> None:
    drone = Drone(start=[1.0, 2.0, start_z], disarm_after_landing_s=3.0)
    assert drone.landed() is LandedState.ON_GROUND
    drone.fly(2.0)
    assert drone.landed() is LandedState.IN_AIR
    assert drone.pose.position.z == pytest.approx(start_z + 2.0, abs=0.01)
    drone.backend.land(Limits()).result(timeout=0)
    drone.run(SIM_STEP_S)
    assert drone.landed() is LandedState.LANDING
    while drone.true("position")[2] > start_z:
        drone.run(SIM_STEP_S)
    assert drone.landed() is LandedState.LANDING
    assert drone.run_until(LandedState.ON_GROUND) == pytest.approx(0.5, abs=2 * SIM_STEP_S)
    assert tuple(drone.pose.position) == pytest.approx((1.0, 2.0, start_z), abs=0.01)
    assert drone.twist.linear == Vector3()
    drone.run(2.9)
    assert drone.armed
    drone.run(0.2)
    assert not drone.armed
    assert drone.mode() is FlightMode.HOLD


def test_it_comes_down_with_the_landing_speed() -> None:
    drone = Drone(landing_speed_m_s=0.4)
    drone.fly(3.0)
    drone.backend.land(Limits())
    drone.run(2.0)
    assert drone.twist.linear.z == pytest.approx(-0.4, abs=0.01)


def test_armed_but_never_controlled_it_stays_armed() -> None:
    drone = Drone()
    drone.sim.pilot_arm()
    drone.run(60.0)
    assert drone.armed


@pytest.mark.parametrize("start_z", [0.0, 5.0, -3.0])
def test_arming_alone_moves_nothing(start_z: float) -> None:
    drone = Drone(start=[1.0, 2.0, start_z])
    drone.sim.pilot_arm()
    drone.run(5.0)
    assert drone.pose.position == Vector3(1.0, 2.0, start_z)
    drone.backend.take_off(3.0, Limits())
    drone.backend.send(hold(1.0, 2.0, start_z + 3.0))
    drone.sim.pilot_disarm()
    drone.run(5.0)
    drone.sim.pilot_arm()  # what it was told before is over
    drone.run(5.0)
    assert drone.pose.position == Vector3(1.0, 2.0, start_z)


def test_setpoints_lift_it_off_only_when_they_are_followed() -> None:
    drone = Drone()
    drone.run(2.0, hold(0.0, 0.0, 3.0))
    drone.sim.pilot_arm()
    drone.run(2.0, hold(0.0, 0.0, 3.0))
    assert drone.pose.position.z == 0.0
    drone.backend.take_off(3.0, Limits())
    drone.run(2.0, hold(0.0, 0.0, 3.0))
    assert drone.landed() is LandedState.IN_AIR


def test_a_descent_by_setpoints_lands_too() -> None:
    drone = Drone()
    drone.fly(2.0)
    drone.run(4.0, velocity(0.0, 0.0, -1.0))
    assert drone.landed() is LandedState.ON_GROUND
    assert drone.true("position")[2] == 0.0


def test_on_the_ground_it_neither_slides_nor_turns() -> None:
    drone = Drone()
    drone.sim.pilot_arm()
    drone.backend.take_control()
    drone.run(3.0, velocity(1.0, 1.0, 0.0, 1.0))
    assert drone.pose.position == Vector3()
    assert drone.pose.yaw_rad == 0.0


# --- Its autopilot ----------------------------------------------------------------------------------------------------


def test_without_setpoints_it_holds_by_itself_after_a_while() -> None:
    drone = Drone()
    drone.fly()
    drone.run(2.0, velocity(1.0))
    drone.run(SETPOINT_TIMEOUT_S - SIM_STEP_S)
    assert drone.mode() is FlightMode.GUIDED
    drone.run(3 * SIM_STEP_S)
    assert drone.mode() is FlightMode.HOLD
    place = drone.pose.position
    drone.run(10.0)
    assert (drone.pose.position - place).norm() < 0.5
    assert drone.twist.linear.norm() < 0.01


def test_on_the_ground_it_waits_for_setpoints() -> None:
    drone = Drone()
    drone.sim.pilot_arm()
    drone.backend.take_off(3.0, Limits())
    drone.run(10.0)
    assert drone.mode() is FlightMode.GUIDED


def refusal(drone: Drone, command: str) -> str:
    error = getattr(drone.backend, command)().exception(timeout=0)
    assert isinstance(error, RejectedByAutopilotError)
    assert drone.backend.snapshot().condition.status_text in error.message
    return error.message


def test_it_refuses_what_an_autopilot_would() -> None:
    drone = Drone()
    assert "Mode: not armed" in refusal(drone, "take_control")
    drone.fly()
    assert "Disarm: not landed" in refusal(drone, "disarm")
    assert "Arm: not landed" in refusal(drone, "arm")
    assert drone.armed


def test_a_refusal_of_the_pilot_is_reported_to_the_pilot() -> None:
    drone = Drone()
    drone.fly()
    with pytest.raises(RejectedByAutopilotError, match="Disarm: not landed"):
        drone.sim.pilot_disarm()


# --- Battery and GPS --------------------------------------------------------------------------------------------------


def test_the_battery_empties_in_flight_within_its_endurance() -> None:
    drone = Drone(battery_endurance_s=100.0)
    drone.run(50.0)
    assert drone.true("battery_percent") == 100.0
    drone.sim.pilot_arm()
    drone.run(10.0)
    assert drone.true("battery_percent") == pytest.approx(99.5)
    drone.fly()
    begin = drone.true("battery_percent")
    drone.run(30.0, hold(0.0, 0.0, 5.0))
    assert drone.true("battery_percent") == pytest.approx(begin - 30.0)
    battery = drone.backend.snapshot().condition.battery
    assert battery is not None
    assert battery.remaining_percent == pytest.approx(begin - 30.0, abs=0.1)  # reported every 0.1 s
    assert battery.voltage_v is not None
    assert 13.2 < battery.voltage_v < 16.8
    drone.run(100.0, hold(0.0, 0.0, 5.0))
    assert drone.true("battery_percent") == 0.0


def test_an_empty_battery_does_not_arm() -> None:
    drone = Drone(battery_percent=4.0)
    assert "Arm: battery too low" in refusal(drone, "arm")
    with pytest.raises(RejectedByAutopilotError, match="battery too low"):
        drone.sim.pilot_arm()


def test_gps_and_local_frame_agree() -> None:
    light = {"start": [3.0, 4.0, 0.0], "origin_geo": [52.0, 4.0, 30.0], "geoid_separation_m": 40.0}
    with stepped(light=light) as uav:
        uav.fly(5.0)
        uav.run(5.0)
        geo, projection = uav.vehicle.telemetry().position_geo, uav.vehicle.backend.snapshot().earth.projection
        assert geo is not None
        assert projection is not None
        assert geo.altitude_amsl_m == pytest.approx(35.0, abs=0.01)
        assert geo.altitude_home_m == pytest.approx(5.0, abs=0.01)
        assert geo.altitude_ellipsoid_m == pytest.approx(75.0, abs=0.01)
        local = projection.to_local(geo.latitude_deg, geo.longitude_deg, geo.altitude_amsl_m or 0.0)
        assert (local - uav.pose.position).norm() < 1e-6
        assert tuple(local) == pytest.approx((3.0, 4.0, 5.0), abs=0.01)


# --- The safety pilot -------------------------------------------------------------------------------------------------


def test_the_pilot_takes_over_and_it_hovers_whatever_we_send() -> None:
    drone = Drone()
    drone.fly()
    drone.sim.pilot_take_over()
    drone.run(5.0, velocity(1.0, 1.0, 1.0))
    assert drone.mode() is FlightMode.MANUAL
    assert tuple(drone.pose.position) == pytest.approx((0.0, 0.0, 5.0), abs=0.02)


def test_the_sticks_move_it_along_its_own_axes() -> None:
    drone = Drone(start_yaw_rad=math.pi / 2)
    drone.fly()
    drone.sim.pilot_take_over()
    drone.sim.pilot_move_sticks(forward=1.0)
    drone.run(3.0)
    assert tuple(drone.twist.linear) == pytest.approx((0.0, 1.6, 0.0), abs=0.01)
    drone.sim.pilot_move_sticks(left=0.5, up=-0.5, turn=0.0)
    drone.run(3.0)
    assert tuple(drone.twist.linear) == pytest.approx((-0.8, 0.0, -0.6), abs=0.01)
    drone.sim.pilot_move_sticks(turn=-1.0)
    drone.run(1.0)
    assert drone.twist.angular.z == pytest.approx(-1.0)
    drone.sim.pilot_give_back()
    assert drone.mode() is FlightMode.GUIDED
    drone.run(1.0, PositionSetpoint(drone.pose.position, drone.pose.yaw_rad))
    assert drone.twist.angular.z == pytest.approx(0.0, abs=0.1)


def test_the_sticks_do_nothing_unless_the_pilot_flies() -> None:
    drone = Drone()
    with pytest.raises(WrongStateError, match="the pilot must take over first"):
        drone.sim.pilot_move_sticks(forward=1.0)


@pytest.mark.parametrize("value", [1.01, -2.0, math.nan, math.inf])
def test_a_stick_goes_from_minus_1_to_1(value: float) -> None:
    drone = Drone()
    drone.fly()
    drone.sim.pilot_take_over()
    with pytest.raises(InvalidArgumentError, match="left"):
        drone.sim.pilot_move_sticks(left=value)
    assert not drone.true("sticks").any()


def test_the_pilot_lands_by_hand() -> None:
    drone = Drone()
    drone.fly()
    drone.sim.pilot_take_over()
    drone.sim.pilot_move_sticks(up=-1.0)
    drone.run_until(LandedState.ON_GROUND)
    drone.run(3.0)
    assert not drone.armed


# --- Noise ------------------------------------------------------------------------------------------------------------


def noisy_positions(seed: int, reads: int = 1) -> list[Vector3]:
    drone = Drone(position_noise_m=0.1, velocity_noise_m_s=0.05, seed=seed)
    drone.sim.pilot_arm()
    positions = []
    for _ in range(200):
        drone.run(SIM_STEP_S)
        positions += [drone.pose.position for _ in range(reads)][-1:]
    return positions


def test_noise_is_as_large_as_queried_and_only_in_what_is_reported() -> None:
    drone = Drone(position_noise_m=0.1, velocity_noise_m_s=0.05)
    drone.run(40.0)
    positions = np.array([tuple(s.motion.pose.value.position) for s in drone.snapshots if s.motion.pose])
    speeds = np.array([tuple(s.motion.velocity.value.linear) for s in drone.snapshots if s.motion.velocity])
    assert positions.std(axis=0) == pytest.approx([0.1] * 3, rel=0.1)
    assert speeds.std(axis=0) == pytest.approx([0.05] * 3, rel=0.1)
    assert positions.mean(axis=0) == pytest.approx([0.0] * 3, abs=0.02)
    assert tuple(drone.true("position")) == (0.0, 0.0, 0.0)


def test_the_same_seed_makes_the_same_noise_however_often_it_is_read() -> None:
    assert noisy_positions(seed=1) == noisy_positions(seed=1, reads=3)
    assert noisy_positions(seed=1) != noisy_positions(seed=2)


def test_noise_can_be_changed_while_it_flies() -> None:
    drone = Drone()
    drone.sim.set_noise(position_m=1.0, velocity_m_s=0.0)
    drone.run(SIM_STEP_S)
    assert drone.pose.position != Vector3()
    assert drone.twist.linear == Vector3()
    drone.sim.set_noise(position_m=0.0, velocity_m_s=0.0)
    drone.run(SIM_STEP_S)
    assert drone.pose.position == Vector3()
    for bad in (-0.1, math.nan, 1e9):
        with pytest.raises(InvalidArgumentError):
            drone.sim.set_noise(position_m=bad, velocity_m_s=0.0)
