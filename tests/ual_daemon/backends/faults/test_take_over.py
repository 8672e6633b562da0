"""The safety pilot takes over, by a mode of the autopilot. Nothing of ours reaches the vehicle from then on."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.ual_daemon.backends.faults.craft import Can, Craft
from tests.ual_daemon.backends.faults.over import over
from ual.errors import RejectedByAutopilotError, TaskAbortedError
from ual.geometry import Pose, Twist, Vector3
from ual.types import LandRequest, State, TakeOffRequest
from ual_daemon import UAL

GOAL = Pose.at(12.0, 6.0, 4.0)


def go(uav: UAL) -> None:
    uav.go_to_waypoint(GOAL, blocking=False)


def follow(uav: UAL) -> None:
    uav.follow_path([Pose.at(6.0, 0.0, 4.0), Pose.at(6.0, 6.0, 4.0), GOAL], blocking=False)


def hold(uav: UAL) -> None:
    pose = uav.telemetry().pose
    assert pose is not None
    uav.set_pose(pose)


def stream(uav: UAL) -> None:
    uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))


@over(Can.BE_FLOWN_BY_A_PILOT)
@pytest.mark.parametrize("manoeuvre", [go, follow, hold, stream])
def test_it_is_observed_and_nothing_is_sent_after(craft: Craft, manoeuvre: Callable[[UAL], None]) -> None:
    craft.fly()
    begin_s = craft.play((0.0, lambda: manoeuvre(craft.uav)), (0.37, craft.pilot_takes_over), for_s=4.0)
    told_s = craft.first_s(State.FLYING_MANUAL, begin_s)
    assert told_s - begin_s - 0.37 < craft.seen_s
    assert craft.setpoints_between(told_s + 0.04) == []
    assert craft.commands_since(begin_s) == []
    assert craft.uav.state() is State.FLYING_MANUAL


@over(Can.BE_FLOWN_BY_A_PILOT)
def test_it_ends_a_task_again_and_again(craft: Craft) -> None:
    craft.fly()
    for after_s in (0.05, 0.31, 0.8):
        task = craft.uav.go_to_waypoint(GOAL, blocking=False)
        craft.play((after_s, craft.pilot_takes_over), for_s=after_s + 1.5)
        with pytest.raises(TaskAbortedError, match="safety pilot"):
            task.wait(0.0)
        craft.uav.recover_from_manual()
    craft.uav.land()


@over(Can.BE_FLOWN_BY_A_PILOT, Can.IGNORE)
@pytest.mark.parametrize("name", ["land", "take_off"])
def test_a_command_that_was_lost_is_not_sent_again_over_it(craft: Craft, name: str) -> None:
    craft.fly()
    craft.ignore()
    begin_s = craft.play(
        (0.0, lambda: craft.command(name)),
        (0.1, craft.pilot_takes_over),
        (0.1 + craft.seen_s, lambda: craft.ignore(does=False)),
        for_s=5.0,
    )
    assert craft.commands_since(begin_s + 0.1 + craft.seen_s) == []
    assert craft.uav.state() is State.FLYING_MANUAL


@over(Can.BE_FLOWN_BY_A_PILOT, Can.BE_HELD_UP)
def test_a_setpoint_that_waited_on_our_side_does_not_leave_after_it(craft: Craft) -> None:
    craft.fly()
    begin_s = craft.play(
        (0.0, lambda: stream(craft.uav)),
        (0.1, craft.hold_up),
        (0.12, lambda: stream(craft.uav)),
        (0.15, craft.pilot_takes_over),
        (0.15 + craft.seen_s, lambda: craft.hold_up(does=False)),
        for_s=3.0,
    )
    assert craft.setpoints_between(begin_s + 0.1 + craft.seen_s) == []


@over(Can.BE_FLOWN_BY_A_PILOT, Can.BE_HELD_UP)
@pytest.mark.parametrize("name", ["land", "take_control"])
def test_a_command_that_waited_on_our_side_does_not_leave_after_it(craft: Craft, name: str) -> None:
    craft.fly()
    begin_s = craft.play(
        (0.0, craft.hold_up),
        (0.05, lambda: craft.command(name)),
        (0.1, craft.pilot_takes_over),
        (0.1 + craft.seen_s, lambda: craft.hold_up(does=False)),
        for_s=4.0,
    )
    assert craft.commands_since(begin_s) == []
    assert craft.uav.state() is State.FLYING_MANUAL


@over(Can.BE_FLOWN_BY_A_PILOT)
def test_one_in_the_moment_of_a_landing_is_not_overruled(craft: Craft) -> None:
    craft.fly()
    judged = craft.uav.vehicle.commands.prepare(LandRequest())
    craft.pilot_takes_over()
    craft.until_state(State.FLYING_MANUAL)
    begin_s = craft.now_s
    task = judged.begin()
    craft.run(3.0)
    assert craft.commands_since(begin_s) == []
    assert craft.uav.state() is State.FLYING_MANUAL
    with pytest.raises((TaskAbortedError, RejectedByAutopilotError)):
        task.future.result(0.0)


@pytest.mark.parametrize(
    "craft", ["px4", "ardupilot", "mavros px4", "mavros ardupilot", "dji psdk", "light"], indirect=True
)
def test_one_in_the_moment_of_a_take_off_is_not_overruled(craft: Craft) -> None:
    craft.arm()
    # MAVROS may tell the mode up to a second after the arming. Until then a change of it may be the arming's own.
    craft.until(lambda: craft.backend.snapshot().control.settled_mode)
    judged = craft.uav.vehicle.commands.prepare(TakeOffRequest(craft.height_m))
    mode = craft.backend.snapshot().control.mode_name
    craft.pilot_takes_over()
    craft.run(1.5)
    assert craft.backend.snapshot().control.mode_name != mode
    begin_s = craft.now_s
    task = judged.begin()
    craft.run(3.0)
    assert craft.commands_since(begin_s) == []
    assert craft.uav.state() is State.LANDED_ARMED
    with pytest.raises((TaskAbortedError, RejectedByAutopilotError)):
        task.future.result(0.0)
