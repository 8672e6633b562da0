"""Queue of packets to send through a driver that blocks."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from ual_daemon.backends.clock import steady_s
from ual_daemon.backends.crazyflie.packets import CrtpPacket

MOST_PACKETS = 64
"""Most packets that wait; more are lost."""
OLDEST_POSE_S = 0.2
"""A pose from outside that had to wait for longer is not sent: the estimator takes it for where it is now."""


class PacketOutbox:
    """Packets in their order, and the newest pose from outside, which is sent when no packet waits. For any thread.

    A newer pose replaces one that has not left. So poses, which come as fast as their source measures, never delay
    anything else, and no old one leaves after the link has been blocked.
    """

    def __init__(self, now_s: Callable[[], float] = steady_s) -> None:
        self._now_s = now_s
        self._changed = threading.Condition()
        self._packets: deque[CrtpPacket] = deque()
        self._pose: tuple[CrtpPacket, float] | None = None
        self._is_closed = False

    def put(self, packet: CrtpPacket) -> None:
        """Adds a packet; it is lost if too many wait."""
        with self._changed:
            if len(self._packets) < MOST_PACKETS:
                self._packets.append(packet)
                self._changed.notify()

    def put_pose(self, packet: CrtpPacket) -> None:
        """Replaces the pose that is to be sent."""
        with self._changed:
            self._pose = packet, self._now_s()
            self._changed.notify()

    def close(self) -> None:
        """Ends `take` once the packets that wait were taken."""
        with self._changed:
            self._is_closed, self._pose = True, None
            self._changed.notify()

    def take(self) -> CrtpPacket | None:
        """Blocks until there is something to send; returns None at the end."""
        with self._changed:
            while True:
                self._changed.wait_for(lambda: self._packets or self._pose is not None or self._is_closed)
                if self._packets:
                    return self._packets.popleft()
                pose, self._pose = self._pose, None
                if pose is not None and self._now_s() - pose[1] <= OLDEST_POSE_S:
                    return pose[0]
                if pose is None:  # closed
                    return None
