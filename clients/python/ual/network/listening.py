"""Listens to the network: which UAVs there are, and how they are."""

from __future__ import annotations

import atexit
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from typing_extensions import Self

from ual import _forks
from ual.errors import DaemonUnreachableError, InvalidArgumentError
from ual.network import keys, settings
from ual.network.followed import Followed, conflict
from ual.network.lost_links import LostLinks
from ual.network.roster import MOST_PUBLISHERS, Roster
from ual.network.session import close_session, forked, has_router, open_session, queue, require, ring
from ual.network.settings import LOOPBACK, NetworkSettings
from ual.network.values import NetworkUav
from ual.shared.guard import WorkGuard
from ual.shared.pauses import GrowingPauses
from ual.wire import network as wire

if TYPE_CHECKING:
    import zenoh

_JOIN_S = 3.0
_LEAST_LISTENING_S = 0.5
"""Seconds within which present daemons announce themselves."""
_ASK_S, _LONGEST_ASK_S, _ANSWER_S = 0.25, 8.0, 2.0
_CLOSE_TIMEOUT_S = 5.0
_MOST_PROBLEMS = 10
"""Of one publisher: none can hide what others do."""
_MOST_QUERIES = 8
"""Publishers of which it is asked one by one. More are asked of with all others."""


class Network:
    """The UAVs of a site, from the construction until `close`. Any thread may call.

    In a forked process nothing is received any more: clients go on with the addresses that were known, and all else
    raises `ClientUnusableError`.

    Args:
        config: A file (`ual.network.settings`), the settings themselves, or ``loopback``: this computer only.
        timeout_s: How long to wait for a router.
        on_problem: Is called with each new reason why something was dropped, human-readable, on a thread of Zenoh's.

    Raises:
        DaemonUnreachableError: No router answers in time.
        InvalidArgumentError: The settings are not valid.
        NotSupportedError: The extra ``network`` is not installed.
        ClientUnusableError: This process was forked from one that had used the network.

    Example:
        >>> with ual.network.Network("farm.yaml") as farm:
        ...     farm.wait_until_complete()
        ...     for uav in farm.uavs():
        ...         print(uav.ns, uav.telemetry.state)

    """

    def __init__(
        self,
        config: NetworkSettings | str | Path = LOOPBACK,
        *,
        timeout_s: float = _JOIN_S,
        on_problem: Callable[[str], None] | None = None,
    ) -> None:
        require("the network", "ual-client[network]")
        self.settings = settings.read(config)
        self._on_problem = on_problem
        self._problems: dict[str, Counter[str]] = {}
        """By publisher."""
        self._changed = threading.Condition()
        self._roster = Roster(self._drop)
        self._is_closed = False
        self._is_parents = False
        self._closing = threading.Event()
        self._guard = WorkGuard("listener")
        self._readers: list[threading.Thread] = []
        self._session = open_session(self.settings, timeout_s)
        self._since_s = time.monotonic()
        atexit.register(self.close)
        _forks.renew_in_child(self)
        try:
            site = self.settings.site
            samples = self._session.declare_subscriber(keys.all_telemetry(site), ring())
            tokens = self._session.liveliness().declare_subscriber(keys.all_alive(site), queue(), history=True)
        except BaseException:
            self.close()
            raise
        # Zenoh's own threads for callbacks would keep a program from ending.
        self._readers = [
            threading.Thread(target=_read, args=reading, name="ual network", daemon=True)
            for reading in ((samples, self._on_samples), (tokens, self._on_tokens))
        ]
        self._readers.append(threading.Thread(target=self._keep_asking, name="ual network", daemon=True))
        for reader in self._readers:
            reader.start()

    def begin_anew(self) -> None:
        """Leaves what listens to the parent in a forked process, and keeps what was known."""
        self._changed = threading.Condition()
        self._is_closed = self._is_parents = True
        atexit.unregister(self.close)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    @property
    def is_connected(self) -> bool:
        """Whether the network is reached. While it is not, all UAVs count as gone; it is joined again by itself."""
        return not self._is_closed and has_router(self._session, self.settings)

    def uavs(self) -> tuple[NetworkUav, ...]:
        """Returns all UAVs by name and number, those that are gone included (for ten minutes).

        A name is there more than once where several daemons tell of it: these are contested.
        """
        self._require_own()
        with self._changed:
            return self._roster.uavs()

    def find(self, ns: str) -> NetworkUav:
        """Returns a UAV by its name, of those that were received until now: see `wait_until_complete`.

        Raises:
            DaemonUnreachableError: There is none.
            InvalidArgumentError: Several UAVs have this name.

        """
        self._require_own()
        found = self._called(ns)
        if not found:
            raise DaemonUnreachableError(f"no UAV {ns} is on the network ({self.described})")
        if len(found) > 1:
            raise InvalidArgumentError(f"ns: {conflict(found)}", {"field": "ns"})
        return found[0]

    def follow(self, ns: str) -> Followed:
        """Returns what says where a UAV is now, at any time; `ual.Uav` and `ual.aio.Uav` use it.

        Where `ns` is empty, it is the only one of the network.
        """
        return Followed(ns, self._called, self.described, partial(self._is_settled, ns), self._names)

    @property
    def problems(self) -> Mapping[str, int]:
        """Dropped messages: the reasons, and their counts."""
        self._require_own()
        with self._changed:
            return {why: count for of in self._problems.values() for why, count in of.items()}

    @property
    def unseen(self) -> Sequence[str]:
        """Human-readable list of what is missing in `uavs`: silent daemons, or no router is reached.

        It is empty where all is seen.
        """
        self._require_own()
        with self._changed:
            found = self._roster.unseen()
        return found if self.is_connected else (f"no router is reached ({self.described})", *found)

    @property
    def described(self) -> str:
        """Human-readable name of the network."""
        where = ", ".join(self.settings.connect) or self.settings.means.value
        return f"site {self.settings.site}, {where}"

    def wait_until_complete(self, timeout_s: float = _JOIN_S) -> bool:
        """Waits until each daemon that is there has announced all its UAVs, or for the whole time where none is there.

        One that is there for 2 s and has not reported is not waited for: `unseen` names it. Returns whether that was so
        in time.
        """
        return self.wait_for(
            lambda _: time.monotonic() - self._since_s >= _LEAST_LISTENING_S and self._is_complete, timeout_s
        )

    def wait_for(self, is_so: Callable[[Self], bool], timeout_s: float) -> bool:
        """Waits until something holds, which is asked after each change. Returns whether it did in time."""
        self._require_own()
        end_s = time.monotonic() + timeout_s
        with self._changed:
            while not is_so(self):
                left_s = end_s - time.monotonic()
                if left_s <= 0.0:
                    return False
                self._changed.wait(min(left_s, _LEAST_LISTENING_S / 5.0))
        return True

    def close(self) -> None:
        """Leaves the network. What was received last stays to be read."""
        if self._is_closed:
            return
        self._is_closed = True
        self._closing.set()
        atexit.unregister(self.close)
        if not self._readers:
            close_session(self._session)
        # One that came back from Zenoh while Python ends would abort the program.
        end_s = time.monotonic() + _CLOSE_TIMEOUT_S
        for reader in self._readers:
            if reader is not threading.current_thread():
                reader.join(max(0.0, end_s - time.monotonic()))

    def _is_settled(self, ns: str) -> bool:
        """Returns whether all that may be this UAV have announced themselves, or have had the time for it."""
        if self._is_parents:
            return True
        now_s = time.monotonic()
        looked_s = now_s - self._since_s
        if looked_s < _LEAST_LISTENING_S:
            return False
        with self._changed:
            is_known = (ns and self._roster.is_known(ns, now_s)) or self._roster.is_complete(now_s)
        return looked_s >= _JOIN_S or is_known

    @property
    def _is_complete(self) -> bool:
        return self._roster.is_complete(time.monotonic())

    def _called(self, ns: str) -> tuple[NetworkUav, ...]:
        with self._changed:
            found = self._roster.called(ns)
        if not found:
            self._require_own()
        return found

    def _names(self) -> frozenset[str]:
        """Returns the names of those that are there."""
        with self._changed:
            return frozenset(uav.ns for uav in self._roster.uavs() if uav.gone_s is None)

    def _require_own(self) -> None:
        if self._is_parents:
            raise forked()

    def _on_token(self, sample: zenoh.Sample) -> None:
        import zenoh

        source = self._source(sample)
        with self._changed:
            if source is not None:
                on_change = self._roster.on_alive if sample.kind == zenoh.SampleKind.PUT else self._roster.on_gone
                on_change(source, time.monotonic())
            self._changed.notify_all()

    def _keep_asking(self) -> None:
        """Queries which publishers are present where signs of life and reports contradict each other."""
        links, pauses = LostLinks(self._session.info.links), _Pauses()
        while not self._closing.wait(_ASK_S):
            self._guard.contain(partial(self._poll, links, pauses))
        close_session(self._session)

    def _poll(self, links: LostLinks, pauses: _Pauses) -> None:
        links.keep()
        now_s = time.monotonic()
        with self._changed:
            if self._roster.update(now_s):
                self._changed.notify_all()
            doubtful = self._roster.doubtful(now_s)
        if publishers := pauses.due(doubtful, now_s):
            self._ask(publishers)

    def _ask(self, publishers: Collection[str]) -> None:
        import zenoh

        site = self.settings.site
        about = (
            [keys.all_alive(site)]
            if len(publishers) > _MOST_QUERIES
            else [keys.all_alive(site, each) for each in publishers]
        )
        try:
            replies = [
                reply
                for each in about
                for reply in self._session.liveliness().get(each, timeout=_ANSWER_S / len(about))
            ]
        except zenoh.ZError:
            return  # closed meanwhile
        found = [self._source(reply.ok) for reply in replies if reply.ok is not None]
        with self._changed:
            self._roster.on_answer(publishers, [each for each in found if each is not None], time.monotonic())
            self._changed.notify_all()

    def _on_tokens(self, samples: Sequence[zenoh.Sample]) -> None:
        for sample in samples:
            self._guard.contain(partial(self._on_token, sample))

    def _on_samples(self, samples: Sequence[zenoh.Sample]) -> None:
        """Takes the newest reports of each process: a listener that is too slow must not show old ones as new."""
        by_source: dict[keys.Source, list[zenoh.Sample]] = {}
        for sample in samples:
            if (source := self._source(sample)) is not None:
                by_source.setdefault(source, []).append(sample)
        for source, waiting in by_source.items():
            with self._changed:
                newest = self._roster.pieces(source) or len(waiting)
            for sample in waiting[-newest:]:
                self._guard.contain(partial(self._on_sample, source, sample))

    def _on_sample(self, source: keys.Source, sample: zenoh.Sample) -> None:
        now_s = time.monotonic()
        try:
            report = wire.report_from_bytes(sample.payload.to_bytes())
        except ValueError as error:
            self._drop(source.publisher, f"{source.publisher} sends what is no report ({error}): dropped")
            return
        with self._changed:
            self._roster.on_report(source, report, now_s)
            self._changed.notify_all()

    def _source(self, sample: zenoh.Sample) -> keys.Source | None:
        source = keys.source_of(str(sample.key_expr))
        if source is None:
            self._drop("", "something was sent under a key that no daemon has: dropped")
        return source

    def _drop(self, publisher: str, why: str) -> None:
        """Counts what was dropped, and says each reason once."""
        with self._changed:
            if publisher not in self._problems and len(self._problems) >= MOST_PUBLISHERS:
                return
            problems = self._problems.setdefault(publisher, Counter())
            is_new = why not in problems
            if is_new and len(problems) >= _MOST_PROBLEMS:
                return
            problems[why] += 1
        if is_new and self._on_problem is not None:
            self._on_problem(why)


