from __future__ import annotations

import math
from typing import Any

import pytest

from tests.ual_daemon.backends.light.drone import Drone, hold, velocity
from ual.errors import InvalidArgumentError, LinkLostError, RejectedByAutopilotError
from ual.geometry import Vector3
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    Fault,
    LinkLost,
    MotorsWeak,
    PositionLost,
)
from ual.types import GpsFix, Limits
from ual_daemon.backends.light.physics import SIM_STEP_S, FlightMode

HERE = hold(0.0, 0.0, 5.0)


@pytest.fixture
def drone() -> Drone:
    flying = Drone()
    flying.fly(5.0)
    return flying


# --- Begin and end ----------------------------------------------------------------------------------------------------


def test_a_fault_ends_after_its_duration_of_simulated_time(drone: Drone) -> None:
    fault_id = drone.sim.begin_fault(PositionLost(), duration_s=2.0)
    drone.run(1.9, HERE)
    assert drone.sim.faults() == {fault_id: PositionLost()}
    drone.run(0.2, HERE)
    assert drone.sim.faults() == {}


def test_a_fault_without_duration_lasts_until_it_is_ended(drone: Drone) -> None:
    first = drone.sim.begin_fault(MotorsWeak(0.5))
    second = drone.sim.begin_fault(BatteryLow(50.0))
    drone.run(30.0, HERE)
    assert drone.sim.faults() == {first: MotorsWeak(0.5), second: BatteryLow(50.0)}
    drone.sim.end_fault(first)
    assert drone.sim.faults() == {second: BatteryLow(50.0)}
    drone.sim.end_fault()
    assert drone.sim.faults() == {}
    drone.sim.end_fault()  # ending none of them is no error


def test_ending_a_fault_that_is_not_is_refused(drone: Drone) -> None:
    with pytest.raises(InvalidArgumentError, match="there is no fault 'nope'"):
        drone.sim.end_fault("nope")


IMPOSSIBLE: list[tuple[Any, str]] = [
    (MotorsWeak(-0.1), "fault.motors_weak.power_ratio"),
    (MotorsWeak(1.1), "fault.motors_weak.power_ratio"),
    (BatteryLow(101.0), "fault.battery_low.remaining_percent"),
    (BatteryLow(math.nan), "fault.battery_low.remaining_percent"),
    (EstimatorJumps(period_s=0.0), "fault.estimator_jumps.period_s"),
    (EstimatorJumps(offset=Vector3(math.nan, 0, 0)), "fault.estimator_jumps.offset.x"),
    (AckLate(delay_s=0.0), "fault.ack_late.delay_s"),
    ("rain", "fault"),
]


@pytest.mark.parametrize(("fault", "field"), IMPOSSIBLE)
def test_an_impossible_fault_is_refused(drone: Drone, fault: Any, field: str) -> None:
    with pytest.raises(InvalidArgumentError) as caught:
        drone.sim.begin_fault(fault)
    assert caught.value.metadata["field"] == field
    assert drone.sim.faults() == {}


@pytest.mark.parametrize("duration_s", [-1.0, math.nan, math.inf])
def test_an_impossible_duration_is_refused(drone: Drone, duration_s: float) -> None:
    with pytest.raises(InvalidArgumentError, match="duration_s"):
        drone.sim.begin_fault(LinkLost(), duration_s)


# --- The link ---------------------------------------------------------------------------------------------------------


def test_with_the_link_lost_the_snapshot_ages_and_nothing_arrives(drone: Drone) -> None:
    before = drone.backend.snapshot()
    drone.sim.begin_fault(LinkLost())
    drone.run(0.8, velocity(1.0))
    late = drone.backend.snapshot()
    assert late.time_s == pytest.approx(before.time_s + 0.8)
    assert late.heard_s == pytest.approx(before.time_s)
    assert late.motion.pose == before.motion.pose
    assert late.control.mode == before.control.mode
    assert drone.true("velocity")[0] == pytest.approx(0.0, abs=0.01)
    assert not drone.backend.land(Limits()).done()
    assert not drone.backend.hold().done()
    drone.run(1.0)
    assert drone.mode() is FlightMode.HOLD  # the autopilot holds by itself, without setpoints


def test_updates_go_on_while_the_link_is_lost(drone: Drone) -> None:
    drone.sim.begin_fault(LinkLost())
    count = len(drone.snapshots)
    drone.run(0.5)
    assert len(drone.snapshots) - count == round(0.5 / SIM_STEP_S)


