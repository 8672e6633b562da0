"""Ends of MessagePack messages: TCP has no messages, and `msgspec` decodes only whole ones."""

from __future__ import annotations

from collections.abc import Sequence

_FIXED = {
    0xC0: 1, 0xC2: 1, 0xC3: 1,
    0xCA: 5, 0xCB: 9, 0xCC: 2, 0xCD: 3, 0xCE: 5, 0xCF: 9, 0xD0: 2, 0xD1: 3, 0xD2: 5, 0xD3: 9,
    0xD4: 3, 0xD5: 4, 0xD6: 6, 0xD7: 10, 0xD8: 18,
}  # fmt: skip
"""The length of values that always have the same."""
_FLOAT_CODE = 0xCA
_COUNTED = {0xC4: (1, 0), 0xC5: (2, 0), 0xC6: (4, 0), 0xC7: (1, 1), 0xC8: (2, 1), 0xC9: (4, 1), 0xD9: (1, 0),
            0xDA: (2, 0), 0xDB: (4, 0)}  # fmt: skip
"""Strings, bytes and extensions: the size of their length, and what else comes before their content."""
_CONTAINERS = {0xDC: (2, 1), 0xDD: (4, 1), 0xDE: (2, 2), 0xDF: (4, 2)}
"""Arrays and maps: the size of their count, and the number of values for each of it."""


class MalformedError(ValueError):
    """The stream is not MessagePack."""


def message_end(data: Sequence[int], start: int = 0) -> int | None:
    """Returns where the message ends that begins at `start`; None if it is not complete.

    Raises:
        MalformedError: It is no MessagePack.
    """
    end = least_end(data, start)
    return end if end <= len(data) else None


def least_end(data: Sequence[int], start: int = 0) -> int:
    """Returns where the message ends that begins at `start`. If it is not complete: where it ends at the earliest.

    Of an incomplete one that is beyond the data, so that nothing is to be looked at until so much has come.

    Raises:
        MalformedError: It is no MessagePack.
    """
    position, left, length = start, 1, len(data)
    while left:
        if position + left > length:  # each value takes a byte at least
            return position + left
        if data[position] == _FLOAT_CODE:
            count = _floats_count(data, position, left)
            position, left = position + _FIXED[_FLOAT_CODE] * count, left - count
            continue
        size, inside = _size(data, position)
        position, left = position + size, left + inside - 1
    return position


def _floats_count(data: Sequence[int], start: int, most: int) -> int:
    """Returns how many complete floats follow each other: the depths of a picture are a million. One at least."""
    size = _FIXED[_FLOAT_CODE]
    kinds = bytes(data[start : min(start + size * most, len(data)) : size])
    return max(1, min(len(kinds) - len(kinds.lstrip(bytes((_FLOAT_CODE,)))), (len(data) - start) // size))


def _size(data: Sequence[int], at: int) -> tuple[int, int]:
    """Returns the length of a value without the values inside it, and their number."""
    kind = data[at]
    if kind < 0x80 or kind >= 0xE0:
        return 1, 0
    if kind < 0xA0:
        return 1, (kind & 0x0F) * (2 if kind < 0x90 else 1)
    if kind < 0xC0:
        return 1 + (kind & 0x1F), 0
    if kind in _FIXED:
        return _FIXED[kind], 0
    if kind in _COUNTED:
        width, extra = _COUNTED[kind]
        return 1 + width + extra + _number(data, at + 1, width), 0
    if kind in _CONTAINERS:
        width, values = _CONTAINERS[kind]
        return 1 + width, values * _number(data, at + 1, width)
    raise MalformedError(f"0x{kind:02x} begins no value of MessagePack")


def _number(data: Sequence[int], at: int, width: int) -> int:
    """Returns a big-endian number. It may end beyond the data: the message is then seen to be incomplete."""
    return int.from_bytes(bytes(data[at : at + width]).ljust(width, b"\0"), "big")
