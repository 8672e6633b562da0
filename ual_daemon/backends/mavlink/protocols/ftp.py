"""The files of the autopilot, by MAVFTP: https://mavlink.io/en/services/ftp.html. They are only read.

Compared with the servers of PX4 (mavlink_ftp.cpp) and ArduPilot (GCS_FTP.cpp). Each has one open file for each link.
PX4 closes it after 10 s in which nothing is asked, ArduPilot after 3 s.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, NamedTuple, TypeVar

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError, ResourceExhaustedError, UalError, UalTimeoutError
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.mavlink.protocols.ftp_packet import BLOCK_BYTES, FtpNakError, FtpPacket, Nak, Opcode, decode
from ual_daemon.backends.mavlink.protocols.ftp_steps import FtpLink, FtpPause, FtpReading, FtpRequest, FtpStep, OpenFile
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

T = TypeVar("T")
Steps = Generator[FtpStep[Any], Any, T]
"""An exchange about files, step by step; each `yield` returns the result of the step, or raises its error."""

SLOWED_READ_S = 2.0
"""Seconds before a file is read in flight for which faster streams are requested, where files slow them, ..."""
SLOWED_REQUEST_PERIOD_S = 5.0
"""... and again as often, as a request may be lost."""
SLOWED_RATES_S = 1.5
"""Seconds after the last answer for which the streams may be slow."""
USUAL_RATE_REQUESTS_COUNT = 3
"""Requests for the usual rates after that."""
IDLE_FILE_S = 2.0
"""Seconds after which a file that is not read any more is closed."""
BUSY_S = (0.5, 3.5, 11.0)
"""Seconds after which a request is repeated that was refused because another file is open. Each request delays the
moment at which the autopilot closes one that was left open: ArduPilot after 3 s without any, PX4 after 10 s.
"""
REOPENED_COUNT = 3
"""Times that a file may be closed by the autopilot while it is read."""
MOST_ENTRIES = 20_000
MOST_WAITING_READS = 100
CHUNK_BYTES = 32_768
"""Bytes of a file that are read in one step where all of it is wanted."""
_SESSION_ID = 191
"""The session that is requested. ArduPilot takes the client's, so that another program's is another one."""
_BUSY = {Nak.FAIL, Nak.NO_SESSIONS_AVAILABLE, Nak.INVALID_SESSION}
_CLOSED = {Nak.INVALID_SESSION, Nak.FILE_NOT_FOUND}


class DirectoryEntry(NamedTuple):
    """Entry of a directory. `size` is None for a directory."""

    name: str
    size: int | None


class _Dialogue(Exchange[T]):
    """An exchange about files."""

    def __init__(
        self, future: Future[T], link: FtpLink, steps: Steps[T], explain: Callable[[UalError], UalError]
    ) -> None:
        super().__init__(future)
        self._link = link
        self._steps = steps
        self._explain = explain
        self._step: FtpStep[Any] | None = None

    @override
    def tick(self, now_s: float) -> None:
        if self._step is None:
            self._go_on(lambda: next(self._steps))
        while self._step is not None and not self.is_over:
            step = self._step
            step.tick(self._link, now_s)
            if not step.is_over:
                return
            self._after(step)
        self._steps.close()

    @property
    def is_opening(self) -> bool:
        """Whether a file was asked to be opened, and no answer has come."""
        return isinstance(self._step, FtpRequest) and self._step.is_opening

    def on_packet(self, packet: FtpPacket, now_s: float) -> None:
        """Takes an answer."""
        if self._step is not None:
            self._step.on_packet(packet, now_s)

    def _after(self, step: FtpStep[Any]) -> None:
        if step.error is None:
            self._go_on(lambda: self._steps.send(step.result))
        else:
            error = step.error
            self._go_on(lambda: self._steps.throw(error))

    def _go_on(self, resume: Callable[[], FtpStep[Any]]) -> None:
        try:
            self._step = resume()
        except StopIteration as ended:
            self._step = None
            self._end(ended.value)
        except UalError as error:
            self._step = None
            self.fail(self._explain(error))
        except Exception as error:  # noqa: BLE001  a defect of one exchange must not end what flies
            self._step = None
            futures.fail(self.future, error)


class _StreamRates:
    """Keeps the autopilot's streams as fast as they are while it sends files in flight: what flies it needs them."""

    def __init__(self, speed_up: Callable[[float], object]) -> None:
        self.factor = 1.0
        """Factor of the streams' requested rates; 1: files do not slow them."""
        self._speed_up = speed_up
        self._began_s: float | None = None
        self._slowed_s = 0.0
        self._is_fast = False
        self._next_s = 0.0
        self._usual_count = 0

    def are_ready(self, is_slowed: bool, now_s: float) -> bool:
        """Asks for the rates that are due, while files slow the streams or not. Returns whether files may be read."""
        if self.factor <= 1.0:
            return True
        if is_slowed:
            self._slowed_s, self._usual_count = now_s, USUAL_RATE_REQUESTS_COUNT
            self._began_s = now_s if self._began_s is None else self._began_s
        elif now_s - self._slowed_s > SLOWED_RATES_S:
            self._began_s = None
        is_fast = self._began_s is not None
        if is_fast is not self._is_fast:
            self._is_fast, self._next_s = is_fast, now_s
        if now_s >= self._next_s and (is_fast or self._usual_count):
            self._next_s = now_s + SLOWED_REQUEST_PERIOD_S
            self._usual_count -= not is_fast
            self._speed_up(self.factor if is_fast else 1.0)
        return not is_slowed or self._began_s is None or now_s - self._began_s >= SLOWED_READ_S


