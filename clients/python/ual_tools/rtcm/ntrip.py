"""An NTRIP caster as a source of corrections. pygnssutils speaks with it, and is imported only for this."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Generator
from queue import Empty, Queue
from typing import Any, NamedTuple
from urllib.parse import unquote, urlsplit

from typing_extensions import Self, override

from ual.errors import InvalidArgumentError
from ual.shared import environment, extras
from ual.types import GeoPoint
from ual_tools.rtcm.source import EXTRA, SILENCE_S, WAIT_S, Source, SourceError

USER_VARIABLE, PASSWORD_VARIABLE = "UAL_NTRIP_USER", "UAL_NTRIP_PASSWORD"
GGA_S = 10
"""How often a caster that wants to know where the UAV is, is told."""
_PORTS = {"ntrip": 2101, "ntrips": 443}
_TABLE_S = 10.0
_WANTS_POSITION = 10
"""The field of a line of the caster's table that is 1 where the caster wants to be told the position."""
_START = b"\xd3"

Position = Callable[[], GeoPoint | None]
"""Returns where the UAV is; None while that is not known."""


class Caster(NamedTuple):
    """What an address of a caster says."""

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


class NtripSource(Source):
    """A mount point of a caster. `position` is told to the caster each `gga_s`; None: where its table says so."""

    def __init__(self, caster: Caster, position: Position, gga_s: int | None = None) -> None:
        with extras.needs("ual rtcm --ntrip", EXTRA):
            import pygnssutils  # noqa: F401 - only to see whether it is installed
        self.name = caster.shown
        self._caster = caster
        self._position = position
        self._gga_s = gga_s

    @override
    def chunks(self) -> Generator[bytes, None, None]:
        if self._gga_s is None:
            self._gga_s = GGA_S if self._wants_position() else 0
        if self._gga_s and self._position() is None:
            raise SourceError("it wants to know where the UAV is, and that is not known yet")
        with _Connection(self._caster, self._position, self._gga_s, self._caster.mountpoint) as connection:
            while True:
                received = connection.next(WAIT_S)
                data = b"" if received is None else received[0]
                yield data if data[:1] == _START else b""  # it also shows the position that it has sent

    def _wants_position(self) -> bool:
        """Looks the mount point up in the caster's table."""
        with _Connection(self._caster, self._position, 0, "") as connection:
            end_s = time.monotonic() + _TABLE_S
            while time.monotonic() < end_s:
                received = connection.next(WAIT_S)
                if received is not None and isinstance(received[0], list):
                    return _is_wanted(received[0], self._caster)
        raise SourceError(f"its table of mount points did not come within {_TABLE_S:g} s")


def _is_wanted(table: list[list[str]], caster: Caster) -> bool:
    lines = [line for line in table if line and line[0] == caster.mountpoint]
    if not lines:
        known = ", ".join(sorted({line[0] for line in table if line})[:10]) or "none"
        text = f"ntrip: {caster.host}:{caster.port} has no mount point {caster.mountpoint} (it has {known})"
        raise InvalidArgumentError(text, {"field": "ntrip"})
    told = {line[_WANTS_POSITION].strip() if len(line) > _WANTS_POSITION else "" for line in lines}
    if told not in ({"0"}, {"1"}):
        has = " and ".join(map(repr, sorted(told)))
        text = (
            f"ntrip: the table of {caster.host}:{caster.port} has {has} where it is to say whether {caster.mountpoint} "
            "wants to know the position (0 or 1): say so by --gga"
        )
        raise InvalidArgumentError(text, {"field": "ntrip"})
    return told == {"1"}


class _Connection:
    """One connection of pygnssutils, which has a thread of its own, and tells its end to an "application"."""

    def __init__(self, caster: Caster, position: Position, gga_s: int, mountpoint: str) -> None:
        from pygnssutils import GNSSNTRIPClient
        from pygnssutils.globals import VERBOSITY_CRITICAL

        self._position = position
        self._received: Queue[Any] = Queue()
        self._failure = ""
        self._is_over = threading.Event()
        logging.getLogger("pygnssutils").addHandler(logging.NullHandler())  # what it has to say comes by `set_controls`
        # Not again by itself: what it does while it waits is not told.
        self._client = GNSSNTRIPClient(self, retries=0, timeout=SILENCE_S, verbosity=VERBOSITY_CRITICAL)
        self._client.run(
            server=caster.host,
            port=caster.port,
            https=caster.has_tls,
            mountpoint=mountpoint,
            ntripuser=caster.user,
            ntrippassword=caster.password,
            ggainterval=gga_s or -1,
            output=self._received,
            stopevent=threading.Event(),
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.stop()

    def next(self, timeout_s: float) -> Any:  # noqa: ANN401 (bytes or a table, with what pygnssutils made of them)
        """Returns what comes next; None where nothing does in time.

        Raises:
            SourceError: The connection has ended.

        """
        try:
            received = self._received.get(timeout=timeout_s)
        except Empty:
            if self._is_over.is_set():
                raise SourceError(self._failure or "the connection has ended") from None
            return None
        if not received[0]:  # again and again from now on
            self._client.stop()
            raise SourceError("the caster has closed the connection")
        return received

    # --- What pygnssutils calls ---------------------------------------------------------------------------------------

    def dialog(self, _name: str) -> _Connection:
        """Returns what is told of the connection."""
        return self

    def set_controls(self, is_up: bool, told: tuple[str, str]) -> None:
        """Takes how the connection is."""
        if not is_up:
            self._failure = str(told[0])
            self._is_over.set()

    def get_coordinates(self) -> dict[str, object]:
        """Returns where the UAV is. A `ValueError` has nothing sent."""
        point = self._position()
        if point is None:
            raise ValueError("it is not known where the UAV is")
        altitude_m = point.altitude_amsl_m or 0.0
        ellipsoid_m = altitude_m if point.altitude_ellipsoid_m is None else point.altitude_ellipsoid_m
        return {
            "lat": point.latitude_deg,
            "lon": point.longitude_deg,
            "alt": altitude_m,
            "sep": ellipsoid_m - altitude_m,
        }


def parse_caster(text: str) -> Caster:
    """Parses ``ntrip://[user[:password]@]host[:port]/mountpoint`` (``ntrips``: with TLS).

    What shows who asks comes from the environment where it is not there, so that no list of processes has it.
    """
    url = urlsplit(text)
    try:
        port = url.port
    except ValueError:
        port = 0
    mountpoint = url.path.strip("/")
    if url.scheme not in _PORTS or not url.hostname or not mountpoint or port == 0 or url.query or url.fragment:
        # What was given is not repeated: it may have a password.
        text = "ntrip: this is no address of a mount point, as ntrip://user@caster.example.org:2101/MOUNT"
        raise InvalidArgumentError(text, {"field": "ntrip"})
    user = unquote(url.username) if url.username else environment.value(USER_VARIABLE) or "anon"
    password = unquote(url.password) if url.password else environment.value(PASSWORD_VARIABLE) or "password"
    return Caster(url.hostname, port or _PORTS[url.scheme], mountpoint, user, password, url.scheme == "ntrips")
