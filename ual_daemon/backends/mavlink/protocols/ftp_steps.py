"""The steps of an exchange about files: one request with its answer, and the reading of a part of a file."""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, TypeVar

from typing_extensions import override

from ual.errors import UalError, UalTimeoutError
from ual_daemon.backends.mavlink.protocols.ftp_packet import (
    BLOCK_BYTES,
    SEQUENCES_COUNT,
    FtpNakError,
    FtpPacket,
    Nak,
    Opcode,
)

T = TypeVar("T")

RETRY_S = 1.0
"""Seconds without an answer after which a request is sent again, ..."""
TRIES_COUNT = 10
"""... and most attempts."""
PROGRESS_TIMEOUT_S = 15.0
"""Seconds without a new block after which the reading of a file ends."""
WINDOW_BLOCKS = 4
"""Blocks that are requested at once. ArduPilot queues 5 requests, and drops the others."""
GENTLE_DOWNLOAD_BYTES_S = 96_000.0
"""Most bytes a second that are requested while armed, and no more than half of what the link carries."""
BURST_SILENCE_S = 1.0
"""Seconds without a block after which a burst is over, ..."""
BURST_BLOCKS = 8
"""... and consecutive blocks for which it is worth while."""
MOST_BLOCKS = 2048
"""Most blocks that are kept ahead of their time: a burst of ArduPilot has 500, one of PX4 some 150."""
BURST_SEQUENCES = 1024
"""The sequence numbers that are a burst's. ArduPilot takes a request that has one of its answers for a repetition."""


class FtpLink:
    """Link to the files of one autopilot, which sends requests, each with a sequence number of its own."""

    def __init__(self, send: Callable[[bytes], object], is_gentle: Callable[[], bool]) -> None:
        self._send = send
        self.is_gentle = is_gentle
        """Whether it may be flying: then nothing may delay what flies it."""
        self._sequence = random.randrange(SEQUENCES_COUNT)  # noqa: S311  no secret: the autopilot may repeat an answer to a daemon of before

    def next_sequence(self, room: int = 1) -> int:
        """Returns a number that no answer has yet; `room` are those that its answers may have."""
        sequence, self._sequence = self._sequence, (self._sequence + room) % SEQUENCES_COUNT
        return sequence

    def request(self, sequence: int, opcode: Opcode, session: int, offset: int, data: bytes, size: int) -> None:
        """Sends a request."""
        self._send(FtpPacket(sequence, session, opcode, size, offset=offset, data=data).encode())


class OpenFile:
    """A file that is open on the autopilot. Keeps the blocks that have come, but were not read yet."""

    def __init__(self, path: str, session: int, size: int) -> None:
        self.path = path
        self.session = session
        self.size = size
        """As it was opened. Of ArduPilot's @PARAM files only a bound."""
        self.end: int | None = None
        """Offset at which the file has turned out to end before that."""
        self.blocks: dict[int, bytes] = {}
        self.burst: int | None = None
        """The sequence number of the burst that is in progress."""
        self.burst_s = 0.0
        """Time of its last block."""
        self.is_burst_empty = False
        """Whether it has brought nothing new."""
        self.place = 0
        """Offset at which it is read."""
        self.has_bursts = True
        """Whether a burst still brings anything: none does at the end of a file whose size is not known."""
        self.used_s = 0.0

    @property
    def limit(self) -> int:
        """Offset of its end, as far as it is known."""
        return self.size if self.end is None else self.end

    def keep(self, offset: int, data: bytes, least: int) -> bool:
        """Keeps a block; `least` is where the reading is. Returns whether it is new."""
        is_wanted = least - BLOCK_BYTES < offset < min(self.limit, least + MOST_BLOCKS * BLOCK_BYTES)
        if offset % BLOCK_BYTES or not is_wanted or not data or offset in self.blocks:
            return False
        self.blocks[offset] = data
        if len(data) < BLOCK_BYTES:
            self.end = min(self.limit, offset + len(data))
        return True

    def on_burst(self, packet: FtpPacket, now_s: float) -> bool:
        """Takes an answer of the burst that is in progress, also between two steps. Returns whether it has a new block.

        Raises:
            FtpNakError: The burst has ended otherwise than at the end of the file.

        """
        if self.burst is None or (packet.sequence - self.burst - 1) % SEQUENCES_COUNT >= BURST_SEQUENCES:
            return False
        is_new = False
        if packet.opcode == Opcode.NAK:
            self._end_burst(packet)
        elif packet.opcode == Opcode.ACK:
            self.burst_s = now_s
            is_new = self.keep(packet.offset, packet.data, self.place)
            self.is_burst_empty = self.is_burst_empty and not is_new
            if packet.is_burst_complete:
                self.burst = None
        return is_new

    def _end_burst(self, packet: FtpPacket) -> None:
        self.burst = None
        error = FtpNakError(self.path, packet)
        if error.code != Nak.END_OF_FILE:
            raise error
        if self.is_burst_empty:  # where it ends, reading block by block tells: ArduPilot's offset does not
            self.has_bursts = False

    def drop_before(self, offset: int) -> None:
        """Forgets the blocks that were read; the reading is there now."""
        self.place = offset
        for each in [each for each in self.blocks if each + BLOCK_BYTES <= offset]:
            del self.blocks[each]


