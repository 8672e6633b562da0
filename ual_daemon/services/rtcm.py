"""RTCM 3 as it is framed: 0xD3, six bits that are zero, ten bits of length, the content, and 24 bits of CRC-24Q."""

from __future__ import annotations

_FRAME_START_BYTE = 0xD3
_HEAD_BYTES = _CRC_BYTES = 3
LEAST_CONTENT_BYTES = 2
"""The number of a message has 12 bits. What is shorter is a filler, and is skipped."""
LONGEST_CONTENT_BYTES = 1023
MOST_FALSE_STARTS = 64
"""With more starts of frames that prove wrong in one piece, all of it is taken for garbage: each check costs time."""
_CRC_POLYNOMIAL = 0x1864CFB


def _of_byte(byte: int) -> int:
    crc = byte << 16
    for _ in range(8):
        crc <<= 1
        if crc & 0x1000000:
            crc ^= _CRC_POLYNOMIAL
    return crc


_TABLE = tuple(map(_of_byte, range(256)))


def crc24q(data: bytes | bytearray) -> int:
    """Returns the checksum of some bytes. Over a frame with its checksum it is 0."""
    crc, table = 0, _TABLE
    for byte in data:
        crc = (crc << 8 & 0xFFFF00) ^ table[crc >> 16 ^ byte]
    return crc


class RtcmFramer:
    """Finds whole messages in a stream that may begin anywhere, be cut, and have other bytes between.

    `skipped_count` counts the bytes that belonged to no message.
    """

    def __init__(self) -> None:
        self.skipped_count = 0
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Takes the next bytes. Returns the messages with a right checksum that are whole now, with their frames."""
        self._rest += data
        found: list[bytes] = []
        false_count = 0
        while self._seek():
            end = _end_of(self._rest)
            if end > len(self._rest):
                break
            frame = self._rest[:end]
            if end and crc24q(frame) == 0:
                found.append(bytes(frame))
                del self._rest[:end]
                continue
            false_count += end > 0
            self._skip(1 if false_count <= MOST_FALSE_STARTS else len(self._rest))
        return found

    def _seek(self) -> bool:
        """Skips to the next byte with which a frame may begin. Returns whether there is one."""
        start = self._rest.find(_FRAME_START_BYTE)
        self._skip(start if start >= 0 else len(self._rest))
        return start >= 0

    def _skip(self, count: int) -> None:
        self.skipped_count += count
        del self._rest[:count]


def _end_of(data: bytearray) -> int:
    """Returns where a frame that begins here ends, beyond the data where that is not known; 0: none begins here."""
    if len(data) > 1 and data[1] > LONGEST_CONTENT_BYTES >> 8:
        return 0
    if len(data) < _HEAD_BYTES:
        return len(data) + 1
    length = data[1] << 8 | data[2]
    return 0 if length < LEAST_CONTENT_BYTES else _HEAD_BYTES + length + _CRC_BYTES