class _Pauses:
    """Pauses between questions whether a publisher is there: they grow while the answers settle nothing."""

    def __init__(self) -> None:
        self._of: dict[str, GrowingPauses] = {}

    def due(self, doubtful: Collection[str], now_s: float) -> list[str]:
        """Returns those of which it is to be asked now."""
        if len(self._of) > 2 * MOST_PUBLISHERS:
            self._of.clear()
        due = [
            each for each in doubtful if self._of.setdefault(each, GrowingPauses(_ASK_S, _LONGEST_ASK_S)).is_due(now_s)
        ]
        for each in due:
            self._of[each].failed(now_s)
        return due


def _read(subscriber: zenoh.Subscriber[Any], take: Callable[[Sequence[zenoh.Sample]], None]) -> None:
    """Takes what has come, all at once, until the session is closed."""
    import zenoh

    with suppress(zenoh.ZError):
        for sample in subscriber:
            waiting = [sample]
            while (more := subscriber.try_recv()) is not None:
                waiting.append(more)
            take(waiting)


def discover(config: NetworkSettings | str | Path = LOOPBACK, *, timeout_s: float = _JOIN_S) -> tuple[NetworkUav, ...]:
    """Returns the UAVs that are on the network now; see `Network` for the arguments and what is raised."""
    with Network(config, timeout_s=timeout_s) as network:
        network.wait_until_complete(timeout_s)
        return network.uavs()
