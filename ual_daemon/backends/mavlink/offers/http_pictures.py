"""Fetches the pictures that a camera offers by HTTP, on a thread of its own."""

from __future__ import annotations

import socket
import threading
import time
from concurrent.futures import Future
from contextlib import closing, suppress
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import SplitResult, urlsplit, urlunsplit

from ual.cameras import ImageFormat
from ual.errors import LinkLostError, NotSupportedError, UalError, UalTimeoutError
from ual_daemon.backends import futures
from ual_daemon.backends.engine.picture_worker import PictureWorker

if TYPE_CHECKING:
    from http.client import HTTPConnection, HTTPResponse

LARGEST_PICTURE_BYTES = 64 << 20
TIMEOUT_S = 15.0
"""Seconds that a picture may take in all, since it was ordered: no caller waits longer (`ORDER_S`). ..."""
SERVER_SILENCE_S = 5.0
"""... and seconds for which its server may be silent."""
_CHUNK_BYTES = 1 << 16
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
_MOST_MARKERS = 1000
"""Most markers that are examined: 64 MiB of them would keep Python's lock for seconds, while something flies."""
_STANDALONE = {0x01, *range(0xD0, 0xDA)}
"""Markers of a JPEG that have no length."""
_FRAMES = set(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of a JPEG that give its size (ITU-T T.81, table B.1)."""


class FetchedPicture(NamedTuple):
    """A picture as it was fetched."""

    data: bytes
    format: ImageFormat
    width_px: int
    height_px: int


_PORTS = {"http": 80, "https": 443}


class _Allowed(NamedTuple):
    """Permission by a setting: a host, or only one of its ports (0: any), and everything below a path."""

    host: str
    port: int
    path: str

    @classmethod
    def of(cls, text: str) -> _Allowed:
        """Reads ``HOST``, ``HOST:PORT``, ``HOST:PORT/PATH``; an address of IPv6 with a port is in brackets."""
        authority, _, path = text.partition("/")
        host, colon, port = authority.rpartition(":")
        if not colon or (host.count(":") and not host.endswith("]")):  # no port, or the whole is of IPv6
            host, port = authority, "0"
        return cls(host.strip("[]").lower(), int(port), f"/{path}")

    def has(self, host: str, port: int, path: str) -> bool:
        """Returns whether an address is allowed. Where a path is said, nothing in it may lead out again."""
        is_below = self.path == "/" or (
            (path == self.path or path.startswith(self.path.rstrip("/") + "/")) and _is_plain(path)
        )
        return host.lower() == self.host and self.port in (0, port) and is_below


def _is_plain(path: str) -> bool:
    return not any(each in (".", "..") or "%" in each or "\\" in each for each in path.split("/"))


class HttpPictures:
    """From any thread.

    The addresses come over a link that anybody near may write to. So only the hosts that the settings name are asked,
    directly, and without following to others: ``HOST``, or only a port and a part of it, ``HOST:PORT/PATH``.
    """

    def __init__(self, hosts: tuple[str, ...]) -> None:
        self._allowed = tuple(map(_Allowed.of, hosts))
        self._worker = PictureWorker("http-pictures")
        self._lock = threading.Lock()
        self._exchange: _Exchange | None = None
        """Exchange that was begun last."""
        self._is_closed = False

    @property
    def has_hosts(self) -> bool:
        """Whether any may be asked."""
        return bool(self._allowed)

    def fetch(self, url: str) -> Future[FetchedPicture]:
        """Returns the future of a picture. It ends within `TIMEOUT_S`, also where others wait before it."""
        refusal, end_s = self._refusal(url), time.monotonic() + TIMEOUT_S
        if refusal is None:
            return self._worker.submit(lambda: self._fetched(url, end_s))
        return futures.failed(refusal)

    def close(self) -> None:
        """Cancels the pictures that wait, and ends the one that is being fetched."""
        with self._lock:
            exchange, self._is_closed = self._exchange, True
        if exchange is not None:
            exchange.end(_closed())
        self._worker.close()

    def _refusal(self, url: str) -> UalError | None:
        try:
            parts = urlsplit(url)
            scheme, host, port = parts.scheme, parts.hostname or "", parts.port
        except ValueError:
            scheme, host = "", ""
        if scheme not in _PORTS or not host:
            return NotSupportedError(f"the picture is at {url[:200]!r}, and only http and https are read")
        if any(each.has(host, port or _PORTS[scheme], parts.path) for each in self._allowed):
            return None
        text = f"the picture is at {url[:200]!r}: add {host!r} to mavlink.picture_hosts, if it is the camera's"
        return NotSupportedError(text, {"host": host})

    def _fetched(self, url: str, end_s: float) -> FetchedPicture:
        from http.client import HTTPException  # late: only callers that want pictures wait for it

        exchange = _Exchange(url, end_s)
        with self._lock:
            self._exchange = exchange
            if self._is_closed:
                raise _closed()
        try:
            return _picture(exchange.run(), url)
        except UalError:  # one of them is a TimeoutError, too
            raise
        except TimeoutError:
            raise UalTimeoutError(f"{url}: the camera's server has said nothing for {SERVER_SILENCE_S:g} s") from None
        except (OSError, HTTPException, ValueError) as error:
            raise LinkLostError(f"{url}: the camera's server cannot be read: {error!r}") from None


class _Exchange:
    """One request of a picture, which goes to its address alone: `http.client` follows to no other, by no proxy."""

    def __init__(self, url: str, end_s: float) -> None:
        self._url = url
        self._end_s = end_s
        self._lock = threading.Lock()
        self._socket: socket.socket | None = None
        self._why_ended: UalError | None = None

    def end(self, why: UalError) -> None:
        """Ends it with an error, whatever the server does meanwhile. From any thread."""
        with self._lock:
            self._why_ended = self._why_ended or why
            connected = self._socket
        if connected is not None:
            with suppress(OSError):  # it has ended by itself
                connected.shutdown(socket.SHUT_RDWR)

    def run(self) -> bytes:
        """Returns the bytes of the picture. Each wait of the socket has its limit, and so has the whole."""
        late = UalTimeoutError(f"the picture has not come within {TIMEOUT_S:g} s")
        left_s = self._end_s - time.monotonic()
        if left_s <= 0.0:
            raise late
        timer = threading.Timer(left_s, self.end, (late,))
        timer.daemon = True
        timer.start()
        try:
            return self._request()
        except Exception:
            self._require_going()  # else that is why
            raise
        finally:
            timer.cancel()

    def _request(self) -> bytes:
        address = urlsplit(self._url)
        with closing(_connection_to(address)) as connection:
            connection.connect()
            with self._lock:
                self._socket = connection.sock
            self._require_going()
            path = urlunsplit(("", "", address.path or "/", address.query, ""))
            connection.request("GET", path, headers={"Connection": "close"})
            return self._read(connection.getresponse())

    def _read(self, response: HTTPResponse) -> bytes:
        if not 200 <= response.status < 300:
            raise UalError(f"{self._url}: the camera's server answered {response.status} {response.reason}")
        data = bytearray()
        while chunk := response.read(_CHUNK_BYTES):
            data += chunk
            if len(data) > LARGEST_PICTURE_BYTES:
                raise UalError(f"the picture has more than {LARGEST_PICTURE_BYTES >> 20} MiB")
        self._require_going()  # one that has no length just ends
        if response.length:  # `read` says nothing of it
            from http.client import IncompleteRead

            raise IncompleteRead(bytes(data), response.length)
        return bytes(data)

    def _require_going(self) -> None:
        with self._lock:
            if self._why_ended is not None:
                raise self._why_ended from None


def _connection_to(address: SplitResult) -> HTTPConnection:
    from http.client import HTTPConnection, HTTPSConnection

    kind = HTTPSConnection if address.scheme == "https" else HTTPConnection
    return kind(address.hostname or "", address.port, timeout=SERVER_SILENCE_S)


def _closed() -> UalError:
    return UalError("this UAV is closed")


def _picture(data: bytes, url: str) -> FetchedPicture:
    """Reads what a picture says of itself."""
    if data.startswith(_PNG) and len(data) >= 24:
        return FetchedPicture(
            data, ImageFormat.PNG, int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
        )
    size = _size_of_jpeg(data) if data.startswith(_JPEG) else None
    if size is None:
        raise NotSupportedError(f"{url}: what the camera's server gave is no PNG and no JPEG")
    return FetchedPicture(data, ImageFormat.JPEG, *size)


def _size_of_jpeg(data: bytes) -> tuple[int, int] | None:
    """Returns the width and the height of a JPEG; None where it does not give them."""
    at = len(_JPEG)
    for _ in range(_MOST_MARKERS):
        if at + 9 > len(data) or data[at] != 0xFF:
            break
        marker = data[at + 1]
        if marker in _FRAMES:
            return int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
        at += 1 if marker == 0xFF else 2 if marker in _STANDALONE else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
