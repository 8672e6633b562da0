"""Loads a file that a command was given. PyYAML is not imported before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import click

from ual.shared import extras
from ual_tools.session import note

T = TypeVar("T")

WRONG_FILE_STATUS = 2
"""The exit status of a command that was given a file that is not valid."""


class YamlFileError(Exception):
    """The file is not valid; the message is one line that names the place."""


def loaded(load: Callable[[Path], T], file: Path, what: str, extra: str) -> T:
    """Returns what `load` makes of a file; ends the command where it is not valid.

    Raises:
        NotSupportedError: `what` needs the extra.

    """
    try:
        with extras.needs(what, extra):
            return load(file)
    except YamlFileError as error:
        note(f"ual: {error}")
        raise click.exceptions.Exit(WRONG_FILE_STATUS) from None
