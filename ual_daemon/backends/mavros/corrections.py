"""Corrections of satellites through MAVROS' plugin gps_rtk, which sends them to the autopilot as GPS_RTCM_DATA."""

from __future__ import annotations

import base64
import math
from collections import deque
from collections.abc import Callable

from typing_extensions import override

from ual_daemon.backends.engine.loop import Posted
from ual_daemon.backends.offers.corrections import AutopilotCorrections, Injected, WaitingCorrections
from ual_daemon.backends.rosbridge import Message

LONGEST_MESSAGE_BYTES = 720
"""The plugin drops what is longer."""
_FRAGMENT_BYTES = 180
_FIRST_PART_BYTES = 100
MESSAGE_PACE_S = 0.02
"""The shortest interval between two messages of ROS: neither the bridge nor the plugin keeps more than one."""


class MavrosCorrections(AutopilotCorrections):
    """The corrections of one backend. `tick` belongs to the link's thread.

    Args:
        publish: Publishes a message of the topic.
        waits: Says whether one of the topic has not left yet: a newer one would take its place.
        why_not: Returns why nothing may be sent now; empty where it may.
        post: Has something done on the link's thread.
        clock: Returns the time.

    """

    def __init__(
        self,
        publish: Callable[[Message], None],
        waits: Callable[[], bool],
        why_not: Callable[[], str],
        post: Callable[[Posted], None],
        clock: Callable[[], float],
    ) -> None:
        super().__init__()
        self._publish = publish
        self._waits = waits
        self._why_not = why_not
        self._post = post
        self._clock = clock
        self._waiting = WaitingCorrections(LONGEST_MESSAGE_BYTES)
        self._message = b""
        self._pieces: deque[bytes] = deque()
        self._next_s = -math.inf

    @override
    def inject(self, message: bytes) -> None:
        self._post(lambda _: self._waiting.add(message))

    @override
    def injected(self) -> Injected:
        return self._waiting.counts

    @override
    def now_s(self) -> float:
        return self._clock()

    def age_s(self, now_s: float) -> float | None:
        """Returns how long ago the last message left, to 0.1 s; None before the first."""
        left_s = self._waiting.counts.left_s
        return None if left_s is None else round(now_s - left_s, 1)

    def tick(self, now_s: float) -> None:
        """Sends what is due; to be called often."""
        if not (self._pieces or self._waiting.bytes_count):
            return
        if why := self._why_not():
            self._drop(why)
        elif now_s >= self._next_s and not self._waits():
            self._next_s = now_s + MESSAGE_PACE_S
            self._send(now_s)

    def _send(self, now_s: float) -> None:
        if not self._pieces:
            self._message = self._waiting.take() or b""
            self._pieces.extend(pieces(self._message))
        self._publish({"data": base64.b64encode(self._pieces.popleft()).decode()})
        if not self._pieces:
            self._waiting.on_left(self._message, now_s)

    def _drop(self, why: str) -> None:
        if self._pieces:
            self._pieces.clear()
            self._waiting.on_lost(why)
        self._waiting.drop(why)


def pieces(message: bytes) -> list[bytes]:
    """Returns what is published of a message: in one piece, unless it fills two or three of MAVLink's.

    The plugin sends no empty fragment after these, by which ArduPilot would know that they are whole. What is cut
    reaches the receiver as the same bytes in the same order.
    """
    if len(message) in (2 * _FRAGMENT_BYTES, 3 * _FRAGMENT_BYTES):
        return [message[:_FIRST_PART_BYTES], message[_FIRST_PART_BYTES:]]
    return [message]
