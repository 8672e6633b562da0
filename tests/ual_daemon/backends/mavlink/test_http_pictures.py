"""Pictures of cameras by HTTP, from a server of this test that may do anything."""

from __future__ import annotations

import contextlib
import struct
import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
import pytest
from typing_extensions import override

from tests.conftest import LIMIT_S
from tests.waiting import until
from ual.cameras import CameraAbility, CameraInfo, CameraIntrinsics, ImageFormat
from ual.contract.methods import METHODS
from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    ResourceExhaustedError,
    UalError,
    UalTimeoutError,
)
from ual_daemon.backends.engine.picture_worker import MOST_WAITING_PICTURES
from ual_daemon.backends.light import png
from ual_daemon.backends.mavlink.offers import http_pictures
from ual_daemon.backends.mavlink.offers.cameras import MavlinkCamera
from ual_daemon.backends.mavlink.offers.http_pictures import HttpPictures
from ual_daemon.backends.offers.cameras import TakenPhoto, Viewpoint

PNG = png.encode(np.zeros((2, 3, 3), np.uint8))
JPEG = b"".join(
    (
        b"\xff\xd8",
        b"\xff\xe0" + struct.pack(">H", 16) + bytes(14),
        b"\xff\xff\xfe" + struct.pack(">H", 4) + b"hi",  # a fill byte, and a comment
        b"\xff\xc2" + struct.pack(">HBHHB", 17, 8, 480, 640, 3) + bytes(9),
        b"\xff\xda",
    )
)
Answer = Callable[[BaseHTTPRequestHandler], None]


class Server:
    """Answers each path as a test says. `asked` are the paths that were asked for."""

    def __init__(self) -> None:
        self.answers: dict[str, Answer] = {}
        self.asked: list[str] = []
        self.released = threading.Event()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._server.server_port}"

    def says_nothing(self, _: BaseHTTPRequestHandler) -> None:
        """Answers once the test has ended."""
        self.released.wait(LIMIT_S)

    def close(self) -> None:
        self.released.set()
        self._server.shutdown()
        self._server.server_close()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        served = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                served.asked.append(self.path)
                served.answers[self.path](self)

            @override
            def log_message(self, format: str, *args: Any) -> None:
                """It says nothing."""

        return Handler


def gives(data: bytes, length: int | None = None, code: int = 200, **headers: str) -> Answer:
    def answer(request: BaseHTTPRequestHandler) -> None:
        request.send_response(code)
        request.send_header("Content-Length", str(len(data) if length is None else length))
        for name, value in headers.items():
            request.send_header(name, value)
        request.end_headers()
        request.wfile.write(data)

    return answer


@pytest.fixture
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.close()


@pytest.fixture
def pictures() -> Iterator[HttpPictures]:
    pictures = HttpPictures(("127.0.0.1",))
    yield pictures
    pictures.close()


@pytest.mark.parametrize(
    ("allowed", "path", "is_read"),
    [
        ("{host}:{port}", "/1", True),
        ("{host}:{port}/", "/1", True),
        ("{host}:{port}/pictures", "/pictures/1", True),
        ("{host}:{port}/pictures/", "/pictures/1", True),
        ("{host}/pictures", "/pictures/1", True),
        ("{host}:1", "/1", False),
        ("{host}:{port}/pictures", "/1", False),
        ("{host}:{port}/pictures", "/pictures2/1", False),
        ("{host}:{port}/pictures", "/pictures/../1", False),
        ("{host}:{port}/pictures", "/pictures/%2e%2e/1", False),
    ],
)
def test_a_port_and_a_path_of_a_host_are_allowed(server: Server, allowed: str, path: str, is_read: bool) -> None:
    host, _, port = server.url.removeprefix("http://").partition(":")
    server.answers[path] = gives(PNG)
    pictures = HttpPictures((allowed.format(host=host, port=port),))
    try:
        found = pictures.fetch(server.url + path)
        if is_read:
            assert found.result(LIMIT_S).data == PNG
        else:
            with pytest.raises(NotSupportedError, match="picture_hosts"):
                found.result(LIMIT_S)
            assert server.asked == []
    finally:
        pictures.close()


