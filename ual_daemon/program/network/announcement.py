"""Announcement of one UAV in the network, besides its telemetry: where to fly it, and what that takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ual.access.roles import Role
from ual.credentials import is_this_computer
from ual.network.values import UavReport
from ual.types import Telemetry
from ual.wire import network as wire
from ual_daemon.server.addresses import Address

_EVERYWHERE = ("0.0.0.0", "::")  # noqa: S104  compared with, not bound to


@dataclass(frozen=True, slots=True)
class UavAnnouncement:
    """One UAV. `telemetry` returns its newest sample, on any thread."""

    ns: str
    backend: str
    listen: Sequence[Address]
    telemetry: Callable[[], Telemetry]
    has_tls: bool = False
    needs_role: bool = True
    is_watch_only: bool = False

    def report(self, host: str) -> UavReport:
        """Returns what is reported now; `host` is how other computers call this one."""
        return UavReport(
            self.ns,
            wire.small(self.telemetry()),
            self.backend,
            _addresses(self.listen, host),
            self.has_tls,
            Role.PILOT.text if self.needs_role else "",
            self.is_watch_only,
        )


def _addresses(listen: Sequence[Address], host: str) -> tuple[str, ...]:
    """Returns the addresses, those for other computers first, and for one that is all of them the host's."""
    found = [str(Address(host, each.port) if each.host in _EVERYWHERE else each) for each in listen]
    return tuple(sorted(found, key=is_this_computer))