class FtpStep(ABC, Generic[T]):
    """One step. It ends by itself with a `result` or an `error`, whatever comes or does not come."""

    def __init__(self) -> None:
        self.result: T | None = None
        self.error: UalError | None = None

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        return self.result is not None or self.error is not None

    @abstractmethod
    def tick(self, link: FtpLink, now_s: float) -> None:
        """Sends what is due; the first call begins."""

    @abstractmethod
    def on_packet(self, packet: FtpPacket, now_s: float) -> None:
        """Takes an answer, of this step or not."""


class FtpRequest(FtpStep[FtpPacket]):
    """One request and its answer. `what` is human-readable."""

    def __init__(self, what: str, opcode: Opcode, session: int = 0, offset: int = 0, data: bytes = b"") -> None:
        super().__init__()
        self._what = what
        self._opcode = opcode
        self._session, self._offset, self._data = session, offset, data
        self._sequence: int | None = None
        self._tries_count = 0
        self._next_s = -math.inf

    @property
    def is_opening(self) -> bool:
        """Whether it is the opening of a file, was sent, and has no answer."""
        return self._opcode == Opcode.OPEN_FILE_RO and self._tries_count > 0 and not self.is_over

    @override
    def tick(self, link: FtpLink, now_s: float) -> None:
        if now_s < self._next_s or self.is_over:
            return
        if self._tries_count >= TRIES_COUNT:
            self.error = UalTimeoutError(f"{self._what}: the autopilot has not answered in {TRIES_COUNT} tries")
            return
        if self._sequence is None:
            self._sequence = link.next_sequence()
        self._tries_count += 1
        self._next_s = now_s + RETRY_S
        link.request(self._sequence, self._opcode, self._session, self._offset, self._data, len(self._data))

    @override
    def on_packet(self, packet: FtpPacket, now_s: float) -> None:
        if self._sequence is None or packet.sequence != (self._sequence + 1) % SEQUENCES_COUNT or self.is_over:
            return
        if packet.requested != self._opcode:
            self._sequence = None  # an answer of before, which the server repeats for this number: take another one
        elif packet.opcode == Opcode.NAK:
            self.error = FtpNakError(self._what, packet)
        elif packet.opcode == Opcode.ACK:
            self.result = packet


