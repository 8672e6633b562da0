"""The vehicle is not heard. What is sent may reach it all the same, and a pilot may have taken over unseen."""

from __future__ import annotations

import pytest

from tests.ual_daemon.backends.faults.craft import Action, Can, Craft
from tests.ual_daemon.backends.faults.over import over
from ual.errors import LinkLostError
from ual.geometry import Pose
from ual.types import State
from ual_daemon.flight.setpoint_sender import LONGEST_BLIND_S

NOTICED_S = LONGEST_BLIND_S + 0.05
"""A silence is noticed by then. What has left before is on its way."""
FAR = Pose.at(40.0, 0.0, 4.0)


@over(Can.BE_UNHEARD)
def test_a_silent_link_is_lost_and_heals_by_itself(craft: Craft) -> None:
    craft.fly()
    task = craft.uav.go_to_waypoint(FAR, blocking=False)
    begin_s = craft.play((1.0, craft.fall_silent), (4.0, craft.speak), for_s=8.0)
    assert craft.first_s(State.UNINITIALIZED, begin_s) - begin_s < 1.0 + craft.link_s
    with pytest.raises(LinkLostError):
        task.wait(0.0)
    assert craft.states[-1][1] is not State.UNINITIALIZED
    assert craft.commands_since(begin_s) == []  # nothing is armed, and no mode changed, unasked


@over(Can.BE_UNHEARD)
@pytest.mark.parametrize("name", ["land", "arm"])
def test_nothing_is_commanded_in_a_silence(craft: Craft, name: str) -> None:
    craft.fly()
    begin_s = craft.play(
        (0.1, craft.fall_silent),
        (0.6, lambda: craft.command(name)),
        (1.2, craft.speak),
        for_s=1.2,
    )
    assert craft.commands_since(begin_s, begin_s + 1.2) == []


@over(Can.BE_UNHEARD, Can.BE_FLOWN_BY_A_PILOT)
@pytest.mark.parametrize(("name", "taken_s"), [("land", 0.5), ("land", 0.9), ("take_control", 0.5), ("take_off", 0.9)])
def test_a_command_in_a_silence_overrules_no_pilot_after_it(craft: Craft, name: str, taken_s: float) -> None:
    craft.fly()
    begin_s = craft.play(
        (0.1, craft.fall_silent),
        (0.7, lambda: craft.command(name)),
        (taken_s, craft.pilot_takes_over),
        (1.4, craft.speak),
        for_s=5.0,
    )
    assert craft.commands_since(begin_s) == []
    assert craft.uav.state() is State.FLYING_MANUAL


@over(Can.BE_UNHEARD, Can.IGNORE, Can.BE_FLOWN_BY_A_PILOT)
def test_nothing_is_repeated_in_a_silence(craft: Craft) -> None:
    """A Crazyflie has no pilot, and falls where its high-level commander does not take over: it is asked on and on."""
    craft.fly()
    craft.ignore()
    begin_s = craft.play(
        (0.1, lambda: craft.command("land")),
        (0.15, craft.fall_silent),
        (1.2, craft.speak),
        for_s=1.2,
    )
    assert craft.commands_since(begin_s + 0.15 + NOTICED_S, begin_s + 1.2) == []


def undo_in_silence(craft: Craft, command: Action, undo: Action, silent_s: float) -> float:
    """Has the vehicle fall silent as it gets a command, which it obeys; others undo that before it is heard again.

    Returns when the command came.
    """
    told_s = craft.now_s
    came_s: list[float] = []

    def fall_silent_once_reported() -> None:
        if not came_s and craft.commands_since(told_s):
            came_s.append(craft.now_s)
            craft.fall_silent()
            craft.later((0.4, undo), (silent_s, craft.speak))

    looks = [(0.01 * n, fall_silent_once_reported) for n in range(200)]
    craft.play((0.0, command), *looks, for_s=silent_s + 5.0)
    return came_s[0]


@over(Can.BE_UNHEARD)
@pytest.mark.parametrize("silent_s", [0.6, 3.0])
def test_what_was_disarmed_in_a_silence_is_not_armed_again(craft: Craft, silent_s: float) -> None:
    craft.arm()
    craft.uav.disarm()
    craft.run(3.0)
    craft.ready()
    came_s = undo_in_silence(craft, craft.uav.vehicle.commands.arm, craft.pilot_disarms, silent_s)
    assert craft.commands_since(came_s + 0.4) == []
    assert craft.uav.state() is State.LANDED_DISARMED


@over(Can.BE_UNHEARD, Can.BE_FLOWN_BY_A_PILOT, Can.REPEAT)
def test_what_a_pilot_took_back_in_a_silence_is_not_taken_again(craft: Craft) -> None:
    craft.fly()
    craft.pilot_takes_over()
    craft.until_state(State.FLYING_MANUAL)
    craft.run(1.0)
    recover = craft.uav.vehicle.commands.recover_from_manual().begin
    came_s = undo_in_silence(craft, recover, craft.pilot_takes_over, 0.6)
    assert craft.commands_since(came_s + 0.4) == []
    assert craft.uav.state() is State.FLYING_MANUAL


@over(Can.BE_UNHEARD, Can.BE_FLOWN_BY_A_PILOT)
@pytest.mark.parametrize(("silent_s", "seen_s"), [(0.6, 0.5), (1.4, 0.02)])
def test_nothing_from_before_a_silence_is_believed_after_it(craft: Craft, silent_s: float, seen_s: float) -> None:
    """After a short one, the pilot's mode is seen as soon as without any."""
    craft.fly()
    craft.uav.go_to_waypoint(FAR, blocking=False)
    craft.run(1.0)
    begin_s = craft.play(
        (0.0, craft.fall_silent),
        (0.1, craft.pilot_takes_over),
        (silent_s, craft.speak),
        for_s=silent_s + 3.0,
    )
    assert craft.setpoints_between(begin_s + silent_s + seen_s) == []
    assert craft.uav.state() is State.FLYING_MANUAL
