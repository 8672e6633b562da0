"""Commands that the autopilot refuses, or does not answer."""

from __future__ import annotations

import pytest

from tests.ual_daemon.backends.faults.craft import Can, Craft
from tests.ual_daemon.backends.faults.over import over
from ual.errors import RejectedByAutopilotError, UalError
from ual.types import State


@over(Can.REFUSE)
def test_a_refusal_is_reported_and_not_queried_about_again(craft: Craft) -> None:
    craft.arm()
    craft.uav.disarm()
    craft.until_state(State.LANDED_DISARMED)
    craft.refuse("its compass is upside down")
    with pytest.raises(RejectedByAutopilotError):
        craft.uav.arm()
    begin_s = craft.run(3.0)
    assert craft.commands_since(begin_s) == []
    assert craft.uav.state() is State.LANDED_DISARMED


@over(Can.IGNORE)
def test_a_command_without_an_answer_fails_and_is_not_sent_later(craft: Craft) -> None:
    craft.fly()
    craft.ignore()
    with pytest.raises(UalError):
        craft.uav.land()
    begin_s = craft.play((0.1, lambda: craft.ignore(does=False)), for_s=4.0)
    assert craft.commands_since(begin_s + 0.1) == []
    assert craft.uav.state() is State.FLYING_AUTO
    craft.uav.land()


@over(Can.IGNORE, Can.REPEAT)
def test_a_command_that_is_received_late_is_obeyed_once(craft: Craft) -> None:
    craft.arm()
    craft.uav.disarm()
    craft.run(3.0)
    craft.ignore()
    craft.play((0.0, lambda: craft.command("arm")), (0.7, lambda: craft.ignore(does=False)), for_s=3.0)
    assert craft.uav.state() is State.LANDED_ARMED
