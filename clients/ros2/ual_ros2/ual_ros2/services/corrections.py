"""Corrections for the satellite receiver, from a topic to the daemon. It needs no ROS."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import AsyncIterator

import ual
from ual.shared.waiting import ends_within
from ual_ros2.derived.values import corrections_status_fields
from ual_ros2.services.fields import Fields

_log = logging.getLogger(__name__)

SENDER = "ual_ros2"
MOST_WAITING = 100
"""Messages that wait for the daemon; older ones are dropped, because newer ones replace them."""
IDLE_S = 5.0
"""Seconds without a message after which the stream ends, and another program may send."""
AGAIN_S = 1.0
"""Seconds after a refusal without a new attempt; corrections that come meanwhile count as not taken."""


class CorrectionsRelay:
    """Streams what comes to the daemon of one UAV.

    Args:
        loop: On which all but `put` runs.
        uav: The client.
        idle_s: Without a message for so long, the stream ends.

    """

    def __init__(self, loop: asyncio.AbstractEventLoop, uav: ual.aio.Uav, idle_s: float = IDLE_S) -> None:
        self._loop = loop
        self._uav = uav
        self._idle_s = idle_s
        self._waiting: deque[bytes] = deque()
        self._came = asyncio.Event()
        self._refused_s = -AGAIN_S
        self.received_count = 0
        self.not_taken_count = 0
        self.refusal = ""
        """Why the last ones were not taken: reason and words."""

    def put(self, data: bytes) -> None:
        """Takes what a base station has sent. Any thread may call this."""
        self._loop.call_soon_threadsafe(self._take, data)

    async def run(self) -> None:
        """Streams for ever: from the first message on, until none comes any more."""
        self._drop_all()
        while True:
            await self._came.wait()
            try:
                await self._uav.corrections.stream(self._elements(), SENDER)
                self.refusal = ""
            except ual.UalError as error:
                self._on_refusal(error)

    def fields(self) -> Fields:
        """Returns what the node itself knows, for a CorrectionsStatus."""
        return {
            "received_count": self.received_count,
            "not_taken_count": self.not_taken_count,
            "refusal": self.refusal,
        }

    def _take(self, data: bytes) -> None:
        self.received_count += 1
        if self._loop.time() - self._refused_s < AGAIN_S:
            self.not_taken_count += 1
            return
        if len(self._waiting) == MOST_WAITING:
            self._waiting.popleft()
            self.not_taken_count += 1
        self._waiting.append(data)
        self._came.set()

    async def _elements(self) -> AsyncIterator[bytes]:
        """Yields what comes. One that leaves counts as not taken until the next one is asked for."""
        while True:
            if not await ends_within(self._came.wait(), self._idle_s):
                return
            yield self._waiting[0]
            if self._waiting:
                self._waiting.popleft()
            if not self._waiting:
                self._came.clear()

    def _on_refusal(self, error: ual.UalError) -> None:
        text = f"{error.reason}: {error.message}"
        if text != self.refusal:
            _log.warning("%s: corrections are not taken: %s", self._uav.ns, text)
        self.refusal = text
        self._refused_s = self._loop.time()
        self.not_taken_count += len(self._waiting)
        self._drop_all()

    def _drop_all(self) -> None:
        self._waiting.clear()
        self._came.clear()


async def get_status(uav: ual.aio.Uav, corrections: CorrectionsRelay) -> Fields:
    """Returns a CorrectionsStatus, but for its header."""
    return {**corrections_status_fields(await uav.corrections.status()), **corrections.fields()}
