"""An NTRIP caster as a source of corrections."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from urllib.parse import unquote, urlsplit

from typing_extensions import override

from ual.errors import InvalidArgumentError
from ual.shared import environment
from ual.types import GeoPoint
from ual_tools.rtcm import ntrip_protocol as protocol
from ual_tools.rtcm.ntrip_protocol import Caster, Head, NtripConnection, connected
from ual_tools.rtcm.source import CorrectionsSource, SourceError

USER_VARIABLE, PASSWORD_VARIABLE = "UAL_NTRIP_USER", "UAL_NTRIP_PASSWORD"
GGA_S = 10
"""Seconds between two reports of the UAV's position to a caster that wants it."""
_PORTS = {"ntrip": 2101, "ntrips": 443}
_NMEA_FIELD = 10
"""The field of a line of the caster's table that is 1 where the caster wants to be told the position."""
_MOST_NAMES = 10

Position = Callable[[], GeoPoint | None]
"""Returns where the UAV is; None while that is not known."""


class NtripSource(CorrectionsSource):
    """A mount point of a caster. `position` is told to the caster at once and then each `gga_s`.

    Where that is None, the caster's table says whether it wants to be reported. What the table does not say is told
    where it is known: a caster that computes for a place sends nothing before, and others do not mind.
    """

    def __init__(self, caster: Caster, position: Position, gga_s: int | None = None) -> None:
        self.name = caster.shown
        self._caster = caster
        self._position = position
        self._gga_s = gga_s
        self._is_wanted: bool | None = bool(gga_s) if gga_s is not None else None
        self._has_requested = gga_s is not None

    @override
    def chunks(self) -> Generator[bytes, None, None]:
        if not self._has_requested:
            self._is_wanted, self._has_requested = self._looked_up(), True
        if self._is_wanted and self._position() is None:
            raise SourceError("it wants to know where the UAV is, and that is not known yet")
        for is_version_2 in (True, False):
            with connected(self._caster) as connection:
                connection.ask(self._caster, self._caster.mountpoint, self._gga(), is_version_2=is_version_2)
                if (head := connection.head()) is not None:
                    self._require_data(head, connection)
                    yield from self._with_positions(connection)
                    raise SourceError("the caster has closed the connection")
        raise SourceError("it has closed the connection without an answer")

    def _with_positions(self, connection: NtripConnection) -> Generator[bytes, None, None]:
        """Yields what comes, and tells the caster where the UAV is, whether anything comes or not."""
        due_s = time.monotonic()
        for data in connection.body():
            yield data
            if self._is_wanted is not False and time.monotonic() >= due_s:
                due_s = time.monotonic() + (self._gga_s or GGA_S)
                if sentence := self._gga():
                    connection.tell(sentence)

    def _gga(self) -> str:
        """Returns the sentence with the position; empty where none is wanted or known."""
        point = None if self._is_wanted is False else self._position()
        return "" if point is None else protocol.gga(point, time.time())

    def _looked_up(self) -> bool | None:
        """Returns whether the caster's table says that the mount point wants the position; None where it does not say.

        A table that is forbidden, or lacks the mount point, is none that says so: the mount point itself is asked.
        """
        with connected(self._caster) as connection:
            connection.ask(self._caster, "", "", is_version_2=True)
            head = connection.head()
            if head is None or head.status != protocol.OK:
                return None
            lines = [line for line in connection.table() if line and line[0] == self._caster.mountpoint]
        wanted = {line[_NMEA_FIELD].strip() if len(line) > _NMEA_FIELD else "" for line in lines}
        return {"0": False, "1": True}.get(wanted.pop()) if len(wanted) == 1 else None

    def _require_data(self, head: Head, connection: NtripConnection) -> None:
        """Refuses an answer without corrections: for good, where the caster has no such mount point."""
        if head.is_table or head.status == protocol.MISSING:
            names = sorted({line[0] for line in connection.table() if line})[:_MOST_NAMES] if head.is_table else []
            has = f" (it has {', '.join(names) or 'none'})" if head.is_table else ""
            where = f"{self._caster.host}:{self._caster.port}"
            text = f"ntrip: {where} has no mount point {self._caster.mountpoint}{has}"
            raise InvalidArgumentError(text, {"field": "ntrip"})
        if head.status != protocol.OK:
            who = " (UAL_NTRIP_USER, UAL_NTRIP_PASSWORD)" if head.status in protocol.FORBIDDEN else ""
            raise SourceError(f"it refuses: {head.text[:80]}{who}")


def parse_caster(text: str) -> Caster:
    """Parses ``ntrip://[user[:password]@]host[:port]/mountpoint`` (``ntrips``: with TLS).

    Credentials come from the environment where it is not there, so that no list of processes has it.
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
