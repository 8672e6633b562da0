"""The command that a service without one by hand has: each member, with its arguments."""

from __future__ import annotations

import ast
from dataclasses import replace

import click
import pytest

from tools.contract import commands_source
from tools.contract.compiled import compiled
from tools.contract.parts import ContractPart, PartMember, parts
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session


@pytest.fixture(scope="module")
def logs() -> ContractPart:
    return next(each for each in parts(compiled()) if each.name == "Logs")


def with_member(part: ContractPart, signature: str, returned: str = "None") -> ContractPart:
    """The part with one member of a signature."""
    member: PartMember = part.members[0]
    tree = ast.parse(f"def f(self, {signature}): pass").body[0]
    assert isinstance(tree, ast.FunctionDef)
    made = replace(member, name="play_tune", signature=tree.args, returned=returned, documentation="Plays a tune.")
    return replace(part, members=[made])


def group_of(part: ContractPart) -> click.Group:
    """The group, as Python runs its source."""
    names = {"click": click, "UalCommand": UalCommand, "UalGroup": UalGroup, "Section": Section}
    names |= {"Session": CommandSession, "pass_session": pass_session}
    exec(commands_source.commands(part), names)
    group = names[part.module]
    assert isinstance(group, click.Group)
    return group


def test_a_member_is_a_command_with_its_arguments(logs: ContractPart) -> None:
    group = group_of(
        with_member(logs, "name: str, times: int = 1, *, is_loud: bool = False, pitch_hz: float | None = None")
    )
    command = group.commands["play-tune"]
    own = {each.name: each for each in command.params if each.name in ("name", "times", "is_loud", "pitch_hz")}
    assert [(name, type(each), each.required) for name, each in own.items()] == [
        ("name", click.Argument, True),
        ("times", click.Option, False),
        ("is_loud", click.Option, False),
        ("pitch_hz", click.Option, False),
    ]
    assert (own["times"].default, own["is_loud"].default) == (1, False)
    assert own["is_loud"].opts == ["--loud"]
    assert command.help == "Plays a tune."
    assert isinstance(command, UalCommand)
    assert command.examples == ("ual logs play-tune NAME",)


def test_what_is_reported_is_printed_and_what_is_done_is_reported(logs: ContractPart) -> None:
    assert "session.emit(found, str(found))" in commands_source.commands(with_member(logs, "name: str", "Log"))
    assert '{"done": "logs play-tune"}' in commands_source.commands(with_member(logs, "name: str"))


def test_a_value_that_is_not_typed_needs_a_command_by_hand(logs: ContractPart) -> None:
    with pytest.raises(
        SystemExit, match=r"Logs\.play_tune takes a Vector3: its command is by hand, in ual_tools/logs\.py"
    ):
        commands_source.commands(with_member(logs, "place: Vector3"))
