"""A packet of the link, for a recording."""

from __future__ import annotations

from typing import NamedTuple


class Packet(NamedTuple):
    """A packet on the link to the autopilot, as it was on the wire.

    `encoding` names the protocol, and `peer` the other end (empty where there is only one). `time_s` is when it was
    received or had left, on the backend's clock, and `utc_s` the same moment as UTC since 1970. Without `data` it says
    that what had arrived was discarded, because the computer had no time for it, with all that may have changed.
    """

    encoding: str
    data: bytes
    is_sent: bool
    peer: str
    time_s: float
    utc_s: float
