"""MAVLink frames in what a link received, told apart by their headers alone: most are dropped before decoding."""

from __future__ import annotations

from dataclasses import dataclass

MAGIC_V1, MAGIC_V2 = 0xFE, 0xFD
_HEADER_V1, _HEADER_V2 = 6, 10
_CHECKSUM, _SIGNATURE = 2, 13
_SIGNED = 0x01


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame, not yet checked: its checksum is part of decoding."""

    message_id: int
    system_id: int
    component_id: int
    data: bytes


def split(datagram: bytes) -> tuple[list[Frame], int]:
    """The frames in a datagram (MAVLink 1 and 2), and how many bytes belong to none."""
    frames: list[Frame] = []
    garbage, at, end = 0, 0, len(datagram)
    while at < end:
        frame = _frame_at(datagram, at)
        if frame is None:
            garbage += 1
            at += 1
        else:
            frames.append(frame)
            at += len(frame.data)
    return frames, garbage


def _frame_at(data: bytes, at: int) -> Frame | None:
    left = len(data) - at
    magic = data[at]
    if magic == MAGIC_V2 and left >= _HEADER_V2 + _CHECKSUM:
        size = _HEADER_V2 + data[at + 1] + _CHECKSUM + (_SIGNATURE if data[at + 2] & _SIGNED else 0)
        if left >= size:
            message_id = data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16
            return Frame(message_id, data[at + 5], data[at + 6], data[at : at + size])
    elif magic == MAGIC_V1 and left >= _HEADER_V1 + _CHECKSUM:
        size = _HEADER_V1 + data[at + 1] + _CHECKSUM
        if left >= size:
            return Frame(data[at + 5], data[at + 3], data[at + 4], data[at : at + size])
    return None
