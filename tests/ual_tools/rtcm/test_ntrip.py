"""Corrections from casters of NTRIP 1 and 2 that behave as casters in the field do."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, suppress
from itertools import pairwise

import pytest

from tests.rtcm import message
from tests.waiting import LIMIT_S
from ual.errors import InvalidArgumentError
from ual.types import GeoPoint
from ual_tools.rtcm import ntrip
from ual_tools.rtcm.ntrip import NtripSource, parse_caster
from ual_tools.rtcm.source import SourceError

PLACE = GeoPoint(37.4117, -6.0013, 60.0, altitude_ellipsoid_m=109.5)
FIRST, SECOND = message(60, 1), message(180, 2)
STREAM = b"HTTP/1.1 200 OK\r\nContent-Type: gnss/data\r\nCache-Control: no-store\r\n\r\n"
CHUNKED = STREAM.replace(b"\r\n\r\n", b"\r\nTransfer-Encoding: chunked\r\n\r\n")
ICY = b"ICY 200 OK\r\n"


def table(*lines: str, version: int = 2) -> bytes:
    body = "".join(f"{line}\r\n" for line in (*lines, "ENDSOURCETABLE")).encode()
    if version == 1:
        return b"SOURCETABLE 200 OK\r\nContent-Type: text/plain\r\n\r\n" + body
    return b"HTTP/1.1 200 OK\r\nContent-Type: gnss/sourcetable\r\n\r\n" + body


def mount(name: str, wants: str) -> str:
    return f"STR;{name};x;RTCM 3.3;1005;2;GPS;x;ESP;37.4;-6.0;{wants};0;x;none;B;N;0;"


class RequestLog:
    """One request: what was asked, and how to answer it."""

    def __init__(self, link: socket.socket) -> None:
        self.link = link
        self._lines = link.makefile("rb")
        lines = iter(lambda: self._lines.readline().strip(), b"")
        self.first, *self.headers = [line.decode() for line in lines]

    def gga(self) -> str:
        """The next sentence with a position."""
        return self._lines.readline().decode().strip()

    def say(self, *pieces: bytes) -> None:
        """Sends pieces that arrive one by one."""
        self.link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for each in pieces:
            self.link.sendall(each)
            time.sleep(0.02)  # a piece of its own for the receiver


class Caster:
    """Answers requests for its table and its mount point, each as it is told."""

    def __init__(self, on_table: Callable[[RequestLog], object], on_mount: Callable[[RequestLog], object]) -> None:
        self._answers = {True: on_table, False: on_mount}
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.asked: list[RequestLog] = []
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def source(self, gga_s: int | None = None, place: GeoPoint | None = PLACE) -> NtripSource:
        return NtripSource(parse_caster(f"ntrip://ann:secret@127.0.0.1:{self.port}/NEAR"), lambda: place, gga_s)

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listening.close()

    def _serve(self) -> None:
        with ExitStack() as stack, suppress(OSError):
            while True:
                link = stack.enter_context(self._listening.accept()[0])
                asked = RequestLog(link)
                self.asked.append(asked)
                with suppress(OSError):
                    self._answers[asked.first.startswith("GET / ")](asked)
                    link.shutdown(socket.SHUT_WR)


def says(*pieces: bytes) -> Callable[[RequestLog], object]:
    return lambda asked: asked.say(*pieces)


TOLD = says(table(mount("NEAR", "0")))


def received(source: NtripSource, length: int) -> bytes:
    """Returns the received bytes, until there are enough, or the source ends."""
    found, end_s = b"", time.monotonic() + LIMIT_S
    with closing(source.chunks()) as chunks:
        for chunk in chunks:
            found += chunk
            if len(found) >= length or time.monotonic() > end_s:
                break
    return found


@pytest.fixture
def caster() -> Iterator[Callable[..., Caster]]:
    with ExitStack() as stack:
        yield lambda on_table, on_mount: stack.enter_context(closing(Caster(on_table, on_mount)))


def chunk(data: bytes) -> bytes:
    return f"{len(data):x}\r\n".encode() + data + b"\r\n"


@pytest.mark.parametrize(
    "pieces",
    [
        [STREAM + FIRST + SECOND],  # the first messages come with the header
        [STREAM[:30], STREAM[30:], FIRST, SECOND],
        [*(STREAM[i : i + 1] for i in range(len(STREAM))), FIRST + SECOND],
        [STREAM, FIRST[:7], FIRST[7:] + SECOND[:1], SECOND[1:]],
        [CHUNKED + chunk(FIRST) + chunk(SECOND)],
        [CHUNKED[:-3], CHUNKED[-3:], chunk(FIRST)[:1], chunk(FIRST)[1:-1], chunk(FIRST)[-1:] + chunk(SECOND)],
        [ICY + FIRST + SECOND],
        [ICY[:5], ICY[5:], FIRST, SECOND],
        [ICY + b"\r\n" + FIRST, SECOND],
    ],
    ids=[
        "at once",
        "two pieces",
        "bytes",
        "cut messages",
        "chunked",
        "cut chunks",
        "1",
        "1 in pieces",
        "1, empty line",
    ],
)
def test_all_that_a_caster_sends_is_passed_on(caster: Callable[..., Caster], pieces: Sequence[bytes]) -> None:
    near = caster(TOLD, says(*pieces))
    sent = FIRST + SECOND
    assert received(near.source(), len(sent)).lstrip(b"\r\n") == sent
    headers = near.asked[-1].headers
    assert "Ntrip-Version: Ntrip/2.0" in headers
    assert "Authorization: Basic YW5uOnNlY3JldA==" in headers
    assert any(each.startswith("User-Agent: NTRIP ") for each in headers)


@pytest.mark.parametrize("begin", [STREAM, ICY], ids=["2", "1"])
@pytest.mark.parametrize(
    "on_table",
    [
        says(table(mount("NEAR", "1"))),
        says(table(mount("NEAR", "1"), version=1)),
        says(table(mount("FAR", "0"))),
        says(table(mount("NEAR", ""))),
        says(b"HTTP/1.1 401 Unauthorized\r\n\r\n"),
        says(b"HTTP/1.1 403 Forbidden\r\n\r\n"),
        says(),
    ],
    ids=["wants", "wants, 1", "table lacks it", "table does not say", "401", "403", "closes"],
)
def test_a_virtual_base_station_is_reported_at_once_and_on_time(
    caster: Callable[..., Caster],
    begin: bytes,
    on_table: Callable[[RequestLog], object],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It sends nothing before it knows where the UAV is, and stops where it is not told again."""
    monkeypatch.setattr(ntrip, "GGA_S", 1)
    told: list[tuple[str, float]] = []

    def on_mount(asked: RequestLog) -> None:
        asked.say(begin)
        for sent in (FIRST, SECOND, FIRST):
            told.append((asked.gga(), time.monotonic()))
            if sent is not SECOND:  # what is told on time does not wait for messages
                asked.say(sent)

    near = caster(on_table, on_mount)
    assert received(near.source(), len(FIRST) * 2) == FIRST * 2
    assert [sentence[:6] for sentence, _ in told] == ["$GPGGA"] * 3
    assert [after - before for (_, before), (_, after) in pairwise(told)] == pytest.approx([1.0, 1.0], abs=0.9)
    [header] = [each for each in near.asked[-1].headers if each.startswith("Ntrip-GGA: ")]
    assert header.startswith("Ntrip-GGA: $GPGGA,")


