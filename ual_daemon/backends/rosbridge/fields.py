"""Numbers, arrays and stamps in messages. ROS 1 and ROS 2, JSON and CBOR each write them in their own way."""

from __future__ import annotations

import math
import struct
from typing import Any

from ual.geometry import Quaternion, Vector3
from ual_daemon.backends.rosbridge.operations import Message

_FORMATS = {
    64: "B",
    65: ">H",
    66: ">I",
    67: ">Q",
    69: "<H",
    70: "<I",
    71: "<Q",
    72: "b",
    73: ">h",
    74: ">i",
    75: ">q",
    77: "<h",
    78: "<i",
    79: "<q",
    81: ">f",
    82: ">d",
    85: "<f",
    86: "<d",
}
"""The elements of a typed array by its CBOR tag (RFC 8746)."""


def number(value: Any) -> float:  # noqa: ANN401  what another program sent
    """Returns a number; NaN for None, which is how rosbridge writes NaN and infinity in JSON.

    Raises:
        TypeError: It is no number.
    """
    if value is None:
        return math.nan
    if isinstance(value, (int, float)):
        return float(value)
    raise TypeError(f"no number: {value!r}")


def numbers(value: Any) -> tuple[float, ...]:  # noqa: ANN401
    """Returns an array of numbers: a list, bytes, or a typed array of CBOR.

    Raises:
        TypeError: It is none.
    """
    if isinstance(value, bytes):
        return tuple(float(each) for each in value)
    if isinstance(value, (list, tuple)):
        return tuple(map(number, value))
    tag, data = getattr(value, "tag", None), getattr(value, "value", None)
    layout = _FORMATS.get(tag) if isinstance(tag, int) else None
    if layout is None or not isinstance(data, bytes) or len(data) % struct.calcsize(layout):
        raise TypeError(f"no array of numbers: {value!r}")
    return tuple(float(each) for (each,) in struct.iter_unpack(layout, data))


def vector(message: Message) -> Vector3:
    """Returns x, y and z."""
    return Vector3(number(message["x"]), number(message["y"]), number(message["z"]))


def quaternion(message: Message) -> Quaternion:
    """Returns x, y, z and w."""
    return Quaternion(*(number(message[axis]) for axis in "xyzw"))


def stamp_s(message: Message) -> float:
    """Returns the stamp of a message's header, in seconds; 0 if it has none."""
    header = message.get("header")
    stamp = header.get("stamp") if isinstance(header, dict) else None
    if not isinstance(stamp, dict):
        return 0.0
    whole = stamp.get("secs", stamp.get("sec", 0))
    return number(whole) + 1e-9 * number(stamp.get("nsecs", stamp.get("nanosec", 0)))