class FtpReading(FtpStep[bytes]):
    """Reads `size` bytes of an open file from an offset, fewer where it ends before.

    Disarmed by bursts, which the autopilot sends on its own; what is missing after one is requested block by block.
    While it may be flying only block by block: a few at once, and then a pause as long as they took.
    """

    def __init__(self, file: OpenFile, offset: int, size: int) -> None:
        super().__init__()
        self._file = file
        self._offset = offset
        self._size = size
        self._requested: dict[int, tuple[int, float]] = {}
        """The blocks that are requested: sequence number, and when."""
        self._new_s = math.nan
        self._group_s: float | None = None
        """Time at which the present group of blocks began, while it may be flying."""
        self._next_s = -math.inf
        file.drop_before(offset)

    @override
    def tick(self, link: FtpLink, now_s: float) -> None:
        if self.is_over:
            return
        if math.isnan(self._new_s):
            self._new_s = now_s
        file = self._file
        file.used_s = now_s
        missing = self._missing()
        self._requested = {each: self._requested[each] for each in missing if each in self._requested}
        if not missing:
            self._take()
        elif now_s - self._new_s > PROGRESS_TIMEOUT_S:
            self.error = UalTimeoutError(f"{file.path}: nothing of it has come for {PROGRESS_TIMEOUT_S:g} s")
        elif file.burst is not None:
            self._watch_burst(link, now_s)
        elif link.is_gentle():
            self._request_gently(link, missing, now_s)
        elif file.has_bursts and _begins_run(missing) and not self._requested:
            self._begin_burst(link, missing[0], now_s)
        else:
            self._request(link, missing, now_s)

    @override
    def on_packet(self, packet: FtpPacket, now_s: float) -> None:
        if self.is_over:
            return
        file = self._file
        if packet.requested == Opcode.BURST_READ_FILE:
            self._on_burst(packet, now_s)
        elif packet.requested == Opcode.READ_FILE:
            self._on_block(packet, now_s)
        if not self.is_over and not math.isnan(self._new_s) and not self._missing():
            file.used_s = now_s
            self._take()

    def _keep(self, packet: FtpPacket) -> bool:
        return self._file.keep(packet.offset, packet.data, self._offset)

    def _missing(self) -> list[int]:
        """Returns the offsets of the blocks that have not come, in order."""
        end = min(self._offset + self._size, self._file.limit)
        first = self._offset - self._offset % BLOCK_BYTES
        return [each for each in range(first, end, BLOCK_BYTES) if each not in self._file.blocks]

    def _take(self) -> None:
        file, offset = self._file, self._offset
        end = max(offset, min(offset + self._size, file.limit))
        first = offset - offset % BLOCK_BYTES
        data = b"".join(file.blocks[each] for each in range(first, end, BLOCK_BYTES))
        self.result = data[offset - first : end - first]

    # --- Bursts -------------------------------------------------------------------------------------------------------

    def _begin_burst(self, link: FtpLink, offset: int, now_s: float) -> None:
        file = self._file
        file.burst, file.burst_s = link.next_sequence(BURST_SEQUENCES), now_s
        file.is_burst_empty = True
        link.request(file.burst, Opcode.BURST_READ_FILE, file.session, offset, b"", BLOCK_BYTES)

    def _watch_burst(self, link: FtpLink, now_s: float) -> None:
        file = self._file
        if now_s - file.burst_s > BURST_SILENCE_S:
            file.burst = None
        elif link.is_gentle():
            # It is armed: a burst from the end of the file replaces PX4's, and ends at once. ArduPilot ends its own.
            file.burst = None
            link.request(
                link.next_sequence(BURST_SEQUENCES), Opcode.BURST_READ_FILE, file.session, file.size, b"", BLOCK_BYTES
            )

    def _on_burst(self, packet: FtpPacket, now_s: float) -> None:
        try:
            if self._file.on_burst(packet, now_s):
                self._new_s = now_s
        except FtpNakError as error:
            self.error = error

    # --- Block by block -----------------------------------------------------------------------------------------------

    def _request_gently(self, link: FtpLink, missing: list[int], now_s: float) -> None:
        if self._group_s is None and now_s >= self._next_s:
            self._group_s = now_s
            self._request(link, missing, now_s)
        elif self._group_s is not None and self._requested:
            self._request(link, [each for each in missing if each in self._requested], now_s)
        elif self._group_s is not None:
            pause_s = max(
                now_s - self._group_s, WINDOW_BLOCKS * BLOCK_BYTES / GENTLE_DOWNLOAD_BYTES_S - (now_s - self._group_s)
            )
            self._group_s, self._next_s = None, now_s + pause_s

    def _request(self, link: FtpLink, missing: list[int], now_s: float) -> None:
        for offset in missing[:WINDOW_BLOCKS]:
            sequence, requested_s = self._requested.get(offset, (-1, -math.inf))
            if now_s - requested_s < RETRY_S:
                continue
            sequence = link.next_sequence() if sequence < 0 else sequence
            self._requested[offset] = (sequence, now_s)
            link.request(sequence, Opcode.READ_FILE, self._file.session, offset, b"", BLOCK_BYTES)

    def _on_block(self, packet: FtpPacket, now_s: float) -> None:
        offset = next(
            (at for at, (each, _) in self._requested.items() if packet.sequence == (each + 1) % SEQUENCES_COUNT), None
        )
        if offset is None:
            return
        if packet.opcode == Opcode.NAK:
            error = FtpNakError(self._file.path, packet)
            if error.code != Nak.END_OF_FILE:
                self.error = error
            else:
                self._file.end = min(self._file.limit, offset)
        elif packet.opcode == Opcode.ACK and packet.offset == offset and self._keep(packet):
            self._new_s = now_s


def _begins_run(missing: list[int]) -> bool:
    """Returns whether so many blocks in a row are missing that a burst is worth while."""
    return len(missing) >= BURST_BLOCKS and missing[BURST_BLOCKS - 1] - missing[0] == (BURST_BLOCKS - 1) * BLOCK_BYTES


class FtpPause(FtpStep[bool]):
    """Waits."""

    def __init__(self, duration_s: float) -> None:
        super().__init__()
        self._duration_s = duration_s
        self._end_s: float | None = None

    @override
    def tick(self, link: FtpLink, now_s: float) -> None:
        self._end_s = now_s + self._duration_s if self._end_s is None else self._end_s
        self.result = now_s >= self._end_s or None

    @override
    def on_packet(self, packet: FtpPacket, now_s: float) -> None:
        """Nothing is expected."""
