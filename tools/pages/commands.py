"""The list of the commands of `ual`: what its help shows without importing them."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator

import click

from tools.contract.formatting import formatted
from ual_tools.app import SharedOptions
from ual_tools.main import MODULES

_HEAD = '''"""The commands of ``ual``, as its help lists them. ``make pages`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

from ual_tools.help import ListedCommand, Section

'''
_WIDE = 1000
"""Columns into which each short help fits."""


def source() -> str:
    """Returns the module."""
    rows = (_row(*each) for each in _defined())
    return formatted("\n".join([f"{_HEAD}COMMANDS: Mapping[str, ListedCommand] = {{", *rows, "}", ""]))


def all_commands() -> list[click.Command]:
    """Returns the commands, in the order in which the help lists them."""
    return [command for command, _ in _defined()]


def _defined() -> Iterator[tuple[click.Command, str]]:
    """Yields each command with the smallest module that has it in its `COMMANDS`."""
    for name in MODULES:
        module = importlib.import_module(f"ual_tools.{name}")
        for command in module.COMMANDS:
            own = sys.modules[command.callback.__module__]
            yield command, (own if command in getattr(own, "COMMANDS", ()) else module).__name__


def _row(command: click.Command, module: str) -> str:
    assert isinstance(command, SharedOptions)
    text = command.get_short_help_str(_WIDE)
    return f"    {_quoted(command.name)}: ListedCommand({_quoted(module)}, {command.section}, {_quoted(text)}),"


def _quoted(text: str | None) -> str:
    return json.dumps(text, ensure_ascii=False)