class Ftp(Protocol):
    """Belongs to the thread that receives. One exchange at a time, in the order in which they were requested.

    Args:
        send: Sends a message.
        is_up: Says whether the link is up at a time.
        is_gentle: Says whether it may be flying.
        speed_up: Asks for all streams so many times as often as usual.

    """

    def __init__(
        self,
        send: Callable[[Message], object],
        is_up: Callable[[float], bool],
        is_gentle: Callable[[], bool],
        speed_up: Callable[[float], object] = lambda _: None,
    ) -> None:
        self.is_waiting = False
        self._send = send
        self._is_up = is_up
        self._is_gentle = is_gentle
        self._streams = _StreamRates(speed_up)
        self._link: FtpLink | None = None
        self._session = 0
        """The session of a file whose opening was not answered."""
        self._file: OpenFile | None = None
        self._waiting: deque[_Dialogue[Any]] = deque()
        self._running: _Dialogue[Any] | None = None
        self._now_s = 0.0

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: self.on_message}

    @property
    @override
    def is_urgent(self) -> bool:
        return self._running is not None

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        self.drop("another autopilot was found")
        self._streams.factor = dialect.rates_beside_files
        self._session = _SESSION_ID if dialect.takes_ftp_session else 0
        self._link = FtpLink(
            lambda payload: self._send(mavlink.MAVLink_file_transfer_protocol_message(0, *target, payload)),
            self._is_gentle,
        )

    @override
    def release(self) -> None:
        if self._running is not None:
            self._keep_opened(self._running)
        file, self._file = self._file, None
        if file is not None and self._link is not None:
            self._link.request(self._link.next_sequence(), Opcode.TERMINATE_SESSION, file.session, 0, b"", 0)

    @override
    def drop(self, why: str) -> None:
        error = LinkLostError(f"its files were not read: {why}")
        for exchange in (*self._waiting, *([] if self._running is None else [self._running])):
            exchange.fail(error)
        self._waiting.clear()
        self._running = self._file = None

    @override
    def tick(self, now_s: float) -> None:
        self._now_s = now_s
        while self._running is None or self._running.is_over:
            if self._running is not None:
                self._keep_opened(self._running)
            if not self._waiting:
                self._running = None
                break
            self._running = self._waiting.popleft()
        is_slowed = self._running is not None and self._is_gentle()
        if not self._streams.are_ready(is_slowed, now_s):
            return
        if self._running is not None:
            self._running.tick(now_s)
        elif self._file is not None and now_s - self._file.used_s > IDLE_FILE_S:
            self.run(Future(), self.closed())

    def _keep_opened(self, left: _Dialogue[Any]) -> None:
        """Takes the file that an exchange which is left may have opened, so that it is closed."""
        if left.is_opening:
            self._file = OpenFile("", self._session, 0)
            self._file.used_s = self._now_s

    def on_message(self, message: Message, now_s: float) -> None:
        """Takes a FILE_TRANSFER_PROTOCOL."""
        packet = decode(bytes(message.payload))
        if packet is None:
            return
        if self._running is not None:
            self._running.on_packet(packet, now_s)
            self.tick(now_s)
        elif self._file is not None and packet.requested == Opcode.BURST_READ_FILE:
            with suppress(FtpNakError):  # the next part of the file will be reported
                self._file.on_burst(packet, now_s)  # a burst goes on between two parts

    def run(self, future: Future[T], steps: Steps[T]) -> None:
        """Has an exchange done once it is its turn."""
        if self._link is None:
            futures.fail(future, LinkLostError("no autopilot was found"))
        elif len(self._waiting) >= MOST_WAITING_READS:
            text = f"{MOST_WAITING_READS} reads of files wait already, which is the limit"
            futures.fail(future, ResourceExhaustedError(text, {"limit": str(MOST_WAITING_READS)}))
        else:
            self._waiting.append(_Dialogue(future, self._link, steps, self._explain))
            self.is_waiting = True

    # --- What an exchange may have of steps ---------------------------------------------------------------------------

    def list_directory(self, path: str) -> Steps[list[DirectoryEntry]]:
        """Lists what is in a directory. Ends with an `FtpNakError` where there is none."""
        found: list[DirectoryEntry] = []
        number = 0
        while True:
            try:
                packet = yield from _exchange(path, Opcode.LIST_DIRECTORY, number, path.encode())
            except FtpNakError as error:
                if error.code == Nak.END_OF_FILE:
                    return found
                raise
            names = [each for each in packet.data.split(b"\0") if each]
            number += len(names)
            if not names or number > MOST_ENTRIES:
                raise NotSupportedError(f"{path}: it has no end, or over {MOST_ENTRIES} entries")
            found += [entry for each in names if (entry := _entry(each)) is not None]

    def read(self, path: str, offset: int, size: int) -> Steps[bytes]:
        """Reads a part of a file, less where it ends before. The file stays open for the next part."""
        for count in range(REOPENED_COUNT):
            file = yield from self._opened(path)
            try:
                data: bytes = yield FtpReading(file, offset, size)
            except FtpNakError as error:
                self._file = None
                if error.code not in _CLOSED or count == REOPENED_COUNT - 1:
                    raise
            else:
                return data
        raise AssertionError  # the last try returns or raises

    def read_all(self, path: str, most: int) -> Steps[bytes]:
        """Reads a whole file. Ends with a `ResourceExhaustedError` where it has more than so many bytes."""
        parts: list[bytes] = []
        offset = 0
        while offset <= most:
            part = yield from self.read(path, offset, CHUNK_BYTES)
            parts.append(part)
            offset += len(part)
            if len(part) < CHUNK_BYTES:
                yield from self.closed()
                return b"".join(parts)
        raise ResourceExhaustedError(f"{path} has over {most} bytes", {"limit": str(most)})

    def closed(self) -> Steps[None]:
        """Closes the file that is open. Whatever the answer is: it may be closed already."""
        file, self._file = self._file, None
        if file is not None:
            try:
                yield FtpRequest(file.path, Opcode.TERMINATE_SESSION, file.session)
            except FtpNakError:
                return

    def _opened(self, path: str) -> Steps[OpenFile]:
        file = self._file
        if file is not None and file.path == path:
            return file
        yield from self.closed()
        packet = yield from _exchange(path, Opcode.OPEN_FILE_RO, 0, path.encode(), _SESSION_ID)
        size = int.from_bytes(packet.data[:4], "little")
        self._file = file = OpenFile(path, packet.session, size)
        file.used_s = self._now_s
        return file

    def _explain(self, error: UalError) -> UalError:
        if isinstance(error, UalTimeoutError) and not self._is_up(self._now_s):
            return LinkLostError(f"{error.message}; nothing comes from the autopilot", error.metadata)
        return error


