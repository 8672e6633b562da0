"""``ual teleop joystick --map``: requests each axis and button of a device, and saves the mapping."""

from __future__ import annotations

import sys

import click

from ual.joystick import Device, Joysticks, Mapper, RawJoystick
from ual_tools.keys import TerminalKeys
from ual_tools.terminal import keyboard

_KEY_POLL_S = 0.02
_QUIT = (b"q", b"\x03")
_ENTER = (b"\r", b"\n")


def make_mapping(joysticks: Joysticks, device: Device) -> None:
    """Makes the mapping of a device and saves it where `Joysticks` finds it.

    Raises:
        JoystickError: It was disconnected, or is not at rest.
        click.Abort: The user has quit.

    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise click.UsageError("ual teleop joystick --map needs a terminal: its keys")
    with joysticks.open_raw(device) as opened, keyboard() as keys:
        click.echo(f"{device.name}: move each stick and trigger to its ends once, let go of all, then press Enter.")
        _wait_for_enter(opened, keys)
        mapper = Mapper(device.guid, device.name, opened.read())
        click.echo("s: it has no such one; b: back; q: quit without saving.")
        _ask(mapper, opened, keys)
    click.echo(f"saved: {mapper.mapping().save()}")


def _wait_for_enter(opened: RawJoystick, keys: TerminalKeys) -> None:
    while (key := keys.read(_KEY_POLL_S)) not in _ENTER:
        _quit_on_key(key, keys)
        opened.read()  # so that SDL sees what moves


def _ask(mapper: Mapper, opened: RawJoystick, keys: TerminalKeys) -> None:
    shown = ""
    while (question := mapper.question) is not None:
        text = f"{question.text}{f' ({mapper.note})' if mapper.note else ''}"
        if text != shown:
            shown = text
            click.echo(text)
        key = keys.read(_KEY_POLL_S)
        _quit_on_key(key, keys)
        if key == b"s":
            mapper.skip()
        elif key == b"b":
            mapper.back()
        else:
            mapper.feed(opened.read())


def _quit_on_key(key: bytes, keys: TerminalKeys) -> None:
    if key in _QUIT or keys.is_gone:
        raise click.Abort
