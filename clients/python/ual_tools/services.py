"""The commands of the services beside flying. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

import click

from ual_tools import cameras, fence, gimbals, gripper, logs, parameters
from ual_tools.app import UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.session import CommandSession, pass_session


@click.group(
    "parachute",
    cls=UalGroup,
    section=Section.CARRIED,
    examples=(
        "ual parachute ordered",
        "ual parachute enable",
        "ual parachute disable",
        "ual parachute release",
    ),
)
def parachute() -> None:
    """The parachute that it carries."""


@parachute.command("ordered", cls=UalCommand, examples=("ual parachute ordered",))
@pass_session
def _parachute_ordered(session: CommandSession) -> None:
    """Returns the order that was acknowledged last, such as "enable"."""
    with session.connect() as uav:
        found = uav.parachute.ordered()
    session.emit({"ordered": found}, str(found))


@parachute.command("enable", cls=UalCommand, examples=("ual parachute enable",))
@pass_session
def _parachute_enable(session: CommandSession) -> None:
    """Lets it be released, also by the autopilot itself. Returns once that is acknowledged."""
    with session.connect() as uav:
        uav.parachute.enable()
    session.emit({"done": "parachute enable"}, "done")


@parachute.command("disable", cls=UalCommand, examples=("ual parachute disable",))
@pass_session
def _parachute_disable(session: CommandSession) -> None:
    """Keeps it from being released. Returns once that is acknowledged."""
    with session.connect() as uav:
        uav.parachute.disable()
    session.emit({"done": "parachute disable"}, "done")


@parachute.command("release", cls=UalCommand, examples=("ual parachute release",))
@pass_session
def _parachute_release(session: CommandSession) -> None:
    """Releases it: the UAV falls below it."""
    with session.connect() as uav:
        uav.parachute.release()
    session.emit({"done": "parachute release"}, "done")


COMMANDS: tuple[click.Command, ...] = (
    *cameras.COMMANDS,
    *fence.COMMANDS,
    *gimbals.COMMANDS,
    *gripper.COMMANDS,
    *logs.COMMANDS,
    *parameters.COMMANDS,
    parachute,
)