@pytest.mark.parametrize("fault", [AckLost(Command.LAND), AckLate(Command.LAND, delay_s=60.0), LinkLost()])
def test_an_answer_that_has_not_come_when_it_is_closed_is_an_error(drone: Drone, fault: Fault) -> None:
    drone.sim.begin_fault(fault)
    answer = drone.backend.land(Limits())
    assert not answer.done()
    drone.backend.close()
    with pytest.raises(LinkLostError, match="this UAV was closed"):
        answer.result(0)
    with pytest.raises(LinkLostError, match="this UAV is closed"):
        drone.backend.land(Limits()).result(0)


def test_the_link_comes_back(drone: Drone) -> None:
    drone.sim.begin_fault(LinkLost(), duration_s=0.5)
    drone.run(0.6, HERE)
    snapshot = drone.backend.snapshot()
    assert snapshot.heard_s == snapshot.time_s
    drone.run(2.0, velocity(1.0))
    assert drone.true("velocity")[0] == pytest.approx(1.0, abs=0.01)


def test_the_safety_pilot_needs_no_link_of_ours(drone: Drone) -> None:
    drone.sim.begin_fault(LinkLost())
    drone.sim.pilot_take_over()
    assert drone.mode() is FlightMode.MANUAL


# --- Position and estimator -------------------------------------------------------------------------------------------


def test_with_the_position_lost_it_says_so_and_holds_its_height(drone: Drone) -> None:
    drone.sim.begin_fault(PositionLost())
    drone.run(2.0, velocity(1.0))
    snapshot = drone.backend.snapshot()
    assert snapshot.motion.estimator is not None
    assert not snapshot.motion.estimator.value.is_good
    assert "position" in snapshot.motion.estimator.value.why
    assert snapshot.motion.position_geo is None
    assert snapshot.condition.gps is not None
    assert snapshot.condition.gps.fix is GpsFix.NONE
    assert drone.mode() is FlightMode.ALTITUDE
    assert drone.true("position")[2] == pytest.approx(5.0, abs=0.05)
    assert isinstance(drone.backend.take_control().exception(timeout=0), RejectedByAutopilotError)
    assert isinstance(drone.backend.hold().exception(timeout=0), RejectedByAutopilotError)


def test_the_position_comes_back_but_not_the_mode(drone: Drone) -> None:
    drone.sim.begin_fault(PositionLost(), duration_s=1.0)
    drone.run(2.0)
    estimator = drone.backend.snapshot().motion.estimator
    assert estimator is not None
    assert estimator.value.is_good
    assert drone.mode() is FlightMode.ALTITUDE
    drone.backend.take_control().result(timeout=0)
    assert drone.mode() is FlightMode.GUIDED


def test_the_safety_pilot_flies_and_the_autopilot_lands_without_a_position(drone: Drone) -> None:
    drone.sim.begin_fault(PositionLost())
    drone.run(SIM_STEP_S)
    drone.sim.pilot_take_over()
    drone.sim.pilot_move_sticks(forward=1.0)
    drone.run(2.0)
    assert drone.true("velocity")[0] > 1.0
    drone.backend.land(Limits()).result(timeout=0)
    drone.run(15.0)
    assert drone.true("is_landed")


def test_without_a_position_it_does_not_arm() -> None:
    drone = Drone()
    drone.sim.begin_fault(PositionLost())
    drone.run(SIM_STEP_S)
    with pytest.raises(RejectedByAutopilotError, match="no position estimate"):
        drone.sim.pilot_arm()


def test_the_estimate_jumps_there_and_back_and_the_autopilot_follows_it(drone: Drone) -> None:
    drone.sim.begin_fault(EstimatorJumps(Vector3(0.0, 2.0, 0.0), period_s=4.0))
    drone.run(2 * SIM_STEP_S, HERE)
    assert drone.pose.position.y - drone.true("position")[1] == pytest.approx(2.0)
    drone.run(3.8, HERE)
    assert drone.true("position")[1] == pytest.approx(-2.0, abs=0.2)
    drone.run(4 * SIM_STEP_S + 0.2, HERE)
    assert drone.pose.position.y == pytest.approx(drone.true("position")[1])
    drone.sim.end_fault()
    drone.run(5.0, HERE)
    assert drone.true("position")[1] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("period_s", [5e-324, 1e-3])
