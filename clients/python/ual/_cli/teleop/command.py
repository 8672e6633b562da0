"""The commands of ``ual teleop``."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING

import click

from ual._cli import values
from ual._cli.app import Many, Session, UalCommand, UalGroup, note, pass_session
from ual._cli.everyone import several
from ual._cli.help import Section

if TYPE_CHECKING:
    from ual._cli.teleop.cockpit import Controls
    from ual._cli.teleop.craft import Craft

HEIGHT_M = 2.0


@click.group(
    "teleop",
    cls=UalGroup,
    section=Section.FLYING,
    examples=("ual teleop keyboard", "ual --ns uav_1,uav_2 teleop keyboard"),
)
def teleop() -> None:
    """Fly by hand, from the keyboard."""


def height_option(function: Callable[..., None]) -> Callable[..., None]:
    """Adds the height of a take-off to a command."""
    return click.option(
        "--height",
        "height_m",
        type=values.Number(min=0.0, min_open=True),
        default=HEIGHT_M,
        show_default=True,
        metavar="M",
        help="How high a take-off leads, in metres above the ground.",
    )(function)


@teleop.command(
    "keyboard", cls=UalCommand, many=Many.ITSELF, examples=("ual teleop keyboard", "ual --all teleop keyboard")
)
@height_option
@pass_session
def keyboard(session: Session, height_m: float) -> None:
    """Fly by the keys of this terminal, also over SSH.

    Arrow keys, w, s, a and d are the four axes; a key flies while it is held. The screen shows all keys. Space stops
    at once, and so do q, Ctrl-C, Ctrl-Z, and a terminal that is lost. Nothing is sent until a key is pressed. With
    --ns uav_1,uav_2 or --all, Tab chooses the UAV.
    """
    from ual._cli.teleop.keyboard import Keyboard

    fly(session, height_m, Keyboard)


def fly(session: Session, height_m: float, make_controls: Callable[[], Controls]) -> None:
    """Flies the chosen UAVs with a device until the operator leaves."""
    from ual._cli.teleop.cockpit import fly as fly_until_quit
    from ual._cli.teleop.pilot import Pilot

    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise click.UsageError("ual teleop needs a terminal: its screen and its keys")
    with ExitStack() as stack:
        crafts = _crafts(session)
        for craft in crafts:
            stack.callback(craft.close)
            craft.open()
        fly_until_quit(Pilot(crafts, height_m), make_controls(), _say)


def _crafts(session: Session) -> list[Craft]:
    from ual._cli.teleop.craft import Craft

    daemons = several(session)
    if daemons is None:
        return [Craft(session.connect(), session.ns or session.address or "")]
    return [Craft(session.connect_to(daemon), daemon.ns) for daemon in daemons]


def _say(text: str) -> None:
    with suppress(OSError):  # the terminal may be gone
        note(f"ual: {text}")


COMMANDS = (teleop,)
