"""The tables of contents of a firmware: which variables it logs, and which parameters it has. Kept in a cache."""

from __future__ import annotations

import json
import logging
import os
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from ual.shared import whole_file
from ual_daemon import logs
from ual_daemon.backends.crazyflie.packets import LOG, PARAMETER, TOC_CHANNEL, TOC_INFO, TOC_ITEM, CrtpPacket
from ual_daemon.backends.crazyflie.requests import CrtpRequest

_log = logging.getLogger(__name__)

LOG_FORMATS = {1: "B", 2: "H", 3: "I", 4: "b", 5: "h", 6: "i", 7: "f", 8: "e"}
"""The types of logged variables, in the letters of `struct`."""
PARAMETER_FORMATS = {8: "B", 9: "H", 10: "I", 11: "Q", 0: "b", 1: "h", 2: "i", 3: "q", 5: "e", 6: "f", 7: "d"}
_TYPE_MASK = 0x0F
_READ_ONLY_BIT = 0x40
_ITEM = struct.Struct("<BHB")
_INFO = struct.Struct("<BHI")
KINDS = {LOG: "log", PARAMETER: "parameter"}


class Variable(NamedTuple):
    """A logged variable or a parameter: its number, and the letter of its type in `struct`."""

    ident: int
    format: str
    is_read_only: bool = False


Toc = Mapping[str, Variable]
"""By ``group.name``."""


class TocInfo(NamedTuple):
    """Number of entries of a table, and its checksum."""

    size: int
    checksum: int


def ask_info(port: int) -> CrtpRequest:
    """Returns the request for the size and checksum of a table."""
    return CrtpRequest(CrtpPacket(port, TOC_CHANNEL, bytes((TOC_INFO,))), bytes((TOC_INFO,)))


def ask_item(port: int, ident: int) -> CrtpRequest:
    """Returns the request for one entry."""
    data = struct.pack("<BH", TOC_ITEM, ident)
    return CrtpRequest(CrtpPacket(port, TOC_CHANNEL, data), data)


def read_info(data: bytes) -> TocInfo:
    """Returns the content of an answer to `ask_info`."""
    _, size, checksum = _INFO.unpack_from(data)
    return TocInfo(size, checksum)


def read_item(port: int, data: bytes) -> tuple[str, Variable] | None:
    """Returns the name and type in an answer to `ask_item`; None for a type that is not known."""
    _, ident, kind = _ITEM.unpack_from(data)
    formats = LOG_FORMATS if port == LOG else PARAMETER_FORMATS
    names = data[_ITEM.size :].split(b"\0")
    if kind & _TYPE_MASK not in formats or len(names) < 2:
        return None
    name = f"{names[0].decode('latin-1')}.{names[1].decode('latin-1')}"
    return name, Variable(ident, formats[kind & _TYPE_MASK], port == PARAMETER and bool(kind & _READ_ONLY_BIT))


class TocCache:
    """Tables on disk, by their checksum: a second connection does not read them again.

    A user without a home directory, as in a container with any user id, has none unless a directory is named.
    """

    def __init__(self, directory: str | None = None) -> None:
        self._directory = Path(directory) if directory else _default_directory()

    def load(self, port: int, info: TocInfo) -> Toc | None:
        """Returns a table; None if it is not there or cannot be read."""
        if self._directory is None:
            return None
        try:
            rows = json.loads(_path(self._directory, port, info).read_text())
            toc = {str(name): Variable(int(row[0]), str(row[1]), bool(row[2])) for name, row in rows.items()}
        except (OSError, ValueError, TypeError, LookupError, AttributeError):
            return None
        return toc if all(_is_sound(port, each) for each in toc.values()) else None

    def save(self, port: int, info: TocInfo, toc: Toc) -> None:
        """Saves a table, as far as that is possible."""
        if self._directory is None:
            return
        path = _path(self._directory, port, info)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            whole_file.write(path, json.dumps(toc), is_durable=False)
        except OSError as error:
            logs.event(_log, logging.WARNING, "toc_not_saved", path=path, why=str(error))


def _path(directory: Path, port: int, info: TocInfo) -> Path:
    return directory / f"{KINDS[port]}-{info.checksum:08x}-{info.size}.json"


def missing(toc: Toc, names: Iterator[str]) -> list[str]:
    """Returns which of these variables a firmware does not have."""
    return [name for name in names if name not in toc]


def _is_sound(port: int, variable: Variable) -> bool:
    formats = LOG_FORMATS if port == LOG else PARAMETER_FORMATS
    return variable.format in formats.values() and 0 <= variable.ident < 0xFFFF


def _default_directory() -> Path | None:
    configured = os.environ.get("CACHE_DIRECTORY") or os.environ.get("XDG_CACHE_HOME")  # the former is systemd's
    try:
        return (Path(configured) if configured else Path.home() / ".cache") / "ual" / "crazyflie"
    except RuntimeError:  # no HOME, and no such user
        return None
