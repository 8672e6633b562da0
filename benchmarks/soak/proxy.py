"""A connection that can be killed: a proxy in front of a daemon, which ends its connections without a good-bye."""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import threading
from types import TracebackType

from typing_extensions import Self

_RESET = struct.pack("ii", 1, 0)
"""For SO_LINGER: closing sends RST."""
_PERIOD_S = 0.1


class Proxy:
    """Passes one connection on to `address`, until the block ends: then both ends are reset."""

    def __init__(self, address: str) -> None:
        host, port = address.rsplit(":", 1)
        self._target = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._is_ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._is_ended = True
        self._thread.join()
        self._listener.close()

    def _run(self) -> None:
        self._listener.settimeout(5.0)
        with contextlib.suppress(OSError):
            client, _ = self._listener.accept()
            server = socket.create_connection(self._target, 5.0)
            ends = {client: server, server: client}
            with contextlib.suppress(OSError):
                while not self._is_ended and self._pass_on(ends):
                    pass
            for end in ends:
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
                end.close()

    @staticmethod
    def _pass_on(ends: dict[socket.socket, socket.socket]) -> bool:
        for end in select.select(list(ends), [], [], _PERIOD_S)[0]:
            data = end.recv(65536)
            if not data:
                return False
            ends[end].sendall(data)
        return True