@pytest.mark.parametrize(
    ("data", "form", "size"),
    [(PNG, ImageFormat.PNG, (3, 2)), (JPEG, ImageFormat.JPEG, (640, 480))],
    ids=["png", "jpeg"],
)
def test_a_picture_comes_as_it_is_with_its_size(
    server: Server, pictures: HttpPictures, data: bytes, form: ImageFormat, size: tuple[int, int]
) -> None:
    server.answers["/1"] = gives(data)
    found = pictures.fetch(f"{server.url}/1").result(LIMIT_S)
    assert found == (data, form, *size)


@pytest.mark.parametrize(
    ("answer", "error", "text"),
    [
        (gives(b"", code=404), UalError, "answered 404"),
        (gives(b"", code=302, Location="http://127.0.0.1:1/2"), UalError, "answered 302"),
        (gives(b"<html>"), NotSupportedError, "no PNG and no JPEG"),
        (gives(JPEG[:30]), NotSupportedError, "no PNG and no JPEG"),
        (gives(b"\xff\xd8" + b"\xff\xe0\x00\x00" * 3), NotSupportedError, "no PNG and no JPEG"),
        (gives(JPEG[:2] + b"\xff" * 9000 + JPEG[2:]), NotSupportedError, "no PNG and no JPEG"),
        (gives(PNG, length=len(PNG) + 1), LinkLostError, "cannot be read: IncompleteRead"),
        (gives(PNG + bytes(20000)), UalError, "has more than"),
        (lambda request: request.wfile.write(b"nonsense\r\n\r\n"), LinkLostError, "cannot be read"),
    ],
    ids=[
        "lacks it",
        "sends to another",
        "a page",
        "cut",
        "no way on",
        "fill bytes",
        "ends early",
        "too large",
        "no HTTP",
    ],
)
def test_what_is_wrong_is_reported(
    server: Server,
    pictures: HttpPictures,
    monkeypatch: pytest.MonkeyPatch,
    answer: Answer,
    error: type[UalError],
    text: str,
) -> None:
    monkeypatch.setattr(http_pictures, "LARGEST_PICTURE_BYTES", 10000)
    server.answers["/1"] = answer
    with pytest.raises(error, match=text):
        pictures.fetch(f"{server.url}/1").result(LIMIT_S)
    assert server.asked == ["/1"]


@pytest.mark.parametrize("url", ["http://localhost/1", "mftp://DCIM/1.jpg", "file:///etc/passwd", "http://[", ""])
def test_no_other_host_is_queried(pictures: HttpPictures, url: str) -> None:
    with pytest.raises(NotSupportedError, match=r"only http and https|add 'localhost' to mavlink.picture_hosts"):
        pictures.fetch(url).result(LIMIT_S)


def test_a_server_that_says_nothing_is_not_waited_for_without_end(
    server: Server, pictures: HttpPictures, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http_pictures, "SERVER_SILENCE_S", 0.05)
    server.answers["/1"] = server.says_nothing
    with pytest.raises(UalTimeoutError, match="has said nothing"):
        pictures.fetch(f"{server.url}/1").result(LIMIT_S)


@pytest.mark.parametrize("begin", [b"HTTP/1.1 200 OK\r\n", b"HTTP/1.1 200 OK\r\nContent-Length: 60000\r\n\r\n"])
@pytest.mark.parametrize("how", ["late", "closed"])
def test_a_server_that_says_a_byte_at_a_time_is_not_waited_for_without_end(
    server: Server, pictures: HttpPictures, monkeypatch: pytest.MonkeyPatch, begin: bytes, how: str
) -> None:
    """Each byte is a sign of life, so only a limit for the whole ends it: in the header, or in the picture."""
    monkeypatch.setattr(http_pictures, "TIMEOUT_S", 0.2 if how == "late" else LIMIT_S)
    said = threading.Event()

    def drip(request: BaseHTTPRequestHandler) -> None:
        with contextlib.suppress(OSError):
            request.wfile.write(begin)
            while not server.released.wait(0.01):
                request.wfile.write(b"x")
                said.set()

    server.answers["/1"] = drip
    fetched = pictures.fetch(f"{server.url}/1")
    assert said.wait(LIMIT_S)
    if how == "closed":
        pictures.close()
    with pytest.raises(UalError, match="has not come within" if how == "late" else "closed"):
        fetched.result(LIMIT_S)
    assert how == "late" or fetched.done()


