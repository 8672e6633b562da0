"""Feeds a board with what the UAVs of the network tell: `ual watch --network` and `ual view --network`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ual.errors import DaemonUnreachableError, InvalidArgumentError
from ual.shared.guard import WorkGuard
from ual_tools.network.joined import label
from ual_tools.watch_board import LOST_UAV_S, Board

if TYPE_CHECKING:
    from ual.network import Network, NetworkUav

_POLL_PERIOD_S = 0.1
_CLOSE_TIMEOUT_S = 2.0


class Feed:
    """Keeps a board up to date. `update` is called by one thread.

    Args:
        network: What is listened to.
        board: Where the samples go.
        say: Takes what appears and vanishes, human-readable.

    """

    def __init__(self, network: Network, board: Board, say: Callable[[str], None]) -> None:
        self._network = network
        self._board = board
        self._say = say
        self._heard_s: dict[str, float] = {}
        self._gone: set[str] = set()

    def update(self) -> None:
        """Takes what is new since the last time."""
        now_s = time.monotonic()
        found = {label(uav): uav for uav in self._network.uavs()}
        self._board.lost_after_s = max((uav.old_after_s for uav in found.values()), default=LOST_UAV_S)
        for name in self._heard_s.keys() - found.keys():  # forgotten, or shown by another name
            del self._heard_s[name]
            self._board.forget(name)
        for name, uav in found.items():
            self._take(name, uav, now_s)

    def _take(self, name: str, uav: NetworkUav, now_s: float) -> None:
        if name not in self._heard_s:
            self._board.add(name)
            if uav.is_contested:
                self._say(f"ual: {name}: another UAV has the name {uav.ns}: give each a name of its own")
        if uav.heard_s > self._heard_s.get(name, float("-inf")):
            self._heard_s[name] = uav.heard_s
            self._board.put(name, uav.telemetry)
        self._note_presence(name, uav, now_s)
        if uav.is_contested:
            self._board.put_error(name, InvalidArgumentError(f"another UAV has the name {uav.ns}"))

    def _note_presence(self, name: str, uav: NetworkUav, now_s: float) -> None:
        if uav.gone_s is None:
            self._gone.discard(name)
        elif name not in self._gone:
            self._gone.add(name)
            since = time.strftime("%H:%M:%S", time.localtime(time.time() - (now_s - uav.gone_s)))
            self._board.put_error(name, DaemonUnreachableError(f"gone from the network since {since}"))
            self._say(f"ual: {name}: gone from the network since {since}")


@contextmanager
def feeding(feed: Feed) -> Iterator[None]:
    """Updates a board repeatedly while the block runs."""
    feed.update()
    is_closing, guard = threading.Event(), WorkGuard("network")

    def follow() -> None:
        while not is_closing.wait(_POLL_PERIOD_S):
            guard.contain(feed.update)

    thread = threading.Thread(target=follow, name="ual network", daemon=True)
    thread.start()
    try:
        yield
    finally:
        is_closing.set()
        thread.join(_CLOSE_TIMEOUT_S)
