"""Who is on the network: from tokens and reports to UAVs. Pure: the time is given, and nothing is sent.

A process counts as present by its liveliness token alone. What it tells is taken only while it is present, and only of
UAVs for which its key says that it may speak. Two processes that tell of one name are told apart.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field

from ual.discovery import natural_order
from ual.network import keys
from ual.network.keys import Source
from ual.network.values import NetworkUav, Report, Teller, UavReport, old_after_s

KEEP_GONE_S = 600.0
"""How long a UAV whose daemon is gone is kept: it may still be in the air."""
MOST_PROCESSES = 4096
MOST_UAVS = 20_000
"""Of one process."""


@dataclass(slots=True)
class _Told:
    report: UavReport
    heard_s: float


@dataclass(slots=True)
class _Process:
    """What is known of one process."""

    gone_s: float | None = None
    heard_s: float = 0.0
    teller: Teller | None = None
    most_at_once: int = 1
    uavs: dict[str, _Told] = field(default_factory=dict)

    @property
    def is_complete(self) -> bool:
        """Whether it has told of all its UAVs."""
        return self.teller is not None and len(self.uavs) >= min(self.teller.uav_count, MOST_UAVS)

    def is_silent(self, now_s: float) -> bool:
        """Whether it is said to be there, but tells nothing any more."""
        teller = self.teller
        return self.gone_s is None and teller is not None and now_s - self.heard_s > old_after_s(teller.rate_hz)


class Roster:
    """The UAVs of a site. One thread at a time.

    Args:
        drop: Is called with the reason for whatever is dropped, human-readable.

    """

    def __init__(self, drop: Callable[[str], None]) -> None:
        self._drop = drop
        self._processes: dict[Source, _Process] = {}
        self._unannounced: set[Source] = set()

    def on_alive(self, source: Source, now_s: float) -> None:
        """Takes note that a process is there."""
        self._forget(now_s)
        self._unannounced.discard(source)
        process = self._processes.get(source)
        if process is not None:
            process.gone_s = None  # the network to it was cut
        elif len(self._processes) < MOST_PROCESSES:
            self._processes[source] = _Process()
        else:
            self._drop(f"more than {MOST_PROCESSES} daemons: {source.publisher} is not shown")

    def on_gone(self, source: Source, now_s: float) -> None:
        """Takes note that a process is not there any more. Its UAVs are kept, as gone since now."""
        process = self._processes.get(source)
        if process is not None and process.gone_s is None:
            process.gone_s = now_s

    def on_report(self, source: Source, report: Report, now_s: float) -> None:
        """Takes what a process tells."""
        process = self._processes.get(source)
        if process is None or process.gone_s is not None:
            if len(self._unannounced) < MOST_PROCESSES:
                self._unannounced.add(source)
            return
        process.teller, process.heard_s = report.teller, now_s
        process.most_at_once = max(process.most_at_once, len(report.uavs))
        for uav in report.uavs:
            if not keys.speaks_for(source.publisher, uav.ns):
                self._drop(f"{source.publisher} tells of {uav.ns}, for which it may not speak: dropped")
            elif uav.ns in process.uavs or len(process.uavs) < MOST_UAVS:
                process.uavs[uav.ns] = _Told(uav, now_s)

    def pieces(self, source: Source) -> int | None:
        """Returns in how many reports a process tells of all its UAVs once; None where that is not known yet."""
        process = self._processes.get(source)
        if process is None or process.teller is None:
            return None
        return max(1, -(-process.teller.uav_count // process.most_at_once))

    def is_doubtful(self, now_s: float) -> bool:
        """Whether signs of life and reports contradict each other: who is there must be asked.

        After a router was started again, Zenoh sometimes keeps a sign of life from those who listened before.
        """
        return bool(self._unannounced) or any(each.is_silent(now_s) for each in self._processes.values())

    def on_answer(self, present: Collection[Source], now_s: float) -> None:
        """Takes the answer to the question who is there."""
        for source in self._unannounced - set(present):
            self._drop(f"{source.publisher} tells of UAVs, but shows no sign of life: dropped")
        self._unannounced.clear()
        for source, process in self._processes.items():
            if source not in present and process.is_silent(now_s):
                process.gone_s = now_s
        for source in present:
            self.on_alive(source, now_s)

    @property
    def is_complete(self) -> bool:
        """Whether each process that is there has told of all its UAVs. None may have been heard yet: that is not so."""
        there = [each for each in self._processes.values() if each.gone_s is None]
        return bool(there) and all(each.is_complete for each in there)

    def uavs(self) -> tuple[NetworkUav, ...]:
        """Returns all UAVs by name and number. One name is there more than once where several daemons tell of it."""
        names: dict[str, list[NetworkUav]] = {}
        for source, process in self._processes.items():
            for ns in process.uavs:
                names.setdefault(ns, []).append(_uav(source, process, ns))
        return tuple(uav for ns in sorted(names, key=natural_order) for uav in _of_one_name(names[ns]))

    def called(self, ns: str) -> tuple[NetworkUav, ...]:
        """Returns the UAVs of a name: several, if several daemons tell of it."""
        found = [_uav(source, each, ns) for source, each in self._processes.items() if ns in each.uavs]
        return tuple(_of_one_name(found))

    def _forget(self, now_s: float) -> None:
        """Forgets the processes that are gone for long."""
        for source, each in list(self._processes.items()):
            if each.gone_s is not None and now_s - each.gone_s >= KEEP_GONE_S:
                del self._processes[source]


def _uav(source: Source, process: _Process, ns: str) -> NetworkUav:
    told, teller = process.uavs[ns], process.teller
    assert teller is not None
    return NetworkUav(
        ns, source.site, source.publisher, source.instance, told.report, teller, told.heard_s, process.gone_s
    )


def _of_one_name(found: Iterable[NetworkUav]) -> list[NetworkUav]:
    """Returns those that are there, as contested if they are several; else the one that was there last."""
    by_age = sorted(found, key=lambda each: each.teller.started_s)
    # A daemon that was started again at the same place is the same UAV, though the one before still counts as there.
    present = list({_place(each): each for each in by_age if each.gone_s is None}.values())
    if len(present) > 1:
        return [_contested(each) for each in present]
    return present or sorted(by_age, key=lambda each: each.gone_s or 0.0)[-1:]


def _place(uav: NetworkUav) -> tuple[object, ...]:
    return uav.publisher, uav.teller.computer_id, uav.addresses


def _contested(uav: NetworkUav) -> NetworkUav:
    return NetworkUav(
        uav.ns, uav.site, uav.publisher, uav.instance, uav.report, uav.teller, uav.heard_s, is_contested=True
    )
