"""The commands of ``ual teleop``."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ual_tools import values
from ual_tools.app import Multi, UalCommand, UalGroup
from ual_tools.help import Section
from ual_tools.selection import several
from ual_tools.session import REFUSED_STATUS, CommandSession, note, pass_session
from ual_tools.strict_yaml.loading import loaded

if TYPE_CHECKING:
    from ual.joystick import Device, Joysticks
    from ual_tools.teleop.layout import Layout
    from ual_tools.teleop.loop import Controls
    from ual_tools.teleop.vehicle import TeleopVehicle

HEIGHT_M = 2.0


@click.group(
    "teleop",
    cls=UalGroup,
    section=Section.FLYING,
    examples=("ual teleop keyboard", "ual teleop joystick", "ual --ns uav_1,uav_2 teleop keyboard"),
)
def teleop() -> None:
    """Fly by hand: by keyboard, joystick or gamepad."""


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
    "keyboard", cls=UalCommand, multi=Multi.ITSELF, examples=("ual teleop keyboard", "ual --all teleop keyboard")
)
@height_option
@pass_session
def keyboard(session: CommandSession, height_m: float) -> None:
    """Fly by the keys of this terminal, also over SSH.

    Arrow keys, w, s, a and d are the four axes; a key flies while it is held. The screen shows all keys. Space stops
    at once, and so do q, Ctrl-C, Ctrl-Z, and a terminal that is lost. Nothing is sent until a key is pressed. With
    --ns uav_1,uav_2 or --all, Tab chooses the UAV.
    """
    from ual_tools.teleop.keyboard import Keyboard

    fly(session, height_m, Keyboard)


@teleop.command(
    "joystick",
    cls=UalCommand,
    multi=Multi.ITSELF,
    examples=("ual teleop joystick", "ual teleop joystick --list", "ual teleop joystick --map"),
)
@height_option
@click.option(
    "--device", "which", metavar="WHICH", help="Its number, or a part of its name; the only one if not given."
)
@click.option("--config", "file", type=click.Path(path_type=Path), help="What its axes and buttons mean (YAML).")
@click.option("--list", "is_listing", is_flag=True, help="Only list the joysticks of this computer.")
@click.option("--map", "is_mapping", is_flag=True, help="Only say which axis and button of the device is which.")
@pass_session
def joystick(
    session: CommandSession, height_m: float, which: str | None, file: Path | None, is_listing: bool, is_mapping: bool
) -> None:
    """Fly by a joystick or gamepad.

    The sticks fly only while the left shoulder button is held. Take-off, landing and recovery need two buttons
    together. The screen shows all of them. Space stops at once, q quits.
    """
    from ual.joystick import JoystickError, Joysticks

    layout = _layout(file)
    try:
        with Joysticks() as joysticks:
            if is_listing:
                _list(joysticks)
                return
            device = joysticks.find(int(which) if which is not None and which.isdecimal() else which)
            if is_mapping:
                from ual_tools.teleop.mapping import make_mapping

                make_mapping(joysticks, device)
            else:
                _fly_by(session, height_m, joysticks, device, layout)
    except JoystickError as error:
        note(f"ual: {error}")
        raise click.exceptions.Exit(REFUSED_STATUS) from None


def _layout(file: Path | None) -> Layout:
    from ual_tools.teleop.layout import Layout

    return Layout() if file is None else loaded(_load_layout, file, "--config", "ual-tools[joystick]")


def _load_layout(file: Path) -> Layout:
    from ual_tools.teleop.layout_file import load

    return load(file)


def _list(joysticks: Joysticks) -> None:
    found = joysticks.list()
    if not found:
        note("no joystick is connected")
    for device in found:
        click.echo(f"{device.index}\t{device.name}\t{'known' if device.is_mapped else 'needs --map'}")


def _fly_by(session: CommandSession, height_m: float, joysticks: Joysticks, device: Device, layout: Layout) -> None:
    from ual_tools.teleop.joystick import JoystickControls

    controls = JoystickControls(joysticks, device, layout)
    try:
        fly(session, height_m, lambda: controls)
    finally:
        controls.close()


def fly(session: CommandSession, height_m: float, make_controls: Callable[[], Controls]) -> None:
    """Flies the chosen UAVs with a device until the operator leaves."""
    from ual_tools.teleop.loop import fly as fly_until_quit
    from ual_tools.teleop.pilot import Pilot

    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise click.UsageError("ual teleop needs a terminal: its screen and its keys")
    with ExitStack() as stack:
        vehicles = _vehicles(session)
        for vehicle in vehicles:
            stack.callback(vehicle.close)
            vehicle.open()
        fly_until_quit(Pilot(vehicles, height_m), make_controls(), _say)


def _vehicles(session: CommandSession) -> list[TeleopVehicle]:
    from ual_tools.teleop.vehicle import TeleopVehicle

    daemons = several(session)
    if daemons is None:
        uav = session.connect(with_lease=False)
        return [TeleopVehicle(uav, session.ns or session.address or "", takes_lease=session.takes_lease)]
    return [TeleopVehicle(session.connect_to(daemon), daemon.ns, takes_lease=session.takes_lease) for daemon in daemons]


def _say(text: str) -> None:
    with suppress(OSError):  # the terminal may be gone
        note(f"ual: {text}")


COMMANDS = (teleop,)