def test_an_estimate_may_jump_more_often_than_it_is_looked_at(drone: Drone, period_s: float) -> None:
    drone.sim.begin_fault(EstimatorJumps(Vector3(0.0, 2.0, 0.0), period_s=period_s))
    drone.run(4 * SIM_STEP_S, HERE)
    assert drone.pose.position.y - drone.true("position")[1] in (pytest.approx(0.0), pytest.approx(2.0))


# --- Motors and battery -----------------------------------------------------------------------------------------------


def test_weak_motors_speed_up_more_slowly(drone: Drone) -> None:
    drone.sim.begin_fault(MotorsWeak(0.25))
    drone.run(SIM_STEP_S, HERE)
    drone.run(1.0, velocity(1.6))
    assert drone.true("velocity")[0] == pytest.approx(0.5, abs=0.02)  # a quarter of 2 m/s^2
    drone.sim.end_fault()
    drone.run(1.0, velocity(1.6))
    assert drone.true("velocity")[0] > 1.4


def test_motors_without_any_power_change_nothing(drone: Drone) -> None:
    drone.sim.begin_fault(MotorsWeak(0.0))
    drone.run(SIM_STEP_S, HERE)
    drone.run(2.0, velocity(1.6))
    assert drone.true("velocity")[0] == pytest.approx(0.0, abs=1e-3)


def test_the_battery_falls_and_stays_low(drone: Drone) -> None:
    drone.sim.begin_fault(BatteryLow(10.0))
    drone.run(1.0, HERE)
    assert drone.true("battery_percent") == pytest.approx(10.0, abs=0.2)
    drone.sim.end_fault()
    drone.run(1.0, HERE)
    assert drone.true("battery_percent") < 10.0


def test_a_battery_that_is_emptier_already_is_not_charged(drone: Drone) -> None:
    before = drone.true("battery_percent")
    drone.sim.begin_fault(BatteryLow(100.0))
    drone.run(1.0, HERE)
    assert drone.true("battery_percent") < before


# --- Commands ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", [Command.LAND, Command.ANY])
def test_a_refused_command_has_no_effect_and_carries_the_words(drone: Drone, command: Command) -> None:
    drone.sim.begin_fault(CommandRefused(command, "Accels inconsistent"))
    error = drone.backend.land(Limits()).exception(timeout=0)
    assert isinstance(error, RejectedByAutopilotError)
    assert error.metadata["text"] == "Accels inconsistent"
    assert drone.mode() is FlightMode.GUIDED
    drone.run(SIM_STEP_S)
    assert drone.backend.snapshot().condition.status_text == "Accels inconsistent"


def test_other_commands_than_the_refused_one_are_obeyed(drone: Drone) -> None:
    drone.sim.begin_fault(CommandRefused(Command.ARM))
    drone.backend.land(Limits()).result(timeout=0)
    assert drone.mode() is FlightMode.LAND


def test_nobody_refuses_the_safety_pilot_nor_the_hold_that_makes_safe(drone: Drone) -> None:
    drone.sim.begin_fault(CommandRefused(Command.ANY))
    drone.sim.begin_fault(AckLost(Command.ANY))
    drone.sim.pilot_take_over()
    assert drone.mode() is FlightMode.MANUAL
    drone.backend.hold().result(timeout=0)
    assert drone.mode() is FlightMode.HOLD


@pytest.mark.parametrize("command", [Command.LAND, Command.ANY])
def test_a_lost_acknowledgement_leaves_the_effect(drone: Drone, command: Command) -> None:
    drone.sim.begin_fault(AckLost(command))
    ack = drone.backend.land(Limits())
    assert drone.mode() is FlightMode.LAND
    drone.run(10.0)
    assert not ack.done()


def test_a_late_acknowledgement_comes_late(drone: Drone) -> None:
    drone.sim.begin_fault(AckLate(Command.LAND, delay_s=1.5))
    ack = drone.backend.land(Limits())
    assert drone.mode() is FlightMode.LAND
    drone.run(1.4)
    assert not ack.done()
    drone.run(0.2)
    assert ack.result(timeout=0) is None


def test_a_late_acknowledgement_that_nobody_waits_for_any_more_is_nothing(drone: Drone) -> None:
    drone.sim.begin_fault(AckLate(delay_s=1.0))
    assert drone.backend.land(Limits()).cancel()
    drone.run(2.0)
