"""The socket of the page's server, for asyncio. Without file descriptors it says so once, and costs nothing."""

from __future__ import annotations

import asyncio
import errno
import socket
from collections.abc import Callable, Mapping
from typing import Any

from typing_extensions import override

_NOTHING_LEFT = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
"""asyncio tries again a second after these. Python before 3.14 then tries a hundred times at once, ever more often."""


class PageSocket(socket.socket):
    """Listens on an address.

    Args:
        host: An address of this computer.
        port: 0: any.
        say: Takes why nobody can connect, human-readable.

    Raises:
        OSError: It cannot be had.

    """

    def __init__(self, host: str, port: int, say: Callable[[str], None]) -> None:
        super().__init__(socket.AF_INET6 if ":" in host else socket.AF_INET)
        self._say = say
        self._has_failed = False
        self._is_logged = False
        try:
            self.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self.bind((host, port))
        except OSError:
            self.close()
            raise

    @override
    def accept(self) -> tuple[socket.socket, Any]:
        if self._has_failed:  # asyncio's next try of the same moment
            self._has_failed = False
            raise BlockingIOError
        try:
            accepted = super().accept()
        except OSError as error:
            if error.errno in _NOTHING_LEFT:
                self._note_failure(error)
            raise
        self._is_logged = False
        return accepted

    def _note_failure(self, error: OSError) -> None:
        self._has_failed = True
        if not self._is_logged:
            self._is_logged = True
            self._say(f"browsers cannot connect ({error.strerror}): it is tried again each second")

    def note(self, loop: asyncio.AbstractEventLoop, context: Mapping[str, Any]) -> None:
        """Takes what an event loop reports: what is said already is not said by asyncio, too."""
        error = context.get("exception")
        if not (isinstance(error, OSError) and error.errno in _NOTHING_LEFT and "socket" in context):
            loop.default_exception_handler(dict(context))
