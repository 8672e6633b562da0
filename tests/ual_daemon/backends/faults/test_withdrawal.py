"""A command that is not wanted any more is sent neither for the first time nor again."""

from __future__ import annotations

from concurrent.futures import Future

import pytest

from tests.ual_daemon.backends.faults.craft import Can, Craft
from tests.ual_daemon.backends.faults.over import over


def cancel(commands: list[Future[None]]) -> None:
    for each in commands:
        each.cancel()


NAMES = ["land", "take_off"]


@over()
@pytest.mark.parametrize("name", NAMES)
def test_a_command_that_is_withdrawn_at_once_does_not_leave_later(craft: Craft, name: str) -> None:
    craft.fly()
    begin_s = craft.play((0.0, lambda: craft.command(name).cancel()), for_s=2.0)
    assert craft.commands_since(begin_s + 0.05) == []


@over(Can.IGNORE)
@pytest.mark.parametrize("name", NAMES)
def test_a_command_that_is_withdrawn_is_not_sent_again(craft: Craft, name: str) -> None:
    craft.fly()
    craft.ignore()
    commands: list[Future[None]] = []
    begin_s = craft.play(
        (0.0, lambda: commands.append(craft.command(name))),
        (0.6, lambda: cancel(commands)),
        (0.7, lambda: craft.ignore(does=False)),
        for_s=3.0,
    )
    assert craft.commands_since(begin_s + 0.65) == []


@over(Can.BE_HELD_UP)
@pytest.mark.parametrize("name", NAMES)
def test_a_command_that_waits_on_our_side_is_withdrawn(craft: Craft, name: str) -> None:
    craft.fly()
    craft.run(1.0)
    commands: list[Future[None]] = []
    begin_s = craft.play(
        (0.0, craft.hold_up),
        (0.02, lambda: commands.append(craft.command(name))),
        (0.12, lambda: cancel(commands)),
        (0.22, lambda: craft.hold_up(does=False)),
        for_s=2.0,
    )
    assert craft.commands_since(begin_s) == []
