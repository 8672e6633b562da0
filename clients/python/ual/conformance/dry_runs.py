"""Checks of dry runs: they return what would happen, and nothing happens."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from ual.conformance.check import check
from ual.conformance.flight import HEIGHT_M, Flight, require
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.interface import DryRun, Uav
from ual.types import Capability, Plan, State

Ask = Callable[[], Plan]


@check(State.LANDED_ARMED, capabilities=(Capability.TAKE_OFF,), moves="the propellers")
def a_dry_take_off_stays_on_the_ground(flight: Flight) -> None:
    """A dry run of a take-off returns its height, and the UAV stays on the ground."""
    plan = flight.uav.dry_run.take_off(HEIGHT_M)
    require(plan.length_m is not None and abs(plan.length_m - HEIGHT_M) <= 0.01, f"it would climb {plan.length_m} m")
    samples = flight.let_pass(1.0)
    require(all(sample.state is State.LANDED_ARMED for sample in samples), "the state changed")
    require(flight.uav.is_idle(), "a task runs")


@check(State.FLYING_AUTO)
def a_dry_run_moves_nothing(flight: Flight) -> None:
    """Dry runs of all commands that it can fly are accepted and return the distance, and nothing moves."""
    goal = flight.goal(3.0, -4.0)
    away_m = (goal.position - flight.position()).norm()
    for capability, ask, has_length in _commands(flight.uav.dry_run, goal):
        if capability not in flight.info.capabilities:
            continue
        plan = ask()
        if has_length:
            require(plan.length_m is not None and plan.duration_s is not None, "the plan has no length or no duration")
            assert plan.length_m is not None
            off_m = abs(plan.length_m - away_m)
            require(off_m <= 2 * flight.tolerances.position_m, f"{plan.length_m:.2f} m to a goal {away_m:.2f} m away")
        require(flight.uav.is_idle(), "a task runs")
        require(flight.uav.state() is State.FLYING_AUTO, "the state changed")
    flight.require_holds(flight.start.position, "after the dry runs")


def _commands(dry: DryRun[Plan], goal: Pose) -> tuple[tuple[Capability, Ask, bool], ...]:
    """Returns for each command the capability that it needs, its dry run, and whether its plan has a length."""
    return (
        (Capability.POSITION, lambda: dry.go_to_waypoint(goal), True),
        (Capability.POSITION, lambda: dry.follow_path([goal]), True),
        (Capability.POSITION, lambda: dry.set_pose(goal), False),
        (Capability.VELOCITY, lambda: dry.set_velocity(Twist(Vector3(1.0, 0.0, 0.0))), False),
        (Capability.LAND, dry.land, False),
        (Capability.LAND, dry.return_to_launch, False),
    )


@check(State.FLYING_AUTO)
def a_dry_run_refuses_what_is_refused(flight: Flight) -> None:
    """A dry run refuses what is not possible or not valid, with the same error as the command itself."""
    for command, dry, what in _refused(flight.uav):
        expected = _refusal(command, what)
        found = _refusal(dry, f"a dry run of {what}")
        require(
            type(found) is type(expected), f"{what}: {found.reason} by the dry run, {expected.reason} by the command"
        )
        require(found.metadata == expected.metadata, f"{what}: the dry run's error has other metadata")
    require(flight.uav.state() is State.FLYING_AUTO, "the state changed")
    flight.require_holds(flight.start.position, "after the refusals")


def _refused(uav: Uav) -> list[tuple[Callable[[], object], Ask, str]]:
    dry = uav.dry_run
    nan = Pose.at(math.nan, 0.0, HEIGHT_M)
    nowhere = PoseStamped(Pose.at(0.0, 0.0, HEIGHT_M), "no_such_frame")
    fast = TwistStamped(Twist(Vector3(math.inf, 0.0, 0.0)))
    return [
        (partial(uav.take_off, HEIGHT_M), partial(dry.take_off, HEIGHT_M), "a take-off"),
        (uav.recover_from_manual, dry.recover_from_manual, "recovering"),
        (partial(uav.go_to_waypoint, nan), partial(dry.go_to_waypoint, nan), "a waypoint that is not a number"),
        (partial(uav.go_to_waypoint, nowhere), partial(dry.go_to_waypoint, nowhere), "a waypoint in an unknown frame"),
        (partial(uav.follow_path, []), partial(dry.follow_path, []), "an empty path"),
        (partial(uav.set_pose, nan), partial(dry.set_pose, nan), "a pose that is not a number"),
        (partial(uav.set_velocity, fast), partial(dry.set_velocity, fast), "an infinite velocity"),
        (
            partial(uav.go_to_waypoint_geo, 91.0, 0.0, HEIGHT_M),
            partial(dry.go_to_waypoint_geo, 91.0, 0.0, HEIGHT_M),
            "a latitude beyond the pole",
        ),
    ]


def _refusal(action: Callable[[], object], what: str) -> UalError:
    try:
        action()
    except UalError as error:
        return error
    require(False, f"{what} was accepted")
    raise AssertionError("unreachable")


CHECKS = (a_dry_take_off_stays_on_the_ground, a_dry_run_moves_nothing, a_dry_run_refuses_what_is_refused)
