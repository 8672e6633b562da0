"""Heartbeats: ours, and when to request one of the autopilot's."""

from __future__ import annotations

import math

from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

OWN_HEARTBEAT_S = 1.0
HEARTBEAT_REQUEST_S = 0.1
"""The shortest interval between two requests for a heartbeat."""
HEARTBEAT_LATE_S = 1.1
"""A heartbeat that is this late was lost. On a bad link three in a row can be, and nothing else shows whether the
autopilot is armed."""


def own_heartbeat() -> Message:
    """Returns ours: an onboard computer, which PX4 counts as present, but never as a ground station."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


class HeartbeatWatchdog:
    """Decides when a heartbeat is requested: when one is late, and when its content matters at once."""

    def __init__(self) -> None:
        self.is_wanted = False
        """Whether one was asked for by `want` and is not requested yet."""
        self._heartbeat_s = -math.inf
        self._next_request_s = -math.inf

    def want(self) -> None:
        """Asks for a request as soon as `HEARTBEAT_REQUEST_S` allows it."""
        self.is_wanted = True

    def on_heartbeat(self, now_s: float) -> None:
        """Takes note of the autopilot's heartbeat."""
        self._heartbeat_s = now_s

    def is_late(self, now_s: float) -> bool:
        """Returns whether the autopilot's heartbeat should have come by now."""
        return now_s - self._heartbeat_s > HEARTBEAT_LATE_S

    def take_request(self, now_s: float, *, is_needed: bool) -> bool:
        """Returns whether to request one now, where `is_needed` or wanted, and counts it as requested."""
        if not (self.is_wanted or is_needed) or now_s < self._next_request_s:
            return False
        self.is_wanted = False
        self._next_request_s = now_s + HEARTBEAT_REQUEST_S
        return True
