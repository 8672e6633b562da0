"""Files of autopilots about their parameters: PX4's descriptions, and ArduPilot's packed list.

https://mavlink.io/en/services/component_information.html; ArduPilot's libraries/AP_Filesystem/README.md.
"""

from __future__ import annotations

import json
import lzma
import math
import struct
import zlib
from collections.abc import Iterator
from typing import Any

from ual.parameters.values import Description, Parameter, ParameterType

LARGEST_FILE_BYTES = 16_000_000
"""Most bytes of a file once it is unpacked. PX4's has 0.7 MB."""
MOST_MEMORY_BYTES = 100_000_000
"""Most memory of unpacking in bytes: xz -9, by which PX4 packs, takes 66 MB."""
MOST_PARAMETERS = 10_000
LONGEST_TEXT_CHARACTERS = 500
_PARAMETERS_KIND = 1
_FILE_FORMAT_ID = 0x671B
_HEADER = struct.Struct("<HHH")
_PACKED = {
    1: ("<b", ParameterType.INT8),
    2: ("<h", ParameterType.INT16),
    3: ("<i", ParameterType.INT32),
    4: ("<f", ParameterType.REAL32),
}


def unpacked(data: bytes, crc: int) -> bytes:
    """Returns the content of a file that may be compressed by xz. 0 as checksum: it is not known.

    Raises:
        ValueError: The checksum is wrong, or the file is damaged or too long.

    """
    content = _decompressed(data) if data.startswith(b"\xfd7zXZ") else data
    # PX4's checksum is that of the file that is read, but for the general file, where it is that of the content.
    if crc not in (0, _crc(data), _crc(content)):
        raise ValueError(f"its checksum is not {crc:#x}")
    return content


def parameters_uri(general: bytes) -> tuple[str, int] | None:
    """Returns where the descriptions of the parameters are, and their checksum; None where there are none.

    Raises:
        ValueError: It is not such a file.

    """
    for each in _json(general, "metadataTypes"):
        if each.get("type") == _PARAMETERS_KIND and isinstance(each.get("uri"), str):
            crc = each.get("fileCrc", 0)
            return each["uri"], crc if isinstance(crc, int) else 0
    return None


def file_path(uri: str) -> str | None:
    """Returns the path of a file on the autopilot; None for any other place, as of the web."""
    kind, _, path = uri.partition("://")
    if kind != "mftp":
        return None
    component, _, rest = path.partition("]")
    if component.startswith("[;comp="):
        return rest if component == "[;comp=1" else None
    return path or None


def descriptions(data: bytes) -> dict[str, Description]:
    """Reads the descriptions of parameters, by name. What cannot be read of one is left out.

    Raises:
        ValueError: It is not such a file.

    """
    found = {}
    for each in _json(data, "parameters")[:MOST_PARAMETERS]:
        name = each.get("name")
        if isinstance(name, str) and name:
            found[name] = Description(
                _number(each.get("min")),
                _number(each.get("max")),
                _text(each.get("units")),
                _text(each.get("shortDesc")),
                each.get("rebootRequired") is True,
            )
    return found


def packed_list(data: bytes) -> list[Parameter]:
    """Reads ArduPilot's ``@PARAM/param.pck``.

    Raises:
        ValueError: It is damaged.

    """
    try:
        magic, count, total = _HEADER.unpack_from(data)
        found = list(_packed(data[_HEADER.size :]))
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"the list is damaged: {error}") from None
    if magic != _FILE_FORMAT_ID or not count == total == len(found):
        raise ValueError(f"the list has {len(found)} of {total} parameters")
    return found


def _packed(data: bytes) -> Iterator[Parameter]:
    at, name = 0, b""
    while at < len(data):
        if not data[at]:  # so that no value is in two blocks
            at += 1
            continue
        if len(data) < at + 2 or data[at] not in _PACKED:
            raise struct.error("an unknown type")
        layout, kind = _PACKED[data[at]]
        common, length = data[at + 1] & 15, (data[at + 1] >> 4) + 1
        name = name[:common] + data[at + 2 : at + 2 + length]
        [value] = struct.unpack_from(layout, data, at + 2 + length)
        at += 2 + length + struct.calcsize(layout)
        yield Parameter(name.decode("ascii"), value, kind)


def _decompressed(data: bytes) -> bytes:
    unpacker = lzma.LZMADecompressor(memlimit=MOST_MEMORY_BYTES)
    try:
        content = unpacker.decompress(data, LARGEST_FILE_BYTES)
    except (lzma.LZMAError, EOFError) as error:
        raise ValueError(f"it is damaged: {error}") from None
    if not unpacker.eof:
        raise ValueError(f"it is cut off, or has over {LARGEST_FILE_BYTES} bytes")
    return content


def _crc(data: bytes) -> int:
    """Returns MAVLink's checksum of a file: CRC-32 without inversions."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def _json(data: bytes, name: str) -> list[dict[str, Any]]:
    try:
        found = json.loads(data)
    except RecursionError:
        raise ValueError("it is nested too deep") from None
    listed = found.get(name) if isinstance(found, dict) else None
    rows = [each for each in listed if isinstance(each, dict)] if isinstance(listed, list) else None
    if rows is None:
        raise ValueError(f"it has no {name}")
    return rows


def _number(value: object) -> float | None:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    try:
        number = float(value) if is_number else math.nan  # type: ignore[arg-type]  # it is a number
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _text(value: object) -> str:
    return " ".join(value.split())[:LONGEST_TEXT_CHARACTERS] if isinstance(value, str) else ""
