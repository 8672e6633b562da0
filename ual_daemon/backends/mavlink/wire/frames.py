"""Finds MAVLink frames in received bytes, among garbage, and checks them; decoding comes later."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import NamedTuple

from ual_daemon.backends.hosts import Address
from ual_daemon.backends.mavlink.wire import checksum

MAGIC_V1, MAGIC_V2 = 0xFE, 0xFD
_MAGICS = (b"\xfd", b"\xfe")
_HEADER_V1, HEADER_BYTES = 6, 10
"""Bytes before the content, of MAVLink 1 and 2."""
_crc = checksum.crc
_CHECKSUM, _SIGNATURE = 2, 13
_PLAIN_BYTES = HEADER_BYTES + _CHECKSUM
"""A frame of MAVLink 2 that is not signed, without its content."""
_SIGNED_FLAG = 0x01


def _any_byte(values: set[int]) -> bytes:
    """Returns the pattern of one byte that has one of these values."""
    return b"[" + b"".join(b"\\x%02x" % value for value in sorted(values)) + b"]"


def _beginning() -> re.Pattern[bytes]:
    """Returns the pattern of a header that may be a frame's, or of the part of one at the end of the data.

    MAVLink 2: no unknown flags, as the specification says that such a frame must be discarded. Both: a known message,
    as far as one byte of its id shows it.
    """
    known = checksum.KNOWN_IDS
    middle, high = _any_byte({each >> 8 & 0xFF for each in known}), _any_byte({each >> 16 for each in known})
    v2 = rb"\xfd(?=.[\x00\x01](?:.{5}" + middle + high + rb"|.{0,6}\Z)|.?\Z)"
    v1 = rb"\xfe(?=.{4}" + _any_byte({each for each in known if each < 256}) + rb"|.{0,4}\Z)"
    return re.compile(v2 + b"|" + v1, re.DOTALL)


_BEGINNING = _beginning()

CREDIT_PER_BYTE = 4
"""Each byte that is passed over or read pays for this much work on beginnings that turn out to be false."""
LARGEST_CREDIT_BYTES = 4096
"""Most saved-up work: for 14 false beginnings of the largest frame in a row."""
WORK_PER_S = 400_000
"""Most work per second: a line of 921,600 baud that carries damaged frames only pays this. A byte that is searched
counts as 1. A flood must not take the thread from flying.
"""
SAVED_BUDGET_S = 0.25
"""Seconds of work that may be saved up."""
MOST_SOURCES = 8
"""Most sources of which the beginnings of frames are kept; a new one replaces the source that was received least
lately.
"""
_BEGINNING_COST_BYTES = 48
"""The work of looking at a beginning, in the same unit: bytes that a checksum covers."""


class MessageSource(NamedTuple):
    """Sender of a message: a component of a system."""

    system_id: int
    component_id: int


class MavlinkFrame(NamedTuple):
    """One frame with a valid checksum."""

    message_id: int
    system_id: int
    component_id: int
    sequence: int
    is_signed: bool
    data: bytes
    payload: bytes
    """Its content. MAVLink 2 omits zeros at the end."""

    @property
    def source(self) -> MessageSource:
        """Sender of the frame."""
        return MessageSource(self.system_id, self.component_id)


class FrameReader:
    """Finds the frames (MAVLink 1 and 2) in pieces of a stream, or in datagrams, cut anywhere.

    Bytes that begin like a frame but are not one are searched again from the second byte on. So garbage hides no frame,
    however the stream is cut, with one exception. The work on false beginnings is limited to `CREDIT_PER_BYTE` for each
    byte, so that the time is linear in the number of bytes, whatever they are. Where false beginnings are so dense that
    the credit is used up, up to 90 bytes are passed over unseen, and a frame that begins in them is lost. Damaged
    frames alone do not use it up. One of n bytes pays for 4 n and costs n + 48, and the shortest that matter, the
    heartbeats, have 17 and 21. Where `refill` tells the time, the work is also limited to `WORK_PER_S`. In a flood that
    uses this up, the rest of a datagram, or of a piece, is passed over from its first false beginning on.

    A bridge from a serial line cuts a stream into datagrams without regard to frames, so a frame may go on in the next
    datagram of its source. A datagram that begins with a whole frame never waits for what was begun before. In other
    datagrams an incomplete frame that directly follows a whole one is completed first: its content may look like a
    frame (a log that is downloaded). What looks like a beginning amid garbage holds up no whole frame behind it.

    `garbage_count` is the number of bytes that belong to no frame, `corrupt_count` the number of uninterrupted runs of
    them: about the number of damaged frames.
    """

    def __init__(self) -> None:
        self.garbage_count = 0
        self.corrupt_count = 0
        self._rest = b""
        self._is_in_garbage = False
        self._credit = float(LARGEST_CREDIT_BYTES)
        self._budget = math.inf
        self._refilled_s: float | None = None
        self._sources: dict[Address | None, _FrameSource] = {}

    def refill(self, now_s: float) -> None:
        """Tells the time, for the limit on the work in a second; to be called before bytes are read."""
        if self._refilled_s is None:
            self._budget = WORK_PER_S * SAVED_BUDGET_S
        elif self._budget < WORK_PER_S * SAVED_BUDGET_S:
            self._budget = min(self._budget + WORK_PER_S * (now_s - self._refilled_s), WORK_PER_S * SAVED_BUDGET_S)
        self._refilled_s = now_s

    def feed(self, data: bytes) -> list[MavlinkFrame]:
        """Returns the frames that end in the next piece of a stream."""
        source = self._sources.get(None)
        frames = self._scan(source.begun + data if source is not None else data, goes_on=True, is_stream=True)
        if source is not None or self._rest:
            self._keep(source, None)
        return frames

    def read(self, datagram: bytes, source: Address | None = None) -> list[MavlinkFrame]:
        """Returns the frames that end in a datagram of a source."""
        frame = _frame(datagram)
        if frame is not None:  # nearly always: one frame
            self._is_in_garbage = False
            return [frame]
        if self._budget < 0.0:
            return self.read_beginning(datagram)
        return self._read_pieces(datagram, source)

    def is_plain(self, datagram: bytes, seed: bytes) -> bool:
        """Takes a datagram that is one valid frame of MAVLink 2, not signed: nearly each one is. Its message has this
        seed. Returns False for any other datagram, which is not taken.
        """
        if datagram[0] != MAGIC_V2 or datagram[1] != len(datagram) - _PLAIN_BYTES or datagram[2]:
            return False
        if _crc(datagram[1:-_CHECKSUM] + seed) != datagram[-2] | datagram[-1] << 8:  # as `checksum.is_valid`
            return False
        self._is_in_garbage = False
        return True

    def read_beginning(self, datagram: bytes) -> list[MavlinkFrame]:
        """Returns the frames with which a datagram begins, without a search: for one that is likely not for us."""
        frames: list[MavlinkFrame] = []
        at = 0
        while size := _whole_at(datagram, at):
            frame = _frame(datagram[at : at + size])
            if frame is None:
                break
            frames.append(frame)
            at += size
        self._skip(len(datagram) - at)
        self._is_in_garbage = False
        return frames

    def give_up(self, before_s: float = math.inf) -> list[tuple[Address | None, list[MavlinkFrame]]]:
        """Gives up what was begun and has not gone on since a time. Returns the frames within it, for each source."""
        late = [key for key, source in self._sources.items() if source.begun and source.heard_s < before_s]
        return [(key, self._give_up(self._sources[key])) for key in late]

    def forget(self) -> None:
        """Forgets all that was begun, and how each source cuts its frames: the link is another one."""
        for source in self._sources.values():
            self._skip(len(source.begun))
        self._sources.clear()
        self._is_in_garbage = False

    def _give_up(self, source: _FrameSource) -> list[MavlinkFrame]:
        begun, source.begun = source.begun, b""
        self._skip(1)
        frames = self._scan(begun[1:], goes_on=False)
        self._is_in_garbage = False
        return frames

    def _read_pieces(self, datagram: bytes, key: Address | None) -> list[MavlinkFrame]:
        """Returns the frames of a datagram that is not one frame."""
        source = self._sources.get(key) if self._sources else None
        begun = b"" if source is None else source.begun
        frames: list[MavlinkFrame] = []
        if source is not None and begun and _begins_whole(datagram) and not _begins_whole(begun + datagram):
            frames, begun = self._give_up(source), b""
        # Its own credit: what another datagram contained, perhaps a stranger's, hides nothing in this one.
        saved = source.credit if source is not None and begun else 0.0
        self._credit = min(saved + CREDIT_PER_BYTE * len(datagram), LARGEST_CREDIT_BYTES)
        frames += self._scan(begun + datagram, goes_on=True)
        if not self._rest:
            self._is_in_garbage = False
        if source is not None or self._rest:
            self._keep(source, key)
        return frames

    def _keep(self, source: _FrameSource | None, key: Address | None) -> None:
        """Keeps the beginning of a frame that the last bytes of a source may be."""
        if source is None:
            if len(self._sources) >= MOST_SOURCES:
                del self._sources[min(self._sources, key=lambda each: self._sources[each].heard_s)]
            source = self._sources[key] = _FrameSource()
        source.begun, source.credit = self._rest, self._credit
        source.heard_s = self._refilled_s or 0.0

    def _scan(self, data: bytes, *, goes_on: bool, is_stream: bool = False) -> list[MavlinkFrame]:
        """Returns the frames in some bytes. Where they go on, an incomplete one at the end becomes `_rest`."""
        frames: list[MavlinkFrame] = []
        self._rest = b""
        begin = 0  # of the garbage that is not counted yet
        open_at: int | None = None
        at = self._blind_until(data, 0)
        while match := self._find(data, at):
            found = match.start()
            size = _size_at(data, found)
            if size is None or len(data) - found < size:
                if goes_on and open_at is None:
                    open_at = found
                if goes_on and (is_stream or found == begin):
                    break
                size = 0
            frame = _frame(data[found : found + size]) if size else None
            if frame is None:
                self._earn(found + 1 - at - (_BEGINNING_COST_BYTES + size) / CREDIT_PER_BYTE)
                self._budget -= _BEGINNING_COST_BYTES + size
                at = found + 1 if self._credit >= 0.0 <= self._budget else self._blind_until(data, found + 1)
            else:
                self._skip(found - begin)
                self._is_in_garbage = False
                frames.append(frame)
                begin = found + size
                self._earn(begin - at)
                at = begin
                open_at = None
        end = len(data) if open_at is None else open_at
        self._earn(max(0, end - at))
        self._skip(end - begin)
        self._rest = data[end:]
        return frames

    def _find(self, data: bytes, at: int) -> re.Match[bytes] | None:
        """Returns the next beginning; while the budget is used up, only one right there. Each byte searched costs 1."""
        if self._budget < 0.0:
            return _BEGINNING.match(data, at)
        found = _BEGINNING.search(data, at)
        self._budget -= (found.start() if found else len(data)) - at
        return found

    def _skip(self, count: int) -> None:
        if count:
            self.garbage_count += count
            self.corrupt_count += not self._is_in_garbage
            self._is_in_garbage = True

    def _earn(self, bytes_count: float) -> None:
        self._credit = min(self._credit + CREDIT_PER_BYTE * bytes_count, LARGEST_CREDIT_BYTES)

    def _blind_until(self, data: bytes, at: int) -> int:
        """Returns where to look for the next beginning: further on while credit or budget are used up."""
        if self._budget < 0.0 < at:
            return len(data)
        if self._credit >= 0.0:
            return at
        count = min(math.ceil(-self._credit / CREDIT_PER_BYTE), len(data) - at)
        self._earn(count)
        return at + count


@dataclass(slots=True)
class _FrameSource:
    """A sender of pieces of frames."""

    begun: bytes = b""
    """The beginning of a frame that is not complete."""
    credit: float = 0.0
    heard_s: float = 0.0


def split(datagram: bytes) -> tuple[list[MavlinkFrame], int]:
    """Returns the frames in a datagram, and how many bytes belong to none."""
    reader = FrameReader()
    frames = reader.read(datagram)
    frames += [frame for _, found in reader.give_up() for frame in found]
    return frames, reader.garbage_count


class Piece(NamedTuple):
    """A part of a datagram that one system has sent, by its headers; its checksum is not looked at."""

    system_id: int
    message_id: int
    data: bytes


def pieces(datagram: bytes) -> list[Piece]:
    """Returns the frames that a datagram consists of; none where it is not whole frames only."""
    found: list[Piece] = []
    at = 0
    while at < len(datagram):
        size = _whole_at(datagram, at)
        if not size:
            return []
        found.append(_piece(datagram[at : at + size]))
        at += size
    return found


def piece_of(frame: MavlinkFrame) -> Piece:
    """Returns a checked frame as a piece."""
    return Piece(frame.system_id, frame.message_id, frame.data)


def _piece(frame: bytes) -> Piece:
    if frame[0] == MAGIC_V1:
        return Piece(frame[3], frame[5], frame)
    return Piece(frame[5], frame[7] | frame[8] << 8 | frame[9] << 16, frame)


def _begins_whole(datagram: bytes) -> bool:
    """Returns whether a datagram begins with a whole frame."""
    size = _whole_at(datagram, 0)
    return bool(size) and _frame(datagram[:size]) is not None


def _whole_at(datagram: bytes, at: int) -> int:
    """Returns the size of the frame that may begin there and is not longer than the datagram; 0 if none does."""
    size = _size_at(datagram, at) if _BEGINNING.match(datagram, at) else None
    return size if size and size <= len(datagram) - at else 0


def _size_at(data: bytes, at: int) -> int | None:
    """Returns the size of the frame whose header matches there; None while that is incomplete, 0 if it is none."""
    if data[at] == MAGIC_V1:
        if len(data) - at < _HEADER_V1:
            return None
        length = data[at + 1]
        return _HEADER_V1 + length + _CHECKSUM if length <= checksum.longest_v1(data[at + 5]) else 0
    if len(data) - at < HEADER_BYTES:
        return None
    if data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16 not in checksum.KNOWN_IDS:
        return 0
    # Its length says nothing: zeros at the end are omitted, and a newer autopilot may add fields that we do not know.
    return HEADER_BYTES + data[at + 1] + _CHECKSUM + (_SIGNATURE if data[at + 2] & _SIGNED_FLAG else 0)


def _frame(data: bytes) -> MavlinkFrame | None:
    """Returns the one frame that these bytes are, or None."""
    if len(data) < _HEADER_V1 + _CHECKSUM or data[:1] not in _MAGICS:
        return None
    if data[0] == MAGIC_V1:
        message_id, end = data[5], _HEADER_V1 + data[1]
        if len(data) == end + _CHECKSUM and checksum.is_valid(message_id, data, end):
            return MavlinkFrame(message_id, data[3], data[4], data[2], False, data, data[_HEADER_V1:end])
        return None
    is_signed, end = bool(data[2] & _SIGNED_FLAG), HEADER_BYTES + data[1]
    if data[2] & ~_SIGNED_FLAG or len(data) != end + _CHECKSUM + _SIGNATURE * is_signed:
        return None
    message_id = data[7] | data[8] << 8 | data[9] << 16
    if checksum.is_valid(message_id, data, end):
        found = message_id, data[5], data[6], data[4], is_signed, data, data[HEADER_BYTES:end]
        return tuple.__new__(MavlinkFrame, found)  # as `MavlinkFrame(*found)` does, one call less
    return None
