"""Finds MAVLink frames in received bytes, among garbage, and checks them; decoding comes later."""

from __future__ import annotations

import re
from typing import NamedTuple

from ual_daemon.backends.mavlink.wire import checksum

MAGIC_V1, MAGIC_V2 = 0xFE, 0xFD
_MAGIC = re.compile(rb"[\xfd\xfe]")
_MAGICS = (b"\xfd", b"\xfe")
_HEADER_V1, _HEADER_V2 = 6, 10
_CHECKSUM, _SIGNATURE = 2, 13
_SIGNED = 0x01


class Frame(NamedTuple):
    """One frame with a valid checksum."""

    message_id: int
    system_id: int
    component_id: int
    sequence: int
    is_signed: bool
    data: bytes
    payload: bytes
    """Its content. MAVLink 2 omits zeros at the end."""


class FrameReader:
    """Finds the frames (MAVLink 1 and 2) in pieces of a stream, cut anywhere, or in whole datagrams.

    Bytes that begin like a frame but are not one are searched again from the second byte on. So garbage never hides a
    frame, however the stream is cut. `garbage_count` is the number of bytes that belong to no frame, `corrupt_count`
    the number of uninterrupted runs of them: about the number of damaged frames.
    """

    def __init__(self) -> None:
        self.garbage_count = 0
        self.corrupt_count = 0
        self._rest = b""
        self._is_in_garbage = False

    @property
    def is_waiting(self) -> bool:
        """Whether the last bytes may be the beginning of a frame."""
        return bool(self._rest)

    def feed(self, data: bytes) -> list[Frame]:
        """Returns the frames that end in the next piece of a stream."""
        frames: list[Frame] = []
        data = self._rest + data
        at = 0
        while match := _MAGIC.search(data, at):
            self._skip(match.start() - at)
            at = match.start()
            size = _size_at(data, at)
            if size is None or len(data) - at < size:
                self._rest = data[at:]
                return frames
            frame = _frame(data[at : at + size]) if size else None
            if frame is None:
                self._skip(1)
                at += 1
            else:
                self._is_in_garbage = False
                frames.append(frame)
                at += size
        self._skip(len(data) - at)
        self._rest = b""
        return frames

    def finish(self) -> list[Frame]:
        """Gives up the incomplete frame. Returns the frames that were found within its bytes."""
        frames: list[Frame] = []
        while self._rest:
            rest, self._rest = self._rest, b""
            self._skip(1)
            frames += self.feed(rest[1:])
        return frames

    def read(self, datagram: bytes) -> list[Frame]:
        """Returns the frames of a datagram, which contains only whole ones."""
        frame = _frame(datagram)
        if frame is not None:  # nearly always: one frame
            self._is_in_garbage = False
            return [frame]
        frames = [*self.feed(datagram), *self.finish()]
        self._is_in_garbage = False
        return frames

    def _skip(self, count: int) -> None:
        if count:
            self.garbage_count += count
            self.corrupt_count += not self._is_in_garbage
            self._is_in_garbage = True


def split(datagram: bytes) -> tuple[list[Frame], int]:
    """Returns the frames in a datagram, and how many bytes belong to none."""
    reader = FrameReader()
    return reader.read(datagram), reader.garbage_count


def _size_at(data: bytes, at: int) -> int | None:
    """Returns the size of the frame that begins there; None while it is incomplete, 0 when no frame begins so."""
    left = len(data) - at
    if data[at] == MAGIC_V1:
        return _HEADER_V1 + data[at + 1] + _CHECKSUM if left >= 2 else None
    if left < 3:
        return None
    flags = data[at + 2]
    if flags & ~_SIGNED:
        return 0  # the specification: a frame with unknown flags must be discarded
    return _HEADER_V2 + data[at + 1] + _CHECKSUM + (_SIGNATURE if flags & _SIGNED else 0)


def _frame(data: bytes) -> Frame | None:
    """Returns the one frame that these bytes are, or None."""
    if data[:1] not in _MAGICS or _size_at(data, 0) != len(data):
        return None
    if data[0] == MAGIC_V1:
        message_id, end = data[5], _HEADER_V1 + data[1]
        if checksum.is_valid(message_id, data, end):
            return Frame(message_id, data[3], data[4], data[2], False, data, data[_HEADER_V1:end])
        return None
    message_id, end = data[7] | data[8] << 8 | data[9] << 16, _HEADER_V2 + data[1]
    if checksum.is_valid(message_id, data, end):
        return Frame(message_id, data[5], data[6], data[4], bool(data[2] & _SIGNED), data, data[_HEADER_V2:end])
    return None
