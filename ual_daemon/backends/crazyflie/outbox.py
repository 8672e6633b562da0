"""Queue of packets to send through a driver that blocks."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from ual_daemon.backends.clock import steady_s
from ual_daemon.backends.crazyflie.packets import CrtpPacket

MOST_PACKETS = 64
"""Most packets that wait; of more the oldest are lost."""
OLDEST_PACKET_S = 0.5
"""A packet that had to wait for longer is lost: its sender repeats it, or has given up. A radio that blocks would
else arm, land or stop the motors of a UAV that was told so half a minute ago.
"""
OLDEST_POSE_S = 0.2
"""A pose from outside that had to wait for longer is not sent: the estimator takes it for where it is now."""


class PacketOutbox:
    """Packets in their order, and the newest pose from outside, which is sent when no packet waits. For any thread.

    A newer pose replaces one that has not left. So poses, which come as fast as their source measures, never delay
    anything else, and nothing old leaves after the link has been blocked.
    """

    def __init__(self, now_s: Callable[[], float] = steady_s) -> None:
        self._now_s = now_s
        self._changed = threading.Condition()
        self._packets: deque[tuple[CrtpPacket, float]] = deque(maxlen=MOST_PACKETS)
        self._pose: tuple[CrtpPacket, float] | None = None
        self._is_closed = False

    def put(self, packet: CrtpPacket) -> None:
        """Adds a packet; the oldest is lost if too many wait."""
        with self._changed:
            self._packets.append((packet, self._now_s()))
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
                now_s = self._now_s()
                while self._packets:
                    packet, put_s = self._packets.popleft()
                    if now_s - put_s <= OLDEST_PACKET_S:
                        return packet
                pose, self._pose = self._pose, None
                if pose is not None and now_s - pose[1] <= OLDEST_POSE_S:
                    return pose[0]
                if self._is_closed:
                    return None
