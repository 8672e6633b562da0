"""Mappings: which axis, button or hat of a device is which of the standard layout. In SDL's own text format."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from collections.abc import Mapping as Dictionary
from dataclasses import dataclass
from pathlib import Path

from ual.joystick._errors import MappingError
from ual.joystick._state import Axis, Button
from ual.shared import whole_file
from ual.shared.text import decoded, rows_of

_GUID = re.compile(r"[0-9a-f]{32}")
_BINDING = re.compile(r"[+-]?a\d+~?|b\d+|h\d+\.[1248]")
_OTHER_FIELDS = {"platform", "crc", "type", "face", "hint", "sdk>=", "sdk<="}
"""Fields of a line that bind nothing. SDL reads them."""
_MORE_BUTTONS = {
    "misc1",
    *(f"misc{number}" for number in range(2, 7)),
    "touchpad",
    *(f"paddle{n}" for n in range(1, 5)),
}
"""Buttons that SDL knows, and the standard layout does not have."""
_NAMES = {each.value for each in (*Axis, *Button)} | _MORE_BUTTONS


@dataclass(frozen=True)
class Mapping:
    """Says what of one kind of device is bound to which axis and button of the standard layout."""

    guid: str
    name: str
    bindings: Dictionary[str, str]
    """Such as ``leftx: a0``, ``lefty: a1~`` (inverted), ``a: b3``, ``dpup: h0.1``."""

    def __str__(self) -> str:
        """Returns the line of a file that says it."""
        bound = "".join(f"{name}:{binding}," for name, binding in self.bindings.items())
        return f"{self.guid},{self.name.replace(',', ' ')},{bound}platform:Linux,"

    def save(self, directory: Path | None = None) -> Path:
        """Writes it to the user's mappings, where `Joysticks` finds it, in place of one of the same device.

        Returns:
            The file.

        """
        folder = mapping_directory() if directory is None else directory
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f"{self.guid}.txt"
        whole_file.write(file, f"{self}\n")
        return file


def mapping_directory() -> Path:
    """Returns where the user's mappings are: ``~/.config/ual/joysticks``, or below ``XDG_CONFIG_HOME``.

    Raises:
        MappingError: The user has no home directory, as in a container with any user id.

    """
    try:
        return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "ual" / "joysticks"
    except RuntimeError:
        raise MappingError("there is no home directory: set HOME or XDG_CONFIG_HOME") from None


def own_mappings() -> list[str]:
    """Returns the lines of the user's mappings; none where the user has no home directory."""
    try:
        directory = mapping_directory()
    except MappingError:
        return []
    return read_mappings(directory)


def read_mappings(directory: Path) -> list[str]:
    """Returns the lines of all files (``*.txt``) of a directory; none where it does not exist.

    Raises:
        MappingError: A file cannot be read, or a line is no mapping.

    """
    return [line for file in sorted(directory.glob("*.txt")) for line in _rows(file)]


def _rows(file: Path) -> Iterable[str]:
    try:
        text = decoded(file.read_bytes())
    except (OSError, ValueError) as error:
        raise MappingError(f"{file} cannot be read: {error}") from None
    for number, line in enumerate(rows_of(text), 1):
        if line.strip() and not line.startswith("#"):
            _check(line.strip(), f"{file}, line {number}")
            yield line.strip()


def _check(line: str, where: str) -> None:
    """Refuses what SDL would leave out without a word."""
    guid, _, rest = line.partition(",")
    name, _, fields = rest.partition(",")
    if not (_GUID.fullmatch(guid) and name):
        raise MappingError(f"{where}: it does not begin with the device's GUID (32 hexadecimal digits) and name")
    bound: set[str] = set()
    for field in filter(None, fields.split(",")):
        key, _, binding = field.partition(":")
        if key in bound:
            raise MappingError(f"{where}: {key} is bound twice, of which SDL takes one")
        bound.add(key)
        if key in _OTHER_FIELDS:
            continue
        if key.lstrip("+-") not in _NAMES:
            raise MappingError(f"{where}: {key!r} is neither an axis nor a button of SDL's game controllers")
        if not _BINDING.fullmatch(binding):
            raise MappingError(f"{where}: {key}:{binding} is bound to no axis (a0), button (b0) or hat (h0.1)")
