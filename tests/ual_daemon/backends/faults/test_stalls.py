"""The thread that hears the vehicle does not run: a starved computer, a stopped process. What comes meanwhile waits."""

from __future__ import annotations

import pytest

from tests.ual_daemon.backends.faults.craft import Can, Craft
from tests.ual_daemon.backends.faults.over import over
from ual.errors import UalError
from ual.geometry import Pose, Twist, Vector3
from ual.types import State
from ual_daemon.flight.setpoint_sender import LONGEST_BLIND_S

FAR = Pose.at(40.0, 0.0, 4.0)
FORWARDS = Twist(Vector3(0.5, 0.0, 0.0))
BEGUN_S = 0.15
"""A stall has begun by then, with the next update."""


@over(Can.STALL, Can.BE_FLOWN_BY_A_PILOT)
@pytest.mark.parametrize("stall_s", [0.5, 1.5])
def test_no_setpoint_leaves_while_nothing_is_read(craft: Craft, stall_s: float) -> None:
    """A program goes on with its velocities; the pilot takes over."""
    craft.fly()
    stream = [(0.04 * n, lambda: craft.uav.set_velocity(FORWARDS)) for n in range(round((stall_s + 0.5) / 0.04))]
    begin_s = craft.play(
        *stream,
        (0.1, lambda: craft.stall(stall_s)),
        (0.3, craft.pilot_takes_over),
        for_s=stall_s + 3.0,
    )
    assert craft.setpoints_between(begin_s + 0.1 + BEGUN_S + LONGEST_BLIND_S) == []
    assert craft.uav.state() is State.FLYING_MANUAL


@over(Can.STALL, Can.BE_FLOWN_BY_A_PILOT)
@pytest.mark.parametrize(("name", "stall_s"), [("land", 0.6), ("land", 1.5), ("take_control", 0.6)])
def test_a_command_in_a_stall_overrules_no_pilot(craft: Craft, name: str, stall_s: float) -> None:
    craft.fly()
    begin_s = craft.play(
        (0.0, lambda: craft.stall(stall_s)),
        (0.35, craft.pilot_takes_over),
        (0.5, lambda: craft.command(name)),
        for_s=stall_s + 4.0,
    )
    assert craft.commands_since(begin_s) == []
    assert craft.uav.state() is State.FLYING_MANUAL


@over(Can.STALL)
def test_a_command_that_waits_for_too_long_in_a_stall_is_not_executed(craft: Craft) -> None:
    craft.fly()
    begin_s = craft.play((0.0, lambda: craft.stall(8.0)), (0.5, lambda: craft.command("land")), for_s=12.0)
    assert craft.commands_since(begin_s) == []


@over(Can.STALL)
def test_a_stall_is_not_blamed_on_the_vehicle(craft: Craft) -> None:
    craft.fly()
    task = craft.uav.go_to_waypoint(FAR, blocking=False)
    gaps: list[str] = []
    craft.uav.vehicle.subscribe(lambda _: gaps.append(craft.backend.snapshot().scheduling_gap))
    craft.play((0.0, lambda: craft.stall(2.5)), for_s=4.0)
    assert "this computer did not run UAL for 2.5 s" in gaps
    with pytest.raises(UalError, match=r"this computer (did not run|has not run) UAL for 2\.\d s"):
        task.wait(0.0)


@over(Can.STALL)
def test_a_short_stall_ends_no_flight(craft: Craft) -> None:
    craft.fly()
    task = craft.uav.go_to_waypoint(Pose.at(3.0, 0.0, 3.0), blocking=False)
    craft.play((0.5, lambda: craft.stall(0.2)), for_s=1.0)
    task.wait(60.0)
