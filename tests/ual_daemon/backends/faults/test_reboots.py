"""The autopilot reboots, on the ground and in the air."""

from __future__ import annotations

from tests.ual_daemon.backends.faults.craft import Can, Craft
from tests.ual_daemon.backends.faults.over import over
from ual.geometry import Pose
from ual.types import State


def boots(craft: Craft) -> int:
    snapshot = craft.backend.snapshot()
    return snapshot.link.boots_count + snapshot.link.boots_in_frame_count


@over(Can.REBOOT, Can.BE_UNHEARD)
def test_a_reboot_on_the_ground_is_noticed_and_it_flies_again(craft: Craft) -> None:
    craft.ready()
    craft.run(10.0)
    before = boots(craft)
    craft.play((0.0, craft.fall_silent), (0.0, craft.reboot), (1.5, craft.speak), for_s=2.0)
    craft.until(lambda: boots(craft) == before + 1)
    craft.fly()
    assert craft.uav.state() is State.FLYING_AUTO
    assert boots(craft) == before + 1


@over(Can.REBOOT, Can.BE_UNHEARD)
def test_nothing_is_sent_unasked_to_one_that_has_booted_in_flight(craft: Craft) -> None:
    craft.fly()
    craft.uav.go_to_waypoint(Pose.at(5.0, 0.0, 3.0), blocking=False)
    begin_s = craft.play((1.0, craft.fall_silent), (1.0, craft.reboot), (2.5, craft.speak), for_s=8.0)
    assert craft.commands_since(begin_s) == []
    assert craft.setpoints_between(begin_s + 2.5) == []
