"""Failsafes of the light autopilot: named, not overridden without force, and in the telemetry."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ual_daemon.stepped import STEP_S, Stepped, at, stepped
from ual.errors import InvalidArgumentError, TaskAbortedError, WrongStateError
from ual.geometry import Twist, Vector3
from ual.simulation import AckLost, Command, CommandRefused, FailsafeTriggered
from ual.types import Health, RecoverFromManualRequest, State, TakeOffRequest
from ual_daemon.backends.values import Cause


@pytest.fixture
def uav() -> Iterator[Stepped]:
    with stepped() as uav:
        yield uav


def health(uav: Stepped) -> Health:
    found = uav.vehicle.telemetry().health
    assert found is not None
    return found


def test_a_task_that_a_failsafe_ends_says_which(uav: Stepped) -> None:
    uav.fly()
    task = uav.prepare.go_to_waypoint(at(9.0, 0.0, 3.0)).begin()
    uav.run(1.0)
    uav.sim.begin_fault(FailsafeTriggered("battery failsafe"))
    uav.until(task.future.done, 1.0)
    error = task.future.exception()
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "battery failsafe"
    assert "safety pilot" not in str(error)
    assert uav.state is State.FLYING_MANUAL
    assert "battery failsafe" in uav.vehicle.telemetry().state_reason
    assert (health(uav).failsafe, health(uav).held_by) == ("battery failsafe", "battery failsafe")


def test_the_safety_pilot_is_still_named(uav: Stepped) -> None:
    uav.fly()
    task = uav.prepare.go_to_waypoint(at(9.0, 0.0, 3.0)).begin()
    uav.run(1.0)
    uav.sim.pilot_take_over()
    uav.until(task.future.done, 1.0)
    error = task.future.exception()
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"
    assert (health(uav).failsafe, health(uav).held_by) == ("", "safety pilot")


@pytest.mark.parametrize("is_over", [False, True])
def test_recover_out_of_a_failsafe_needs_force_and_says_why(uav: Stepped, *, is_over: bool) -> None:
    uav.fly()
    fault = uav.sim.begin_fault(FailsafeTriggered("fence"))
    uav.run(0.1)
    if is_over:  # back inside; but the autopilot still flies by it
        uav.sim.end_fault(fault)
        uav.run(0.1)
    for refused in (
        lambda: uav.vehicle.commands.recover_from_manual().begin(),
        lambda: uav.vehicle.commands.plan(RecoverFromManualRequest()),
    ):
        with pytest.raises(WrongStateError, match=r"fence has taken control.*only with force") as caught:
            refused()
        assert (caught.value.metadata["by"], caught.value.metadata["needed"]) == ("fence", "force")
    assert uav.state is State.FLYING_MANUAL
    uav.end(uav.vehicle.commands.recover_from_manual(force=True).begin())
    assert uav.is_in(State.FLYING_AUTO)


FORCED = [each.value for each in Cause if each.needs_force]


@pytest.mark.parametrize("cause", FORCED)
def test_recover_out_of_each_failsafe_names_it_and_says_force(uav: Stepped, cause: str) -> None:
    uav.fly()
    uav.sim.begin_fault(FailsafeTriggered(cause))
    uav.run(0.1)
    assert health(uav).held_by == cause
    with pytest.raises(WrongStateError, match=f"{cause} has taken control.*only with force") as caught:
        uav.vehicle.commands.recover_from_manual().begin()
    assert (caught.value.metadata["by"], caught.value.metadata["needed"]) == (cause, "force")
    uav.end(uav.vehicle.commands.recover_from_manual(force=True).begin())
    assert uav.is_in(State.FLYING_AUTO)


@pytest.mark.parametrize("cause", FORCED)
def test_no_take_off_into_each_failsafe_and_the_refusal_names_it(uav: Stepped, cause: str) -> None:
    uav.arm()
    uav.sim.begin_fault(FailsafeTriggered(cause))
    uav.run(0.1)
    with pytest.raises(WrongStateError, match=f"{cause} is active.*only with force") as caught:
        uav.prepare.take_off(3.0)
    assert (caught.value.metadata["by"], caught.value.metadata["needed"]) == (cause, "force")


@pytest.mark.parametrize("where", ["disarmed", "armed", "flies"])
def test_nothing_that_moves_is_accepted_while_the_autopilot_stops_its_motors(uav: Stepped, where: str) -> None:
    if where == "flies":
        uav.fly()
    elif where == "armed":
        uav.arm()
    uav.sim.begin_fault(FailsafeTriggered(Cause.TERMINATION.value))
    uav.run(STEP_S)  # no watch of the motion can have found it
    commands = uav.vehicle.commands
    for moves in (
        lambda: uav.prepare.go_to_waypoint(at(1.0, 0.0, 3.0)),
        uav.prepare.return_to_launch,
        lambda: uav.prepare.take_off(3.0),
        lambda: commands.setpoints.set_velocity(Twist(Vector3(1.0, 0.0, 0.0))),
        lambda: commands.setpoints.set_pose(at(1.0, 0.0, 3.0)),
        commands.arm,
    ):
        with pytest.raises(WrongStateError, match="has stopped the motors") as caught:
            moves()
        assert caught.value.metadata["by"] == Cause.TERMINATION.value
    if where == "armed":
        uav.end(commands.disarm())
    elif where == "flies":
        uav.prepare.land()


def test_setpoints_that_were_lost_are_left_without_force(uav: Stepped) -> None:
    uav.fly()
    uav.sim.begin_fault(FailsafeTriggered("setpoint failsafe"), 0.5)
    uav.run(1.0)
    uav.end(uav.vehicle.commands.recover_from_manual().begin())
    assert uav.is_in(State.FLYING_AUTO)


def test_recover_from_the_pilot_while_a_failsafe_is_active_needs_force_too(uav: Stepped) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.sim.begin_fault(FailsafeTriggered("rc failsafe"))
    uav.run(0.1)
    with pytest.raises(WrongStateError, match="rc failsafe is active"):
        uav.vehicle.commands.recover_from_manual()


def test_no_take_off_into_an_active_failsafe_unless_forced(uav: Stepped) -> None:
    uav.arm()
    uav.sim.begin_fault(FailsafeTriggered("rc failsafe"))
    uav.run(0.1)
    for _ in range(3):
        with pytest.raises(WrongStateError, match=r"rc failsafe is active.*only with force") as caught:
            uav.prepare.take_off(3.0)
        assert caught.value.metadata["by"] == "rc failsafe"
    assert uav.state is State.LANDED_ARMED
    uav.end(uav.vehicle.commands.prepare(TakeOffRequest(3.0, force=True)).begin().future)
    assert uav.is_in(State.FLYING_AUTO)


def test_a_failsafe_that_is_over_hinders_no_take_off(uav: Stepped) -> None:
    uav.arm()
    uav.sim.begin_fault(FailsafeTriggered(), 0.5)
    uav.run(1.0)
    uav.end(uav.prepare.take_off(3.0).begin().future)


def test_a_failsafe_that_is_none_is_refused(uav: Stepped) -> None:
    with pytest.raises(InvalidArgumentError, match=r"no failsafe \(known: .*battery failsafe"):
        uav.sim.begin_fault(FailsafeTriggered("bad mood"))


def test_health_says_what_fails(uav: Stepped) -> None:
    assert health(uav) == Health(is_ready_to_arm=True)


def test_land_ends_a_flight_in_which_a_failsafe_holds_without_recovering_control(uav: Stepped) -> None:
    uav.fly()
    uav.sim.begin_fault(FailsafeTriggered("battery failsafe"))
    uav.run(0.1)
    assert uav.is_in(State.FLYING_MANUAL)
    uav.end(uav.prepare.land().begin().future)
    assert uav.state in (State.LANDED_ARMED, State.LANDED_DISARMED)


def test_land_is_never_sent_while_the_pilot_flies_by_sticks_and_says_what_can_be_done(uav: Stepped) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.run(0.1)
    with pytest.raises(WrongStateError, match=r"the safety pilot flies in mode MANUAL.*recover_from_manual") as caught:
        uav.prepare.land()
    assert caught.value.metadata["state"] == "FLYING_MANUAL"


def test_a_pilot_who_takes_over_before_the_landing_begins_ends_it(uav: Stepped) -> None:
    uav.fly()
    uav.sim.begin_fault(CommandRefused(Command.LAND, "not now"))
    uav.sim.begin_fault(FailsafeTriggered("fence"))
    uav.sim.begin_fault(AckLost(Command.LAND))
    uav.run(0.1)
    task = uav.prepare.land().begin()
    uav.run(0.5)
    assert not task.future.done()  # it still holds, and nothing is sent
    uav.sim.pilot_take_over()
    uav.run(0.1)
    error = task.future.exception(timeout=0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"
