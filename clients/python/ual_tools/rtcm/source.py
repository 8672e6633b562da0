"""Sources of corrections: a serial port or a TCP port. An NTRIP caster is in `ntrip`."""

from __future__ import annotations

import socket
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator

from typing_extensions import override

from ual.errors import InvalidArgumentError
from ual.shared import extras

EXTRA = "ual-tools[rtk]"
READ_TIMEOUT_S = 0.5
"""The longest time in which nothing is yielded."""
SOURCE_SILENCE_S = 30.0
"""Seconds of silence after which a source is opened again. Base stations send each second."""
CONNECT_S = 10.0
_READ_BYTES = 2048
_SERIAL_BAUD = 115_200


class SourceError(Exception):
    """A source broke, or cannot be opened now; it may be tried again. The message is human-readable."""


class CorrectionsSource(ABC):
    """Source of bytes. `name` is human-readable."""

    name: str

    @abstractmethod
    def chunks(self) -> Generator[bytes, None, None]:
        """Opens it, and yields what comes; ``b""`` while nothing comes. Ends where the other end has closed it.

        Raises:
            SourceError: It broke, or cannot be opened.

        """


class TcpSource(CorrectionsSource):
    """A TCP port that sends as soon as it is connected to, such as that of a base station."""

    def __init__(self, host: str, port: int) -> None:
        self.name = f"{host}:{port}"
        self._address = (host, port)

    @override
    def chunks(self) -> Generator[bytes, None, None]:
        try:
            with socket.create_connection(self._address, CONNECT_S) as connection:
                connection.settimeout(READ_TIMEOUT_S)
                yield from _received(connection)
        except OSError as error:
            raise SourceError(error.strerror or str(error)) from None


def _received(connection: socket.socket) -> Iterator[bytes]:
    while True:
        try:
            data = connection.recv(_READ_BYTES)
        except TimeoutError:
            yield b""
            continue
        if not data:
            return
        yield data


class SerialSource(CorrectionsSource):
    """A serial port, such as that of a receiver which is a base station."""

    def __init__(self, port: str, baud: int) -> None:
        with extras.needs("ual rtcm --serial", EXTRA):
            import serial  # noqa: F401 - only to see whether it is installed
        self.name = f"{port}:{baud}"
        self._port, self._baud = port, baud

    @override
    def chunks(self) -> Generator[bytes, None, None]:
        import serial

        try:
            with serial.Serial(self._port, self._baud, timeout=READ_TIMEOUT_S, exclusive=True) as line:
                while True:
                    yield line.read(1) + line.read(line.in_waiting)
        except (OSError, ValueError) as error:  # pyserial's own error is an OSError; ValueError: an impossible rate
            raise SourceError(getattr(error, "strerror", None) or str(error)) from None


def serial_source(text: str) -> SerialSource:
    """Returns the source of ``PORT`` or ``PORT:BAUD``."""
    port, separator, baud = text.rpartition(":")
    if not separator:
        return SerialSource(text, _SERIAL_BAUD)
    if not port or not baud.isdecimal() or not int(baud):
        raise InvalidArgumentError(
            f"serial: {text} is not PORT or PORT:BAUD, as /dev/ttyACM0:115200", {"field": "serial"}
        )
    return SerialSource(port, int(baud))


def tcp_source(text: str) -> TcpSource:
    """Returns the source of ``HOST:PORT``."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) < 1 << 16:
        raise InvalidArgumentError(f"tcp: {text} is not HOST:PORT, as 192.168.1.20:2102", {"field": "tcp"})
    return TcpSource(host.strip("[]"), int(port))
