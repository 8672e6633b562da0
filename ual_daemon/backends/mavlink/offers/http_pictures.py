"""Fetches the pictures that a camera offers by HTTP, on a thread of its own."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import urlsplit

from typing_extensions import override

from ual.cameras import ImageFormat
from ual.errors import LinkLostError, NotSupportedError, UalError, UalTimeoutError
from ual_daemon.backends.engine.picture_worker import PictureWorker

if TYPE_CHECKING:
    from http.client import HTTPResponse

MOST_BYTES = 64 << 20
TIMEOUT_S = 60.0
"""A picture may take so long in all, ..."""
SILENCE_S = 5.0
"""... and its server may say nothing for so long."""
_CHUNK = 1 << 16
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
_STANDALONE = {0x01, *range(0xD0, 0xDA)}
"""Markers of a JPEG that have no length."""
_FRAMES = set(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of a JPEG that give its size (ITU-T T.81, table B.1)."""


class Picture(NamedTuple):
    """A picture as it was fetched."""

    data: bytes
    format: ImageFormat
    width_px: int
    height_px: int


def _opener() -> Callable[..., Any]:
    """Returns what opens an address."""
    import urllib.request  # late: only those wait for it who want pictures

    class NoRedirect(urllib.request.HTTPRedirectHandler):
        """A server may not send us to another one."""

        @override
        def redirect_request(self, *_: object) -> None:
            return None

    return urllib.request.build_opener(urllib.request.ProxyHandler({}), NoRedirect()).open


class HttpPictures:
    """From any thread.

    The addresses come over a link that anybody near may write to. So only the hosts that the settings name are asked,
    directly, and without following to others.
    """

    def __init__(self, hosts: tuple[str, ...]) -> None:
        self.hosts = frozenset(host.lower() for host in hosts)
        self._worker = PictureWorker("http-pictures")
        self._is_closed = False

    def fetch(self, url: str) -> Future[Picture]:
        """Returns the future of a picture. It ends within `TIMEOUT_S` and `SILENCE_S` for each that waits before it."""
        refusal = self._refusal(url)
        if refusal is None:
            return self._worker.submit(lambda: self._fetched(url))
        failed: Future[Picture] = Future()
        failed.set_exception(refusal)
        return failed

    def close(self) -> None:
        """Cancels the pictures that wait. One that is being fetched ends within `SILENCE_S`."""
        self._is_closed = True
        self._worker.close()

    def _refusal(self, url: str) -> UalError | None:
        try:
            scheme, host = urlsplit(url).scheme, urlsplit(url).hostname or ""
        except ValueError:
            scheme, host = "", ""
        if scheme not in ("http", "https") or not host:
            return NotSupportedError(f"the picture is at {url[:200]!r}, and only http and https are read")
        if host.lower() in self.hosts:
            return None
        text = f"the picture is at {url[:200]!r}: add {host!r} to mavlink.picture_hosts, if it is the camera's"
        return NotSupportedError(text, {"host": host})

    def _fetched(self, url: str) -> Picture:
        import urllib.error
        from http.client import HTTPException

        try:
            with _opener()(url, timeout=SILENCE_S) as response:
                return _picture(self._read(response), url)
        except UalError:  # one of them is a TimeoutError, too
            raise
        except urllib.error.HTTPError as error:
            raise UalError(f"{url}: the camera's server answered {error.code} {error.reason}") from None
        except TimeoutError:
            raise UalTimeoutError(f"{url}: the camera's server has said nothing for {SILENCE_S:g} s") from None
        except (OSError, HTTPException, ValueError) as error:
            reason = error.reason if isinstance(error, urllib.error.URLError) else error
            raise LinkLostError(f"{url}: the camera's server cannot be read: {reason!r}") from None

    def _read(self, response: HTTPResponse) -> bytes:
        data, until_s = bytearray(), time.monotonic() + TIMEOUT_S
        while chunk := response.read(_CHUNK):
            data += chunk
            if len(data) > MOST_BYTES:
                raise UalError(f"the picture has more than {MOST_BYTES >> 20} MiB")
            if time.monotonic() > until_s:
                raise UalTimeoutError(f"the picture has not come within {TIMEOUT_S:g} s ({len(data)} bytes have)")
            if self._is_closed:
                raise UalError("this UAV is closed")
        if response.length:  # `read` says nothing of it
            from http.client import IncompleteRead

            raise IncompleteRead(bytes(data), response.length)
        return bytes(data)


def _picture(data: bytes, url: str) -> Picture:
    """Reads what a picture says of itself."""
    if data.startswith(_PNG) and len(data) >= 24:
        return Picture(data, ImageFormat.PNG, int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big"))
    size = _size_of_jpeg(data) if data.startswith(_JPEG) else None
    if size is None:
        raise NotSupportedError(f"{url}: what the camera's server gave is no PNG and no JPEG")
    return Picture(data, ImageFormat.JPEG, *size)


def _size_of_jpeg(data: bytes) -> tuple[int, int] | None:
    """Returns the width and the height of a JPEG; None where it does not give them."""
    at = len(_JPEG)
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in _FRAMES:
            return int.from_bytes(data[at + 7 : at + 9], "big"), int.from_bytes(data[at + 5 : at + 7], "big")
        at += 1 if marker == 0xFF else 2 if marker in _STANDALONE else 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