def test_a_picture_ends_before_its_caller_gives_up_also_where_it_waits_for_others(server: Server) -> None:
    """Else it would be fetched for no one, and hold up all that come after it."""
    assert METHODS["GetImage"].limit_s > http_pictures.TIMEOUT_S + 1.0
    with pytest.raises(UalTimeoutError, match="has not come within"):
        http_pictures._Exchange(f"{server.url}/1", time.monotonic()).run()
    assert server.asked == []


def test_only_so_many_wait_and_the_end_cancels_them(server: Server, pictures: HttpPictures) -> None:
    server.answers["/1"] = server.says_nothing
    waiting = [pictures.fetch(f"{server.url}/1") for _ in range(MOST_WAITING_PICTURES)]
    with pytest.raises(ResourceExhaustedError, match="wait for one"):
        pictures.fetch(f"{server.url}/1").result(LIMIT_S)
    closing = threading.Thread(target=pictures.close)
    closing.start()
    until(lambda: all(each.done() for each in waiting[1:]), "the end of those that wait")
    for each in waiting[1:]:
        if not each.cancelled():  # its turn came before it was cancelled
            assert "closed" in str(each.exception())
    server.released.set()
    closing.join(LIMIT_S)
    with pytest.raises(UalError, match="closed"):
        pictures.fetch(f"{server.url}/1").result(LIMIT_S)


class Link:
    """A camera on its link, as far as its pictures are asked for."""

    name = "camera 0 (Eye)"

    def __init__(self, *urls: str) -> None:
        self.photos = self
        self._taken = [TakenPhoto(number, 7.0, Viewpoint(), file_url=url) for number, url in enumerate(urls)]

    def since(self, first: int) -> list[TakenPhoto]:
        return self._taken[first:]

    def info(self, _: float) -> CameraInfo:
        lens = CameraIntrinsics.of_view(640, 480, 1.0)
        return CameraInfo(0, self.name, frozenset({CameraAbility.PHOTO}), is_connected=True, intrinsics=lens)


def camera(pictures: HttpPictures, *urls: str) -> MavlinkCamera:
    made: Any = Link(*urls), lambda: 0.0, None, pictures
    return MavlinkCamera(*made)


def test_a_camera_gives_the_picture_of_a_photo_that_it_has_reported(server: Server, pictures: HttpPictures) -> None:
    server.answers["/1"], server.answers["/2"] = gives(JPEG), gives(PNG)
    tested = camera(pictures, "", f"{server.url}/1", f"{server.url}/2")
    assert CameraAbility.IMAGE in tested.info.abilities
    found, preview = (tested.image(number).result(LIMIT_S) for number in (1, 2))
    assert (found.data, found.width_px, found.stamp_s, found.intrinsics) == (JPEG, 640, 7.0, tested.info.intrinsics)
    assert preview.intrinsics is None  # they are for another size
    with pytest.raises(NotSupportedError, match="has not told where its photo 0 is"):
        tested.image(0).result(LIMIT_S)
    with pytest.raises(InvalidArgumentError, match="no photo 3"):
        tested.image(3).result(LIMIT_S)
    with pytest.raises(NotSupportedError, match="name a photo"):
        tested.image(None).result(LIMIT_S)


def test_without_a_host_in_the_settings_it_gives_none() -> None:
    assert camera(HttpPictures(()), "http://127.0.0.1/1").info.abilities == {CameraAbility.PHOTO}
