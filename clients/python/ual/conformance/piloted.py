"""Checks of the safety pilot, and of the landing."""

from __future__ import annotations

from ual.conformance.check import Need, check
from ual.conformance.flight import Flight, position, require
from ual.errors import TaskAbortedError, WrongStateError
from ual.geometry import Twist
from ual.types import Capability, State, TaskStatus

_LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)


@check(
    State.FLYING_AUTO,
    needs=(Need.PILOT,),
    capabilities=(Capability.POSITION, Capability.RECOVER),
    moves="2 m ahead (8 m, should it not stop)",
)
def the_pilot_takes_over(flight: Flight) -> None:
    """The pilot ends a task at once. Commands are refused until control is recovered, which holds the present pose."""
    uav = flight.uav
    goal = flight.goal(8.0, 0.0)  # so far that it is not there before the pilot, on a busy computer
    task = uav.go_to_waypoint(goal, blocking=False)
    flight.wait(lambda sample: (position(sample) - flight.start.position).norm() >= 0.3, "motion")
    uav.simulation.pilot_take_over()
    flight.refuses(TaskAbortedError, task.wait, "waiting for the task that the pilot ended")
    flight.wait_for_state(State.FLYING_MANUAL)
    require(uav.is_idle(), "a task still runs")
    for action, what in (
        (lambda: uav.go_to_waypoint(goal), "a waypoint"),
        (lambda: uav.set_velocity(Twist()), "a velocity"),
        (uav.land, "landing"),
        (uav.abort, "aborting"),
    ):
        error = flight.refuses(WrongStateError, action, f"{what} while the pilot flies")
        require(error.state == State.FLYING_MANUAL.name, f"{what}: metadata says {error.state}")
    uav.recover_from_manual()
    flight.wait_for_state(State.FLYING_AUTO)
    flight.wait(flight.is_slow, "rest")
    flight.require_stays("after the recovery")
    uav.go_to_waypoint(flight.start)
    flight.require_at(flight.start, "at a waypoint after the recovery")


@check(State.FLYING_AUTO, needs=(Need.PILOT,), moves="1 m aside, by the pilot's sticks")
def the_pilot_flies_and_gives_back(flight: Flight) -> None:
    """The telemetry shows how the pilot flies, and the UAV holds its position when the pilot gives back control."""
    pilot = flight.uav.simulation
    start = flight.position()
    pilot.pilot_take_over()
    flight.wait_for_state(State.FLYING_MANUAL)
    pilot.pilot_move_sticks(forward=0.5)
    flight.wait(lambda sample: (position(sample) - start).norm() >= 1.0, "1 m by the sticks")
    pilot.pilot_move_sticks()
    flight.wait(flight.is_slow, "rest")
    pilot.pilot_give_back()
    flight.wait_for_state(State.FLYING_AUTO)
    flight.require_stays("after the pilot gave back")


@check(State.FLYING_AUTO, capabilities=(Capability.LAND,), moves="straight down")
def lands(flight: Flight) -> None:
    """A landing has the state LANDING, is not aborted by other commands, and ends on the ground. Only a safety pilot
    can end it, or, where there is none, an abort.
    """
    uav = flight.uav
    if not uav.info().has_safety_pilot:
        _lands_until_aborted(flight)
    with flight.recording() as recorded:
        task = uav.land(blocking=False)
        flight.wait_for_state(State.LANDING)
        ends = ((task.cancel, "cancelling a landing"), (uav.abort, "aborting in a landing"))
        waypoint = (lambda: uav.go_to_waypoint(flight.start, blocking=False), "a waypoint in a landing")
        flight.refuses_during(task, (*(ends if uav.info().has_safety_pilot else ()), waypoint))
        require(task.wait().status is TaskStatus.SUCCEEDED, "it did not go on")
        flight.wait_for_state(*_LANDED)
        samples = recorded()
    require(any(sample.state is State.LANDING for sample in samples), "LANDING was not seen")
    aside_m = (flight.position() - flight.ground).horizontal_norm()
    require(aside_m <= 3 * flight.tolerances.position_m, f"it landed {aside_m:.2f} m aside")
    height_m = abs(flight.position().z - flight.ground.z)
    require(height_m <= 2 * flight.tolerances.position_m, f"it landed at a height of {height_m:.2f} m")


def _lands_until_aborted(flight: Flight) -> None:
    task = flight.uav.land(blocking=False)
    flight.give_at_once(flight.uav.abort, flight.wait_for_state(State.LANDING))
    flight.refuses(TaskAbortedError, task.wait, "waiting for the landing that was aborted")
    flight.wait_for_state(State.FLYING_AUTO)
    flight.require_stays("after an aborted landing")


CHECKS = (the_pilot_takes_over, the_pilot_flies_and_gives_back, lands)