def _exchange(path: str, opcode: Opcode, offset: int, data: bytes, session: int = 0) -> Steps[FtpPacket]:
    """Asks until no other file is open, for as long as one that was left open may be."""
    if len(data) > BLOCK_BYTES:
        raise NotSupportedError(f"{path:.100}...: a path of {len(data)} bytes, and MAVFTP has at most {BLOCK_BYTES}")
    for pause_s in (*BUSY_S, None):
        try:
            answer: FtpPacket = yield FtpRequest(path, opcode, session, offset, data)
        except FtpNakError as error:
            if error.code not in _BUSY or pause_s is None:
                raise
            yield FtpPause(pause_s)
        else:
            return answer
    raise AssertionError  # the last try returns or raises


def _entry(text: bytes) -> DirectoryEntry | None:
    """Reads an entry of a directory; None for one that is skipped, or has a name that no file should have."""
    kind, (name, _, size) = text[:1], text[1:].partition(b"\t")
    if not name.isascii() or not name.decode().isprintable() or b"/" in name or name in {b".", b"..", b""}:
        return None
    if kind == b"D":
        return DirectoryEntry(name.decode(), None)
    return (
        DirectoryEntry(name.decode(), int(size))
        if kind == b"F" and size.isdigit() and len(size) <= _LONGEST_SIZE_DIGITS
        else None
    )


_LONGEST_SIZE_DIGITS = 12
