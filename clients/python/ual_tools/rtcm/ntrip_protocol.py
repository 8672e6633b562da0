"""Protocol of NTRIP casters, version 1 and 2: a request, an answer and its body, positions."""

from __future__ import annotations

import base64
import socket
import ssl
import time
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from ual.shared.text import printable
from ual.types import GeoPoint
from ual_tools import __version__
from ual_tools.rtcm.source import CONNECT_S, READ_TIMEOUT_S, SourceError

OK, FORBIDDEN, MISSING = 200, frozenset({401, 403}), 404
_READ_BYTES = 4096
_LONGEST_HEAD_BYTES = 16_384
_LONGEST_TABLE_BYTES = 4 << 20
_ANSWER_S = 10.0
_LINE = b"\r\n"
_FIXED, _SATELLITES = 1, 12
"""Quality and number of satellites of a GGA sentence: casters that compute for a place want a fix."""


class Caster(NamedTuple):
    """Address of a caster."""

    host: str
    port: int
    mountpoint: str
    user: str
    password: str
    has_tls: bool

    @property
    def shown(self) -> str:
        """Its address without the password."""
        return f"{self.host}:{self.port}/{self.mountpoint}"


class Head(NamedTuple):
    """The beginning of an answer: its status as HTTP counts, the status' text, and the headers."""

    status: int
    text: str
    headers: Mapping[str, str]
    is_table: bool

    @property
    def is_chunked(self) -> bool:
        """Whether the body comes in pieces that say their length."""
        return "chunked" in self.headers.get("transfer-encoding", "").lower()


