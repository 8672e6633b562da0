"""A client of the simulator's RPC, which is MessagePack-RPC over TCP (rpclib)."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Hashable
from functools import lru_cache
from itertools import count
from typing import Any, Protocol, TypeVar, cast

import msgspec

from ual_daemon.backends import tcp
from ual_daemon.backends.airsim.framing import least_end
from ual_daemon.backends.airsim.settings import AirsimAddress

T = TypeVar("T")

_REQUEST_TYPE = 0
_CONNECT_S, _SEND_S = 0.5, 0.5
_LONGEST_MESSAGE_BYTES = 1 << 24
_encode = msgspec.msgpack.Encoder().encode


class _Answer(msgspec.Struct, array_like=True):
    kind: int
    number: int
    error: Any
    result: msgspec.Raw


_decode_answer = msgspec.msgpack.Decoder(_Answer).decode


@lru_cache(maxsize=32)
def _decoder(kind: Hashable) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(cast("type[Any]", kind))


class RpcCaller(Protocol):
    """Caller of the simulator's methods; see `RpcConnection`."""

    def call(self, kind: type[T], timeout_s: float, method: str, *arguments: object) -> T:
        """Calls a method, and returns its result."""
        ...

    def post(self, method: str, *arguments: object) -> None:
        """Sends a request whose answer is not waited for."""
        ...


class RemoteError(Exception):
    """The simulator refused a call; the message has its words."""


class RpcConnection:
    """One connection, for one thread. Requests may overlap; an answer is reported by the number of its request."""

    def __init__(self, address: AirsimAddress, longest_bytes: int = _LONGEST_MESSAGE_BYTES) -> None:
        """Connects. An answer that is longer than `longest_bytes` ends the connection.

        Raises:
            OSError: Nothing listens there.
        """
        self._numbers = count(1)
        self._longest_bytes = longest_bytes
        self._received = bytearray()
        self._least_count = 0
        """Bytes that must have been received before there can be another message."""
        self._answers: dict[int, _Answer] = {}
        self._unwanted: set[int] = set()
        self._socket = socket.create_connection(address, timeout=_CONNECT_S)
        tcp.prepare(self._socket)

    @property
    def unwanted_count(self) -> int:
        """Requests of `post` that have no answer yet."""
        return len(self._unwanted)

    def call(self, kind: type[T], timeout_s: float, method: str, *arguments: object) -> T:
        """Calls a method, and returns its result.

        Raises:
            RemoteError: The simulator refused.
            TimeoutError: No answer came in time.
            OSError: The connection is lost.
        """
        return self.answer(kind, self.request(method, *arguments), timeout_s)

    def request(self, method: str, *arguments: object) -> int:
        """Sends a request, and returns its number, for `answer`."""
        number = next(self._numbers)
        self._socket.settimeout(_SEND_S)
        self._socket.sendall(_encode((_REQUEST_TYPE, number, method, arguments)))
        return number

    def post(self, method: str, *arguments: object) -> None:
        """Sends a request whose answer is not waited for."""
        self._unwanted.add(self.request(method, *arguments))

    def has_answer(self, number: int, timeout_s: float) -> bool:
        """Waits for the answer of a request, and returns whether it came in time."""
        deadline_s = time.monotonic() + timeout_s
        while number not in self._answers:
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0:
                return False
            self._receive(left_s)
        return True

    def answer(self, kind: type[T], number: int, timeout_s: float) -> T:
        """Waits for the answer of a request. Raises as `call`."""
        if not self.has_answer(number, timeout_s):
            raise TimeoutError(f"the simulator has not answered for {timeout_s:g} s")
        found = self._answers.pop(number)
        if found.error is not None:
            raise RemoteError(_text(found.error))
        result: T = _decoder(cast("Hashable", kind)).decode(found.result)
        return result

    def give_up(self, number: int) -> None:
        """Waits for the answer of a request no more. It is among the unwanted ones until it comes."""
        if self._answers.pop(number, None) is None:
            self._unwanted.add(number)

    def drain(self) -> None:
        """Reads what has arrived, without waiting."""
        while self._receive(0.0):
            pass

    def close(self) -> None:
        """Closes the connection. Any thread may call: one that waits for an answer gets an OSError."""
        with contextlib.suppress(OSError):  # the other side was faster
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def abort(self) -> None:
        """As `close`; what has not reached the simulator's computer never does."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RD)  # wakes the thread that waits
        tcp.discard(self._socket)

    def _receive(self, timeout_s: float) -> bool:
        """Waits for data, and returns whether some came."""
        self._socket.settimeout(timeout_s)
        try:
            data = self._socket.recv(1 << 16)
        except (TimeoutError, BlockingIOError):
            return False
        if not data:
            raise ConnectionResetError("the simulator closed the connection")
        self._received += data
        self._on_messages()
        return True

    def _on_messages(self) -> None:
        begin, length = 0, len(self._received)
        if length < self._least_count:
            return
        while (end := least_end(self._received, begin)) <= length:
            answer = _decode_answer(bytes(self._received[begin:end]))
            begin = end
            if answer.number in self._unwanted:
                self._unwanted.remove(answer.number)
            else:
                self._answers[answer.number] = answer
        del self._received[:begin]
        self._least_count = end - begin
        if self._least_count > self._longest_bytes:
            raise ConnectionResetError("the simulator sends a message without end")


def _text(error: object) -> str:
    """Returns the simulator's message, without rpclib's introduction."""
    text = str(error)
    return text.rpartition("exception contained this information: ")[2].strip().rstrip(".")
