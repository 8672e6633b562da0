"""Content of a FILE_TRANSFER_PROTOCOL message: https://mavlink.io/en/services/ftp.html."""

from __future__ import annotations

import errno
import os
import struct
from enum import IntEnum
from typing import NamedTuple

from ual.errors import RejectedByAutopilotError

BLOCK_BYTES = 239
"""Most data of a message. All reads are of so many bytes: ArduPilot's @PARAM refuses others."""
SEQUENCES_COUNT = 2**16
_HEADER = struct.Struct("<HBBBBBxI")
_PAYLOAD = _HEADER.size + BLOCK_BYTES


class Opcode(IntEnum):
    """Opcodes of the requests, and the two answers. UAL has none that writes, removes or renames."""

    NONE = 0
    TERMINATE_SESSION = 1
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    BURST_READ_FILE = 15
    ACK = 128
    NAK = 129


class Nak(IntEnum):
    """Why a request is refused."""

    FAIL = 1
    FAIL_ERRNO = 2
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_EXISTS = 8
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


_WORDS = {
    Nak.FAIL: "it failed, without a reason",
    Nak.FAIL_ERRNO: "it failed",
    Nak.INVALID_DATA_SIZE: "the size of the request is wrong",
    Nak.INVALID_SESSION: "the file is not open any more",
    Nak.NO_SESSIONS_AVAILABLE: "another program reads its files",
    Nak.END_OF_FILE: "the file ends before",
    Nak.UNKNOWN_COMMAND: "it does not know this request",
    Nak.FILE_EXISTS: "the file is there already",
    Nak.FILE_PROTECTED: "the file is protected",
    Nak.FILE_NOT_FOUND: "there is no such file",
}


class FtpPacket(NamedTuple):
    """One request or answer."""

    sequence: int
    session: int
    opcode: int
    size: int
    requested: int = 0
    """The opcode that is answered."""
    is_burst_complete: bool = False
    offset: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """Returns the message's payload."""
        header = _HEADER.pack(
            self.sequence, self.session, self.opcode, self.size, self.requested, self.is_burst_complete, self.offset
        )
        return (header + self.data).ljust(_PAYLOAD, b"\0")


def decode(payload: bytes) -> FtpPacket | None:
    """Reads a message's payload; None where its size cannot be."""
    sequence, session, opcode, size, requested, is_complete, offset = _HEADER.unpack_from(payload)
    data = payload[_HEADER.size : _HEADER.size + size]
    if size > BLOCK_BYTES:
        return None
    return FtpPacket(sequence, session, opcode, size, requested, bool(is_complete), offset, data)


class FtpNakError(RejectedByAutopilotError):
    """The autopilot refuses a request."""

    def __init__(self, what: str, packet: FtpPacket) -> None:
        self.code = packet.data[0] if packet.data else 0
        super().__init__(f"{what}: the autopilot answers: {_words(self.code, packet.data)}", {"result": str(self.code)})


def _words(code: int, data: bytes) -> str:
    if code not in _WORDS:
        return f"error {code}"
    if code == Nak.FAIL_ERRNO and len(data) > 1:
        name = errno.errorcode.get(data[1], str(data[1]))
        return f"{_WORDS[Nak.FAIL_ERRNO]}: {os.strerror(data[1])} ({name})"
    return _WORDS[Nak(code)]
