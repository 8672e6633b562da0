"""Values that are published over the network, as plain immutable objects."""

from __future__ import annotations

from dataclasses import dataclass, field

from ual.types import Telemetry

LEAST_LATE_S = 2.0
"""A sample is old after two of its periods, but not before this."""


def old_after_s(rate_hz: float) -> float:
    """Returns from which age on a sample that comes at a rate is not the present."""
    return max(LEAST_LATE_S, 2.0 / rate_hz)


@dataclass(frozen=True, slots=True)
class UavReport:
    """Report of a daemon about one UAV.

    `addresses` are where to fly it, the best for other computers first, and `has_tls` whether TLS is spoken there.
    `needed_role` is the role that a caller of another computer needs to fly it; empty: every caller may.
    `is_watch_only`: no caller flies it.
    """

    ns: str
    telemetry: Telemetry
    backend: str = ""
    addresses: tuple[str, ...] = ()
    has_tls: bool = False
    needed_role: str = ""
    is_watch_only: bool = False


@dataclass(frozen=True, slots=True)
class Teller:
    """The process that tells: its version, computer and start (UTC seconds), how often it tells, of how many UAVs."""

    ual_version: str
    host: str
    computer_id: str
    pid: int
    started_s: float
    rate_hz: float
    uav_count: int


@dataclass(frozen=True, slots=True)
class Report:
    """Joint report of one process."""

    teller: Teller
    uavs: tuple[UavReport, ...]


@dataclass(frozen=True, slots=True)
class NetworkUav:
    """A UAV of the network, as it was last announced.

    `telemetry` has what changes: state, place in ``map`` and on Earth, battery, task, health. `publisher` and
    `instance` say which process tells. `heard_s` is when the sample came, and `gone_s` since when its daemon is gone
    (None: it is there), both by `time.monotonic`. `is_contested`: another daemon tells of a UAV with the same name.
    """

    ns: str
    site: str
    publisher: str
    instance: str
    report: UavReport = field(repr=False)
    teller: Teller = field(repr=False)
    heard_s: float
    gone_s: float | None = None
    is_contested: bool = False

    @property
    def telemetry(self) -> Telemetry:
        """Its newest sample."""
        return self.report.telemetry

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of its daemon."""
        return self.report.addresses

    @property
    def old_after_s(self) -> float:
        """Age in seconds from which its sample no longer counts as the present state."""
        return old_after_s(self.teller.rate_hz)

    def is_old(self, now_s: float) -> bool:
        """Returns whether its sample must not be taken for the present; `now_s` by `time.monotonic`."""
        return self.gone_s is not None or now_s - self.heard_s > self.old_after_s

    def described(self) -> str:
        """Returns its name, where it is and its publisher, human-readable."""
        return f"{self.ns} at {', '.join(self.addresses) or 'no address'} on {self.teller.host} ({self.publisher})"
