"""Serial lines: a radio, a USB cable, a UART of the companion computer."""

from __future__ import annotations

import errno
import os
import select
import termios
from collections.abc import Mapping
from typing import TYPE_CHECKING

from typing_extensions import override

from ual_daemon.backends.mavlink.links.base import (
    READ_BATCH_BYTES,
    Address,
    Chunk,
    LinkError,
    MavlinkLink,
    StreamWriter,
)
from ual_daemon.backends.mavlink.links.endpoints import KEY, SerialEndpoint
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from serial import Serial

_HINTS = {
    errno.EACCES: "permission denied (may this user open it? Usually the group dialout may)",
    errno.ENOENT: "there is no such device (is it plugged in?)",
    errno.EAGAIN: "another program uses it",
    errno.EBUSY: "another program uses it",
}


class SerialLink(MavlinkLink):
    """A serial line. pyserial sets it up and locks it; its data are read and written as those of any descriptor."""

    def __init__(self, endpoint: SerialEndpoint) -> None:
        try:
            import serial  # noqa: F401 - only to see whether it is installed
        except ImportError:
            raise ConfigError("a serial line needs an extra: pip install 'ual-daemon[serial]'", KEY) from None
        self._endpoint = endpoint
        self._line: Serial | None = None
        self._writer = StreamWriter(os.write)

    @override
    def open(self) -> None:
        import serial

        try:
            line = serial.Serial(self._endpoint.device, self._endpoint.baud, timeout=0, write_timeout=0, exclusive=True)
        # pyserial's own error is an OSError; ValueError: an impossible rate; termios.error: unplugged just now.
        except (OSError, ValueError, termios.error) as error:
            raise LinkError(f"cannot open {self._endpoint}: {_why(error)}; trying again") from None
        self._line = line
        self.connections_count += 1
        self._writer.attach(line.fileno())

    @override
    def close(self) -> None:
        self._writer.attach(None)
        line, self._line = self._line, None
        if line is not None:
            line.close()

    @override
    def descriptors(self) -> Mapping[int, int]:
        return {} if self._line is None else {self._line.fileno(): select.POLLIN}

    @property
    @override
    def peer(self) -> Address | None:
        return None if self._line is None else (self._endpoint.device, self._endpoint.baud)

    @override
    def receive(self, now_s: float) -> list[Chunk]:
        if self._line is None:
            return []
        try:
            data = os.read(self._line.fileno(), READ_BATCH_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:  # an error, or readable without data: this shows that the device is gone
            raise LinkError(f"{self._endpoint} is gone (unplugged?); opening it anew")
        return [(data, self.peer)]

    @property
    @override
    def has_room(self) -> bool:
        return self._writer.has_room

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        return self._writer.write(data, is_perishable=is_perishable)


def _why(error: Exception) -> str:
    code = error.args[0] if error.args else None
    return _HINTS.get(code, os.strerror(code)) if isinstance(code, int) else str(error)
