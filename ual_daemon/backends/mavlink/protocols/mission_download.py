"""Downloads a list of items by the mission protocol.

The number of items is requested, then each item, one at a time. PX4 ends the transfer when it is queried for any other
than the next one or the last again (handle_mission_request_both in its mavlink_mission.cpp). The end is acknowledged.
"""

from __future__ import annotations

from concurrent.futures import Future

from typing_extensions import override

from ual.errors import ResourceExhaustedError
from ual_daemon.backends.firmwares.mission_items import MissionItem, MissionList
from ual_daemon.backends.mavlink.protocols.mission_exchange import (
    ACCEPTED,
    CANCELLED,
    PASSING,
    RESTART_PAUSE_S,
    MissionExchange,
)
from ual_daemon.backends.mavlink.protocols.mission_sender import MissionSender, item_of
from ual_daemon.backends.mavlink.wire.messages import Message

MOST_ITEMS = 3000
"""More than either autopilot keeps."""
TRIES_COUNT = 6
"""Requests of one item without an answer after which the list is requested again. A late request, out of order, may
have ended PX4's transfer, and its word of it was lost.
"""

FIRST_RESTART_PAUSE_S = 0.2
"""The first time from a refusal to the next attempt; each further one is twice as long. Amid an upload of another
station ArduPilot refuses a download, and what that has brought is to be known within a second."""


class MissionDownload(MissionExchange[MissionList]):
    """Downloads a list of up to so many items."""

    def __init__(self, future: Future[MissionList], line: MissionSender, most_items: int = MOST_ITEMS) -> None:
        super().__init__(future, line)
        self._most_items = most_items
        self._count: int | None = None
        self._opaque_id = 0
        self._items: list[MissionItem] = []
        self._tries_count = 0
        """Requests for the awaited item so far."""

    @override
    def on_count(self, message: Message, now_s: float) -> None:
        if self._began_s is None or message.count == self._count:  # the same number is a repeated answer
            return
        if self._count is not None:  # it has changed meanwhile
            self._attempts_count += 1
            self._restart()
            self._transmit(now_s)
        elif message.count > self._most_items:
            self._line.acknowledge(CANCELLED)
            text = f"it has {message.count} items, more than {self._most_items}"
            self.fail(ResourceExhaustedError(text, {"limit": str(self._most_items)}))
        else:
            self._is_paused = False
            self._count, self._opaque_id = message.count, getattr(message, "opaque_id", 0)
            self._go_on(now_s)

    @override
    def on_item(self, message: Message, now_s: float) -> None:
        if self._count is not None and message.seq == len(self._items):
            self._items.append(item_of(message))
            self._go_on(now_s)

    @override
    def on_ack(self, message: Message, now_s: float) -> None:
        if self._began_s is None or message.type == ACCEPTED:
            return
        if message.type in PASSING:
            self._pause(message.type, now_s)
        else:
            # Not acknowledged in turn: PX4 tells the ground station of an acknowledgement that it does not expect.
            self.fail(self._refused(message.type))

    @property
    @override
    def _pause_s(self) -> float:
        return min(RESTART_PAUSE_S, FIRST_RESTART_PAUSE_S * 2.0**self._attempts_count)

    @property
    @override
    def _is_answered(self) -> bool:
        return self._count is not None

    @override
    def withdraw(self) -> None:
        if self._began_s is not None:  # PX4 has the transfer from the first request on
            self._line.acknowledge(CANCELLED)

    @override
    def _send(self) -> None:
        if self._tries_count >= TRIES_COUNT:
            self._attempts_count += 1
            self._restart()
        if self._count is None:
            self._line.request_list()
        else:
            self._tries_count += 1
            self._line.request(len(self._items))

    @override
    def _restart(self) -> None:
        self._count = None
        self._items.clear()
        self._tries_count = 0

    def _go_on(self, now_s: float) -> None:
        self._further_s, self._tries_count = now_s, 0
        if len(self._items) == self._count:
            self._line.acknowledge(ACCEPTED)
            self._end(MissionList(tuple(self._items), self._opaque_id))
        else:
            self._transmit(now_s)