class NtripConnection:
    """One request to a caster, and its answer. Every call raises `SourceError` where the connection breaks."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self._waiting = b""
        self._is_chunked = False

    def ask(self, caster: Caster, mountpoint: str, gga: str, *, is_version_2: bool) -> None:
        """Asks for a mount point; for the table, where it is empty."""
        token = base64.b64encode(f"{caster.user}:{caster.password}".encode()).decode()
        lines = [
            f"GET /{mountpoint} HTTP/1.{int(is_version_2)}",
            f"Host: {caster.host}:{caster.port}",
            f"User-Agent: NTRIP ual/{__version__}",
            f"Authorization: Basic {token}",
            "Accept: */*",
            "Connection: close",
        ]
        if is_version_2:
            lines += ["Ntrip-Version: Ntrip/2.0", *([f"Ntrip-GGA: {gga}"] if gga else [])]
        self._send("\r\n".join([*lines, "", ""]))

    def tell(self, gga: str) -> None:
        """Tells where the UAV is."""
        self._send(f"{gga}\r\n")

    def head(self) -> Head | None:
        """Reads the beginning of the answer, in however many pieces it comes; None where the caster says nothing."""
        end_s = time.monotonic() + _ANSWER_S
        while (found := _head(self._waiting)) is None:
            if len(self._waiting) > _LONGEST_HEAD_BYTES:
                raise SourceError("its answer is none of NTRIP")
            if time.monotonic() > end_s:
                raise SourceError(f"it did not answer within {_ANSWER_S:g} s")
            if (data := self._receive()) == b"":
                if self._waiting:
                    raise SourceError("it has closed the connection amid its answer")
                return None
            self._waiting += data or b""
        head, self._waiting = found
        self._is_chunked = head.is_chunked
        return head

    def body(self) -> Generator[bytes, None, None]:
        """Yields what comes after that, ``b""`` while nothing comes, until the caster closes the connection."""
        pieces = _Chunks() if self._is_chunked else None
        data = self._waiting
        while True:
            yield data if pieces is None else pieces.of(data)
            if pieces is not None and pieces.has_ended:
                return
            received = self._receive()
            if received == b"":
                return
            data = received or b""

    def table(self) -> list[list[str]]:
        """Returns the fields of each mount point of the table that comes."""
        end_s, table = time.monotonic() + _ANSWER_S, b""
        for data in self.body():
            table += data
            if b"ENDSOURCETABLE" in table:
                break
            if time.monotonic() > end_s or len(table) > _LONGEST_TABLE_BYTES:
                raise SourceError(f"its table of mount points did not end within {_ANSWER_S:g} s")
        lines = table.decode(errors="replace").splitlines()
        return [[printable(each) for each in line.split(";")[1:]] for line in lines if line.startswith("STR;")]

    def _send(self, text: str) -> None:
        with _as_source_error():
            self._link.sendall(text.encode())

    def _receive(self) -> bytes | None:
        """Returns what comes; None where nothing does in time, ``b""`` at the end."""
        with _as_source_error():
            try:
                return self._link.recv(_READ_BYTES)
            except TimeoutError:
                return None


@contextmanager
def connected(caster: Caster) -> Iterator[NtripConnection]:
    """Opens a connection for one request.

    Raises:
        SourceError: The caster cannot be reached, or its certificate is not trusted.

    """
    with _as_source_error():
        link = socket.create_connection((caster.host, caster.port), CONNECT_S)
    with link:
        if caster.has_tls:
            with _as_source_error():
                link = ssl.create_default_context().wrap_socket(link, server_hostname=caster.host)
        with link:
            link.settimeout(READ_TIMEOUT_S)
            yield NtripConnection(link)


def gga(point: GeoPoint, utc_s: float) -> str:
    """Returns the sentence of NMEA 0183 that says where the UAV is."""
    altitude_m = point.altitude_amsl_m or 0.0
    ellipsoid_m = altitude_m if point.altitude_ellipsoid_m is None else point.altitude_ellipsoid_m
    fields = [
        "GPGGA",
        time.strftime("%H%M%S", time.gmtime(utc_s)) + ".00",
        *_angle(point.latitude_deg, 2, "NS"),
        *_angle(point.longitude_deg, 3, "EW"),
        str(_FIXED),
        str(_SATELLITES),
        "1.0",
        f"{altitude_m:.3f}",
        "M",
        f"{ellipsoid_m - altitude_m:.3f}",
        "M",
        "",
        "",
    ]
    text = ",".join(fields)
    checksum = 0
    for each in text.encode():
        checksum ^= each
    return f"${text}*{checksum:02X}"


def _angle(angle_deg: float, digits: int, signs: str) -> tuple[str, str]:
    """Returns an angle as degrees and minutes, and its side."""
    tenths_of_micro_minutes = round(abs(angle_deg) * 60.0 * 1e7)
    degrees, rest = divmod(tenths_of_micro_minutes, 60 * 10**7)
    return f"{degrees:0{digits}d}{rest / 1e7:010.7f}", signs[angle_deg < 0.0]


def _head(data: bytes) -> tuple[Head, bytes] | None:
    """Returns the beginning of an answer and what follows; None while it is not whole."""
    first, separator, rest = data.partition(_LINE)
    if not separator:
        return None
    line = printable(first.decode(errors="replace"))
    if line.startswith("ICY "):  # version 1 has no headers; some casters add an empty line
        return Head(_status(line), line, {}, is_table=False), rest
    if line.startswith("ERROR"):  # version 1: the mount point, or the client
        return Head(401 if "password" in line.lower() else 400, line, {}, is_table=False), rest
    is_old_table = line.startswith("SOURCETABLE ")
    if not (is_old_table or line.startswith("HTTP/1.")):
        raise SourceError(f"its answer is none of NTRIP: {line[:80]}")
    if rest.startswith(_LINE):
        head, rest = b"", rest[len(_LINE) :]
    else:
        head, separator, rest = rest.partition(_LINE + _LINE)
        if not separator:
            return None
    pairs = (each.partition(":") for each in head.decode(errors="replace").splitlines())
    headers = {name.strip().lower(): value.strip() for name, _, value in pairs}
    is_table = is_old_table or "sourcetable" in headers.get("content-type", "").lower()
    return Head(_status(line), line, headers, is_table), rest


def _status(line: str) -> int:
    words = line.split()
    return int(words[1]) if len(words) > 1 and words[1].isdecimal() else 0


class _Chunks:
    """A body that comes in pieces (HTTP's ``Transfer-Encoding: chunked``), cut anywhere."""

    def __init__(self) -> None:
        self.has_ended = False
        self._waiting = b""
        self._left = 0
        """Bytes of the present piece that are still to come, with the end of its line."""

    def of(self, data: bytes) -> bytes:
        """Returns the content of what came."""
        self._waiting += data
        content = b""
        while not self.has_ended:
            if self._left == 0 and not self._begin():
                break
            piece, self._waiting = self._waiting[: self._left], self._waiting[self._left :]
            # The last two bytes are the end of the line.
            content += piece[: max(0, self._left - len(_LINE))]
            self._left -= len(piece)
            if self._left:
                break
        return content

    def _begin(self) -> bool:
        """Reads how long the next piece is. Returns False while that has not come."""
        line, separator, rest = self._waiting.partition(_LINE)
        if not separator:
            if len(self._waiting) > _LONGEST_HEAD_BYTES:
                raise SourceError("its answer is none of NTRIP: a piece without a length")
            return False
        try:
            length = int(line.partition(b";")[0].strip(), 16)
        except ValueError:
            raise SourceError("its answer is none of NTRIP: a piece without a length") from None
        self._waiting, self.has_ended = rest, length <= 0
        self._left = 0 if self.has_ended else length + len(_LINE)
        return not self.has_ended


@contextmanager
def _as_source_error() -> Iterator[None]:
    try:
        yield
    except OSError as error:  # those of TLS and of names, too
        raise SourceError(getattr(error, "verify_message", "") or error.strerror or str(error)) from None