def test_where_the_uav_is_is_reported_as_nmea_has_it(caster: Callable[..., Caster]) -> None:
    near = caster(TOLD, says(STREAM + FIRST))
    assert received(near.source(gga_s=5), len(FIRST)) == FIRST
    [header] = [each for each in near.asked[0].headers if each.startswith("Ntrip-GGA: ")]
    fields = header.removeprefix("Ntrip-GGA: ").split(",")
    assert fields[2:6] == ["3724.7020000", "N", "00600.0780000", "W"]
    assert fields[6:] == ["1", "12", "1.0", "60.000", "M", "49.500", "M", "", fields[-1]]
    text, _, checksum = header.removeprefix("Ntrip-GGA: $").partition("*")
    total = 0
    for each in text.encode():
        total ^= each
    assert int(checksum, 16) == total


@pytest.mark.parametrize("gga_s", [None, 0])
def test_a_caster_that_does_not_want_to_know_is_not_reported(caster: Callable[..., Caster], gga_s: int | None) -> None:
    near = caster(TOLD, says(STREAM + FIRST))
    assert received(near.source(gga_s), len(FIRST)) == FIRST
    assert not [each for each in near.asked[-1].headers if "GGA" in each]


def test_a_virtual_base_station_is_not_queried_while_the_position_is_not_known(caster: Callable[..., Caster]) -> None:
    near = caster(says(table(mount("NEAR", "1"))), says(STREAM))
    with pytest.raises(SourceError, match="it wants to know where the UAV is, and that is not known yet"):
        received(near.source(place=None), 1)
    assert len(near.asked) == 1


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (table(mount("FAR", "0"), mount("\x1b[31mRED", "0")), r"no mount point NEAR \(it has \?\[31mRED, FAR\)"),
        (table(mount("FAR", "0"), version=1), r"has no mount point NEAR \(it has FAR\)"),
        (b"HTTP/1.1 404 Not Found\r\n\r\n", "has no mount point NEAR$"),
    ],
    ids=["table", "table of 1", "404"],
)
def test_a_mount_point_that_is_not_there_ends_it(caster: Callable[..., Caster], answer: bytes, why: str) -> None:
    near = caster(says(table(mount("FAR", "0"))), says(answer))
    with pytest.raises(InvalidArgumentError, match=why):
        received(near.source(), 1)


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (b"HTTP/1.1 401 Unauthorized\r\n\r\n", r"it refuses: HTTP/1.1 401 Unauthorized \(UAL_NTRIP_USER"),
        (b"ERROR - Bad Password\r\n", r"it refuses: ERROR - Bad Password \(UAL_NTRIP_USER"),
        (b"HTTP/1.1 503 \x1b[31mBusy\r\n\r\n", r"it refuses: HTTP/1.1 503 \?\[31mBusy$"),
        (b"SSH-2.0-OpenSSH\r\n", "its answer is none of NTRIP: SSH-2.0-OpenSSH"),
        (CHUNKED + b"zz\r\n", "its answer is none of NTRIP: a piece without a length"),
        (STREAM[:20], "it has closed the connection amid its answer"),
        (b"", "it has closed the connection without an answer"),
        (STREAM + FIRST, "the caster has closed the connection"),
    ],
)
def test_what_a_caster_refuses_or_breaks_is_tried_again(caster: Callable[..., Caster], answer: bytes, why: str) -> None:
    near = caster(TOLD, says(answer))
    source = near.source()
    for _ in range(2):
        with pytest.raises(SourceError, match=why):
            received(source, 1 << 20)


def test_a_caster_that_knows_only_version_1_is_queried_as_that(caster: Callable[..., Caster]) -> None:
    def on_mount(asked: RequestLog) -> None:
        asked.say(ICY + FIRST if asked.first.endswith("HTTP/1.0") else b"")

    near = caster(TOLD, on_mount)
    assert received(near.source(), len(FIRST)) == FIRST
    assert not [each for each in near.asked[-1].headers if each.startswith("Ntrip-")]
