"""Refuses what needs memory while little is left, so that the flight keeps what it needs.

gRPC's core and Python's extensions end the process where an allocation fails, with the UAV in the air. So a request is
refused before it is read. What flies or ends a flight is small, and is read always.
"""

from __future__ import annotations

import logging
import math
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, Protocol

from ual.contract.methods import METHODS
from ual.errors import ResourceExhaustedError
from ual_daemon import logs

try:
    import resource
except ImportError:  # pragma: no cover  Windows has no such limits
    resource = None  # type: ignore[assignment]

MOST_REQUEST_BYTES: Final = 4 << 20
"""The longest path that makes sense has some ten thousand waypoints: 1 MB."""
RESERVE_BYTES: Final = 12 << 20
"""Bytes that stay free for the flight and for the connections: 200 of them take 8 MB."""
SMALL_REQUEST_BYTES: Final = 64 << 10
"""Requests up to this size need no memory that counts."""
WORK_FACTOR: Final = 40
"""Memory of a request's values and its plan by its size: 26 MB of memory, 35 MB of addresses for 9,900 waypoints."""

FLIES_ON: Final = frozenset(each.path for each in METHODS.values() if each.flies_on)
"""The methods that are accepted however little memory is left."""

_MEMORY_CHECK_S = 0.1
_PROMISE_S = 5.0
"""Seconds within which the work on a request takes the memory that was promised to it."""
_CGROUPS = Path("/sys/fs/cgroup")
_log = logging.getLogger(__name__)


class RequestReader(Protocol):
    """Reader of the requests for one UAV."""

    @property
    def without_request_count(self) -> int:
        """Requests that may arrive at any moment."""


class Headroom:
    """Memory and addresses that the limits of this process leave free. Any thread may call.

    `free_bytes` looks: infinite where nothing limits the process. For small requests it is asked ten times a second at
    most.
    """

    def __init__(
        self, free_bytes: Callable[[], float] | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._servers: tuple[weakref.ref[RequestReader], ...] = ()
        """Readers of requests in this process. Replaced as a whole: it is gone through without the lock."""
        self._free_bytes = free_bytes or limits_of_this_process()
        self._clock = clock
        self._looked_s = -math.inf
        self._known_free_bytes = math.inf
        self._promises: list[tuple[float, int]] = []
        self._lock = threading.Lock()

    def add(self, server: RequestReader) -> None:
        """Adds a reader of requests in this process, for as long as it lives."""
        with self._lock:
            self._servers = (*(each for each in self._servers if each() is not None), weakref.ref(server))

    def require_room(self, method: str) -> None:
        """Requires room for a request that has not been read yet. Not for those of `FLIES_ON`.

        Raises:
            ResourceExhaustedError: There is none.

        """
        now_s = self._clock()
        if now_s - self._looked_s >= _MEMORY_CHECK_S:
            self._looked_s = now_s
            self._known_free_bytes = self._free_bytes()
        servers = [each() for each in self._servers]
        unread_count = sum(each.without_request_count for each in servers if each is not None)
        self._require(method, self._known_free_bytes, (unread_count + 1) * MOST_REQUEST_BYTES)

    def require_room_to_work(self, method: str, size_bytes: int) -> None:
        """Requires room for what a request of this size, above `SMALL_REQUEST_BYTES`, needs once it is read.

        Raises:
            ResourceExhaustedError: There is none.

        """
        needed_bytes, now_s = WORK_FACTOR * size_bytes, self._clock()
        # The request takes memory by now, and no longer counts as one that may arrive.
        self._looked_s = -math.inf
        with self._lock:  # two at once may not have the same room
            self._promises = [promise for promise in self._promises if now_s - promise[0] < _PROMISE_S]
            self._require(method, self._free_bytes() - sum(promised for _, promised in self._promises), needed_bytes)
            self._promises.append((now_s, needed_bytes))

    def _require(self, method: str, free_bytes: float, needed_bytes: int) -> None:
        if free_bytes - RESERVE_BYTES >= needed_bytes:
            return
        error = ResourceExhaustedError(
            f"{method}: {free_bytes / 1e6:.0f} MB of memory are left to this daemon, which keeps "
            f"{RESERVE_BYTES / 1e6:.0f} MB of them for the flight, and this may need {needed_bytes / 1e6:.0f} MB. Give "
            "the daemon more memory (docs/reference/daemon.md), or send less at once",
            {"limit": str(RESERVE_BYTES), "free": f"{free_bytes:.0f}"},
        )
        logs.refused(_log, method, error)
        raise error


def limits_of_this_process(cgroups: Path = _CGROUPS, own: Path = Path("/proc/self")) -> Callable[[], float]:
    """Returns what looks how many bytes the limit of addresses (`ulimit -v`) and the control groups leave free."""
    groups = _limiting(cgroups, own / "cgroup")

    def free_bytes() -> float:
        return min(_free_addresses(own / "statm"), *(_free_in(group) for group in groups), math.inf)

    return free_bytes


def _free_addresses(statm: Path) -> float:
    if resource is None:
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return math.inf
    try:
        return limit - int(statm.read_bytes().split()[0]) * resource.getpagesize()
    except OSError:
        return math.inf  # a system without /proc


def _limiting(cgroups: Path, own: Path) -> Sequence[Path]:
    """Returns the process's control group and those above it that count memory (version 2 of control groups)."""
    try:
        path = next(line[3:] for line in own.read_text().splitlines() if line.startswith("0::"))
    except (OSError, StopIteration):
        return ()
    group = cgroups / path.lstrip("/")
    return [each for each in (group, *group.parents) if (each / "memory.max").is_file()]


def _free_in(group: Path) -> float:
    try:
        most = (group / "memory.max").read_text().strip()
        if most == "max":
            return math.inf
        used = int((group / "memory.current").read_text())
        # What the kernel only keeps of files that were read or written (recordings), it gives up when it needs room.
        kept = next(
            int(line.split()[1])
            for line in (group / "memory.stat").read_text().splitlines()
            if line.startswith("inactive_file ")
        )
    except (OSError, ValueError, StopIteration):
        return math.inf  # the group has ended, or is another user's
    return int(most) - used + kept


OF_THIS_PROCESS: Final = Headroom()
"""All UAVs of a process share its memory."""
