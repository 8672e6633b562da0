"""The files and the logs of a simulated autopilot: servers of MAVFTP and of LOG_REQUEST, as PX4's and ArduPilot's are.

Written after mavlink_ftp.cpp and mavlink_log_handler.cpp of PX4 1.17, and after GCS_FTP.cpp and
AP_Logger_MAVLinkLogTransfer.cpp of ArduPilot 4.6.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink.protocols.ftp_packet import BLOCK_BYTES, FtpPacket, Nak, Opcode, decode
from ual_daemon.backends.mavlink.wire.messages import Message

if TYPE_CHECKING:
    from tests.simulators.mission_store import Sender

LOG_BLOCK = 90


class FileStore:
    """The files, by path. `is_px4` says whose server it is.

    `step` has to be called often: it sends what streams. `is_armed` says whether it is armed.
    """

    def __init__(self, *, is_px4: bool, is_armed: Callable[[], bool] = lambda: False) -> None:
        self.files: dict[str, bytes] = {}
        self.made: dict[str, Callable[[], bytes]] = {}
        """Files that are made when they are opened, by path."""
        self.times_utc_s: dict[str, int] = {}
        self.has_ftp = True
        """Whether it answers to MAVFTP."""
        self.unlisted: set[str] = set()
        """Directories that it does not list, by path: each request fails."""
        self.undescribed: set[int] = set()
        """The numbers of logs of which it never sends a LOG_ENTRY."""
        self.requests: list[FtpPacket] = []
        """All requests of MAVFTP, in order."""
        self.log_requests: list[Message] = []
        self.per_step = 5
        """Blocks that stream at each step."""
        self.said: list[str] = []
        """Its messages, as STATUSTEXT."""
        self.sent_s = -math.inf
        """Time of its last answer."""
        self._is_px4 = is_px4
        self._is_armed = is_armed
        self._path: str | None = None
        self._size = 0
        self._session = 0
        self._used_s = -math.inf
        self._last: FtpPacket | None = None
        self._burst: tuple[FtpPacket, Sender] | None = None
        self._burst_at = 0
        self._burst_sent = 0
        self._burst_sequence = 0
        self._queue: deque[tuple[FtpPacket, Sender]] = deque()
        self._logs: list[str] = []
        self._are_listed = False
        self._sending: tuple[int, int, int, Sender] | None = None
        self._has_warned = False

    @property
    def directory(self) -> str:
        """Directory of its logs."""
        return "/fs/microsd/log" if self._is_px4 else "/APM/LOGS"

    @property
    def is_open(self) -> bool:
        """Whether a file is open."""
        return self._path is not None

    def handlers(self) -> dict[int, Callable[[Message, Sender, float], None]]:
        """Returns what takes the messages about files and logs, each with the time."""
        return {
            mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: self._on_ftp,
            mavlink.MAVLINK_MSG_ID_LOG_REQUEST_LIST: self._on_log_list,
            mavlink.MAVLINK_MSG_ID_LOG_REQUEST_DATA: self._on_log_data,
            mavlink.MAVLINK_MSG_ID_LOG_REQUEST_END: self._on_log_end,
        }

    def step(self, now_s: float) -> None:
        """Sends what streams."""
        idle_s = 10.0 if self._is_px4 else math.inf
        if self._path is not None and now_s - self._used_s > idle_s:
            self._path = self._burst = None
        if self._burst is not None or self._sending is not None:
            for _ in range(self.per_step):
                self._send_burst(now_s)
                self._send_log(now_s)
        if not self._is_px4 and self._burst is None:  # its worker does one thing after the other
            for _ in range(min(2, len(self._queue))):
                self._answer(*self._queue.popleft(), now_s)

    # --- MAVFTP -------------------------------------------------------------------------------------------------------

    def _on_ftp(self, message: Message, sender: Sender, now_s: float) -> None:
        packet = decode(bytes(message.payload))
        if packet is None or not self.has_ftp:
            return
        self.requests.append(packet)
        if self._is_px4:
            self._answer(packet, sender, now_s)
        elif len(self._queue) < 5:
            self._queue.append((packet, sender))

    def _answer(self, packet: FtpPacket, sender: Sender, now_s: float) -> None:
        if self._is_px4:
            self._used_s = now_s
        last = self._last
        is_again = last is not None and (packet.sequence + 1) % 65536 == last.sequence
        if last is not None and is_again and (self._is_px4 or packet.session == last.session):
            self._send(last, sender, now_s)
            return
        if not self._is_px4 and self._path is not None and packet.session != self._session:
            if packet.opcode == Opcode.TERMINATE_SESSION:
                self._reply(packet, sender, now_s)
                return
            if now_s - self._used_s < 3.0:
                self._refuse(packet, sender, Nak.INVALID_SESSION, now_s)
                return
            self._path = None
        acts: dict[int, Callable[[FtpPacket, Sender, float], None]] = {
            Opcode.NONE: self._reply,
            Opcode.TERMINATE_SESSION: self._terminate,
            Opcode.LIST_DIRECTORY: self._list,
            Opcode.OPEN_FILE_RO: self._open,
            Opcode.READ_FILE: self._read,
            Opcode.BURST_READ_FILE: self._begin_burst,
        }
        acts.get(packet.opcode, self._unknown)(packet, sender, now_s)

    def _unknown(self, packet: FtpPacket, sender: Sender, now_s: float) -> None:
        self._refuse(packet, sender, Nak.UNKNOWN_COMMAND if self._is_px4 else Nak.FAIL, now_s)

    def _terminate(self, packet: FtpPacket, sender: Sender, now_s: float) -> None:
        if self._is_px4 and self._path is None:
            self._refuse(packet, sender, Nak.INVALID_SESSION, now_s)
            return
        self._path = self._burst = None
        self._reply(packet, sender, now_s)

    def _list(self, packet: FtpPacket, sender: Sender, now_s: float) -> None:
        path = packet.data.decode().rstrip("/") + "/"
        inside = sorted({each[len(path) :].partition("/")[0] for each in self.files if each.startswith(path)})
        if not inside or path.rstrip("/") in self.unlisted:
            self._refuse(packet, sender, Nak.FAIL_ERRNO if inside else Nak.FILE_NOT_FOUND, now_s)
            return
        shown = [
            f"D{each}" if path + each not in self.files else f"F{each}\t{self._listed_size(path + each)}"
            for each in inside
        ]
        if self._is_px4:
            shown = ["S", "S", *shown]
        data = b""
        for each in shown[packet.offset :]:
            if len(data) + len(each) + 1 > BLOCK_BYTES:
                break
            data += each.encode() + b"\0"
        if data:
            self._reply(packet, sender, now_s, data)
        else:
            self._refuse(packet, sender, Nak.END_OF_FILE, now_s)

    def _listed_size(self, path: str) -> int:
        return 2**20 if path.startswith("@") else len(self.files[path])

    def _open(self, packet: FtpPacket, sender: Sender, now_s: float) -> None:
        path = packet.data.decode()
        if path in self.made:
            self.files[path] = self.made[path]()
        if self._path is not None:
            self._refuse(packet, sender, Nak.NO_SESSIONS_AVAILABLE if self._is_px4 else Nak.FAIL, now_s)
        elif path not in self.files:
            self._refuse(packet, sender, Nak.FILE_NOT_FOUND, now_s)
        else:
            self._path, self._size = path, self._listed_size(path)
            self._session = 0 if self._is_px4 else packet.session
            data = self._size.to_bytes(4, "little")
            self._reply(packet._replace(session=self._session), sender, now_s, data)

    def _read(self, packet: FtpPacket, sender: Sender, now_s: float) -> None:
        data = self._at(packet.offset)
        if self._path is None or (self._is_px4 and packet.session):
            self._refuse(packet, sender, Nak.INVALID_SESSION if self._is_px4 else Nak.FILE_NOT_FOUND, now_s)
        elif not data:
            self._refuse(packet, sender, Nak.END_OF_FILE, now_s)
        else:
            self._reply(packet, sender, now_s, data[: packet.size])

    def _at(self, offset: int) -> bytes:
        whole = self.files.get(self._path or "", b"")
        return whole[offset : min(offset + BLOCK_BYTES, self._size if self._is_px4 else len(whole))]

    def _begin_burst(self, packet: FtpPacket, sender: Sender, now_s: float) -> None:
        if self._path is None:
            self._refuse(packet, sender, Nak.INVALID_SESSION if self._is_px4 else Nak.FILE_NOT_FOUND, now_s)
            return
        self._burst, self._burst_at, self._burst_sent = (packet, sender), packet.offset, 0
        self._burst_sequence = packet.sequence + 1

    def _send_burst(self, now_s: float) -> None:
        if self._burst is None:
            return
        packet, sender = self._burst
        self._used_s = now_s
        data = self._at(self._burst_at)
        sequence = self._burst_sequence % 65536
        self._burst_sequence += 1
        if not data:
            self._burst = None
            at = (
                self._burst_at if self._is_px4 or self._burst_at % BLOCK_BYTES else max(0, self._burst_at - BLOCK_BYTES)
            )
            answer = FtpPacket(
                sequence, packet.session, Opcode.NAK, 1, Opcode.BURST_READ_FILE, False, at, bytes((Nak.END_OF_FILE,))
            )
        else:
            self._burst_sent += len(data)
            is_last = self._burst_sent > 35_000 if self._is_px4 else self._burst_sent >= 500 * BLOCK_BYTES
            answer = FtpPacket(
                sequence, packet.session, Opcode.ACK, len(data), Opcode.BURST_READ_FILE, is_last, self._burst_at, data
            )
            self._burst_at += len(data)
            if is_last:
                self._burst = None
        self._last = answer if not self._is_px4 else None
        self._send(answer, sender, now_s)

    def _reply(self, packet: FtpPacket, sender: Sender, now_s: float, data: bytes = b"") -> None:
        self._keep_and_send(
            FtpPacket(
                (packet.sequence + 1) % 65536, packet.session, Opcode.ACK, len(data), packet.opcode, False,
                packet.offset, data,
            ),
            sender,
            now_s,
        )  # fmt: skip

    def _refuse(self, packet: FtpPacket, sender: Sender, code: Nak, now_s: float) -> None:
        offset = packet.offset if self._is_px4 else 0
        data = bytes((code,))
        sequence = (packet.sequence + 1) % 65536
        answer = FtpPacket(sequence, packet.session, Opcode.NAK, 1, packet.opcode, False, offset, data)
        self._keep_and_send(answer, sender, now_s)

    def _keep_and_send(self, answer: FtpPacket, sender: Sender, now_s: float) -> None:
        is_kept = not self._is_px4 or (answer.size <= 4 and answer.data[:1] != bytes((Nak.NO_SESSIONS_AVAILABLE,)))
        self._last = answer if is_kept else None
        self._send(answer, sender, now_s)

    def _send(self, answer: FtpPacket, sender: Sender, now_s: float) -> None:
        self._used_s = self.sent_s = now_s
        target = (sender.system_id, sender.component_id)
        sender.channel.send(mavlink.MAVLink_file_transfer_protocol_message(0, *target, answer.encode()), now_s)

    # --- LOG_REQUEST --------------------------------------------------------------------------------------------------

    def _on_log_list(self, message: Message, sender: Sender, now_s: float) -> None:
        self.log_requests.append(message)
        if self._refuses_logs(sender, now_s):
            return
        self._logs = sorted(each for each in self.files if each.startswith(self.directory + "/"))
        self._are_listed = True
        first = 0 if self._is_px4 else 1
        last = first + len(self._logs) - 1
        if not self._logs and not self._is_px4:
            sender.channel.send(mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0), now_s)
        for log_id in range(max(first, message.start), min(message.end, last) + 1):
            if log_id in self.undescribed:
                continue
            path = self._logs[log_id - first]
            time_s = self.times_utc_s.get(path, 0)
            entry = mavlink.MAVLink_log_entry_message(log_id, len(self._logs), last, time_s, len(self.files[path]))
            sender.channel.send(entry, now_s)

    def _on_log_data(self, message: Message, sender: Sender, now_s: float) -> None:
        self.log_requests.append(message)
        if self._refuses_logs(sender, now_s) or (self._is_px4 and not self._are_listed):
            return
        if not self._is_px4 and self._sending is not None:
            return
        place = message.id if self._is_px4 else message.id - 1
        if 0 <= place < len(self._logs):
            size = len(self.files[self._logs[place]])
            self._sending = (message.id, message.ofs, min(size, message.ofs + message.count), sender)

    def _on_log_end(self, message: Message, sender: Sender, now_s: float) -> None:
        del sender, now_s
        self.log_requests.append(message)
        self._sending = None

    def _refuses_logs(self, sender: Sender, now_s: float) -> bool:
        if self._is_px4 or not self._is_armed():
            self._has_warned = False
            return False
        if not self._has_warned:
            self._has_warned = True
            text = mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_ERROR, b"Disarm for log download")
            sender.channel.send(text, now_s)
        return True

    def _send_log(self, now_s: float) -> None:
        if self._sending is None:
            return
        log_id, at, end, sender = self._sending
        if at >= end:
            self._sending = None
            return
        data = self.files[self._logs[log_id if self._is_px4 else log_id - 1]][at : min(end, at + LOG_BLOCK)]
        padded = list(data.ljust(LOG_BLOCK, b"\0"))
        sender.channel.send(mavlink.MAVLink_log_data_message(log_id, at, len(data), padded), now_s)
        self._sending = (log_id, at + len(data), end, sender)
