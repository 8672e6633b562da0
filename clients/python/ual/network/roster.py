"""Roster of the network: from tokens and reports to UAVs. Pure: the time is given, and nothing is sent.

A process counts as present while it shows its liveliness token, and its messages arrive. What it tells is taken only
with the token, and only of UAVs for which its key says that it may speak. Two processes that tell of one name are told
apart. Each limit is one of a publisher, whose name is that of its certificate.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field

from ual.discovery import natural_order
from ual.network import keys
from ual.network.keys import Source
from ual.network.values import NetworkUav, Report, Teller, UavReport, old_after_s
from ual.shared.renamed import renamed

KEEP_GONE_S = 600.0
"""Seconds for which a UAV is kept after its daemon is gone: it may still be in the air."""
MOST_PUBLISHERS = 4096
MOST_OF_PUBLISHER = 8
"""Processes of one publisher, and so of one certificate: no key can take the place of other UAVs."""
MOST_UAVS = 20_000
"""Of one process."""
MUTE_S = 2.0
"""Seconds after which a process that is there and has not announced all its UAVs is not awaited any more."""
UNHEARD_S = 5.0
UNHEARD_PERIODS = 5.0
"""A process that tells nothing for this long counts as gone, whatever its sign of life says: see docs/network.md."""
_FORGET_S = 1.0
_MOST_NAMED_PUBLISHERS = 5


@dataclass(slots=True)
class _RosterReport:
    report: UavReport
    heard_s: float


@dataclass(slots=True)
class _RosterProcess:
    """State of one process: the times of its signs of life, and its reports."""

    since_s: float
    gone_s: float | None = None
    unheard_s: float | None = None
    """Since when it counts as gone because it tells nothing."""
    heard_s: float = 0.0
    teller: Teller | None = None
    most_at_once: int = 1
    uavs: dict[str, _RosterReport] = field(default_factory=dict)

    @property
    def absent_s(self) -> float | None:
        """Since when it is gone; None while it is there, and heard."""
        return self.unheard_s if self.gone_s is None else self.gone_s

    @property
    def has_reported_all(self) -> bool:
        """Whether it has announced all its UAVs."""
        return self.teller is not None and len(self.uavs) >= min(self.teller.uav_count, MOST_UAVS)

    def is_awaited(self, now_s: float) -> bool:
        """Returns whether it is there, and has had no time yet to tell of all its UAVs."""
        return self.gone_s is None and not self.has_reported_all and now_s - self.since_s < MUTE_S

    def is_silent(self, now_s: float) -> bool:
        """Returns whether it is said to be there, but tells nothing any more."""
        teller = self.teller
        return self.absent_s is None and teller is not None and now_s - self.heard_s > old_after_s(teller.rate_hz)

    def update(self, now_s: float) -> bool:
        """Takes note of the time. Returns whether it has become gone by it."""
        if self.absent_s is not None or self.teller is None:
            return False
        if now_s - self.heard_s <= max(UNHEARD_S, UNHEARD_PERIODS / self.teller.rate_hz):
            return False
        self.unheard_s = now_s
        return True


class Roster:
    """The UAVs of a site. One thread at a time.

    Args:
        drop: Is called with the publisher of whatever is dropped, and the reason, human-readable.

    """

    def __init__(self, drop: Callable[[str, str], None]) -> None:
        self._drop = drop
        self._processes: dict[str, dict[Source, _RosterProcess]] = {}
        """By publisher."""
        self._unannounced: dict[str, set[Source]] = {}
        """Sources that report without a sign of life, by publisher."""
        self._forget_due_s = 0.0

    def on_alive(self, source: Source, now_s: float) -> None:
        """Takes note that a process is there."""
        self._announced(source)
        of = self._processes.get(source.publisher, {})
        if (process := of.get(source)) is not None:
            if process.gone_s is not None:
                process.gone_s, process.since_s = None, now_s  # the network to it was cut
            return
        self._forget(now_s)
        if source.publisher not in self._processes and len(self._processes) >= MOST_PUBLISHERS:
            self._drop(source.publisher, f"more than {MOST_PUBLISHERS} daemons: {source.publisher} is not shown")
        elif (since_s := self._make_room(source.publisher, now_s)) is not None:
            self._processes.setdefault(source.publisher, {})[source] = _RosterProcess(since_s)

    def _make_room(self, publisher: str, now_s: float) -> float | None:
        """Makes room for one more process of a publisher: of the one that is gone for longest, or was never received.

        Returns since when the new one counts as there: a publisher with ever new ones is not waited for. None where
        there is no room.
        """
        of = self._processes.get(publisher, {})
        if len(of) < MOST_OF_PUBLISHER:
            return now_s
        if gone := [each for each in of if of[each].gone_s is not None]:
            del of[min(gone, key=lambda source: of[source].gone_s or 0.0)]
            return now_s
        self._drop(publisher, f"{publisher} shows more than {MOST_OF_PUBLISHER} signs of life: not all are shown")
        unheard = [each for each in of if of[each].teller is None]
        return of.pop(unheard[0]).since_s if unheard else None

    def on_gone(self, source: Source, now_s: float) -> None:
        """Takes note that a process is not there any more. Its UAVs are kept, as gone since now."""
        process = self._processes.get(source.publisher, {}).get(source)
        if process is not None and process.gone_s is None:
            process.gone_s = now_s if process.unheard_s is None else process.unheard_s

    def on_report(self, source: Source, report: Report, now_s: float) -> None:
        """Takes what a process tells."""
        process = self._processes.get(source.publisher, {}).get(source)
        if process is None or process.gone_s is not None:
            self._note_unannounced(source)
            return
        process.teller, process.heard_s, process.unheard_s = report.teller, now_s, None
        process.most_at_once = max(process.most_at_once, len(report.uavs))
        for uav in report.uavs:
            if not keys.speaks_for(source.publisher, uav.ns):
                self._drop(
                    source.publisher, f"{source.publisher} tells of {uav.ns}, for which it may not speak: dropped"
                )
            elif uav.ns in process.uavs or len(process.uavs) < MOST_UAVS:
                process.uavs[uav.ns] = _RosterReport(uav, now_s)

    def update(self, now_s: float) -> bool:
        """Takes note of the time. Returns whether a process has become gone by it, because it tells nothing."""
        return [source for source, process in self._all() if process.update(now_s)] != []

    look = renamed(update, "Roster.look")

    def _note_unannounced(self, source: Source) -> None:
        if source.publisher in self._unannounced or len(self._unannounced) < MOST_PUBLISHERS:
            of = self._unannounced.setdefault(source.publisher, set())
            if len(of) < MOST_OF_PUBLISHER:
                of.add(source)

    def _announced(self, source: Source) -> None:
        if (of := self._unannounced.get(source.publisher)) is not None:
            of.discard(source)
            if not of:
                del self._unannounced[source.publisher]

    def _all(self) -> Iterator[tuple[Source, _RosterProcess]]:
        for of in self._processes.values():
            yield from of.items()

    def pieces(self, source: Source) -> int | None:
        """Returns in how many reports a process tells of all its UAVs once; None where that is not known yet."""
        process = self._processes.get(source.publisher, {}).get(source)
        if process is None or process.teller is None:
            return None
        return max(1, -(-process.teller.uav_count // process.most_at_once))

    def doubtful(self, now_s: float) -> frozenset[str]:
        """Returns the publishers whose signs of life and reports contradict each other: the present ones must be
        queried.

        After a router was started again, Zenoh sometimes keeps a sign of life from programs that listened before.
        """
        silent = {source.publisher for source, process in self._all() if process.is_silent(now_s)}
        return frozenset(silent | self._unannounced.keys())

    def on_answer(self, asked: Collection[str], present: Collection[Source], now_s: float) -> None:
        """Takes the answer to the query which of some publishers are present."""
        for publisher in asked:
            for source in self._unannounced.pop(publisher, set()) - set(present):
                self._drop(publisher, f"{source.publisher} tells of UAVs, but shows no sign of life: dropped")
            for source, process in self._processes.get(publisher, {}).items():
                if source not in present and process.is_silent(now_s):
                    process.gone_s = now_s
        for source in present:
            self.on_alive(source, now_s)

    def is_complete(self, now_s: float) -> bool:
        """Returns whether each process that is there has announced all its UAVs, or had the time for it: see `unseen`.

        None may have been received yet: that is not so.
        """
        there = [process for _, process in self._all() if process.gone_s is None]
        return bool(there) and not any(process.is_awaited(now_s) for process in there)

    def is_known(self, ns: str, now_s: float) -> bool:
        """Returns whether a UAV has been announced, and nothing that may speak for it is awaited."""
        return bool(self.called(ns)) and not any(
            process.is_awaited(now_s) and keys.speaks_for(source.publisher, ns) for source, process in self._all()
        )

    def unseen(self) -> tuple[str, ...]:
        """Returns what is there and not shown, human-readable; empty where all that is there has announced its UAVs."""
        mute = {
            source.publisher
            for source, process in self._all()
            if process.gone_s is None and not process.has_reported_all
        }
        named = sorted(mute, key=natural_order)[:_MOST_NAMED_PUBLISHERS]
        texts = [f"{each} shows a sign of life, and has not told of all its UAVs" for each in named]
        return (*texts, f"so do {len(mute) - len(named)} more") if len(mute) > len(named) else tuple(texts)

    def uavs(self) -> tuple[NetworkUav, ...]:
        """Returns all UAVs by name and number. One name is there more than once where several daemons tell of it."""
        names: dict[str, list[NetworkUav]] = {}
        for source, process in self._all():
            for ns in process.uavs:
                names.setdefault(ns, []).append(_uav(source, process, ns))
        return tuple(uav for ns in sorted(names, key=natural_order) for uav in _of_one_name(names[ns]))

    def called(self, ns: str) -> tuple[NetworkUav, ...]:
        """Returns the UAVs of a name: several, if several daemons tell of it."""
        found = [_uav(source, process, ns) for source, process in self._all() if ns in process.uavs]
        return tuple(_of_one_name(found))

    def _forget(self, now_s: float) -> None:
        """Forgets the processes that are gone for long."""
        if now_s < self._forget_due_s:
            return
        self._forget_due_s = now_s + _FORGET_S
        for publisher, of in list(self._processes.items()):
            for source, each in list(of.items()):
                if each.absent_s is not None and now_s - each.absent_s >= KEEP_GONE_S:
                    del of[source]
            if not of:
                del self._processes[publisher]


def _uav(source: Source, process: _RosterProcess, ns: str) -> NetworkUav:
    uav, teller = process.uavs[ns], process.teller
    assert teller is not None
    return NetworkUav(
        ns, source.site, source.publisher, source.instance, uav.report, teller, uav.heard_s, process.absent_s
    )


def _of_one_name(found: Iterable[NetworkUav]) -> list[NetworkUav]:
    """Returns those that are there, as contested if they are several; else the one that was there last."""
    by_age = sorted(found, key=lambda each: each.teller.started_s)
    # A daemon that was started again at the same place is the same UAV, though the one before still counts as there.
    there = (each for each in by_age if each.gone_s is None)
    present = list({(each.publisher, each.teller.computer_id, each.addresses): each for each in there}.values())
    if len(present) > 1:
        return [_contested(each) for each in present]
    return present or sorted(by_age, key=lambda each: each.gone_s or 0.0)[-1:]


def _contested(uav: NetworkUav) -> NetworkUav:
    return NetworkUav(
        uav.ns, uav.site, uav.publisher, uav.instance, uav.report, uav.teller, uav.heard_s, is_contested=True
    )
