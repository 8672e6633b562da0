"""Sends setpoints to the autopilot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Setpoint, Snapshot, Takes, VelocitySetpoint
from ual_daemon.flight.policy.dropped_positions import DroppedPositions
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.setpoint_adaptation import adapted

_DUE_SHARE = 0.9
"""An update sends a setpoint if none was sent for this share of the period: a margin for the jitter of the updates."""

LONGEST_BLIND_S = 0.25
"""A backend looks for data every 0.05 s, unless the computer starves it. Where it has not for this long, the autopilot
may be in another mode by now, and what it says waits unread: no setpoint leaves until that was read."""


class SetpointSender:
    """Sends setpoints in the form that the autopilot takes."""

    def __init__(self, backend: Backend, limits: CurrentLimits) -> None:
        self._backend = backend
        self._limits = limits
        self._sent_s = float("-inf")
        self._dropped = DroppedPositions()
        self.on_sent: Callable[[Setpoint], None] | None = None
        """Called with each setpoint that was sent, by the thread that sends it; never blocks."""

    def send_if_due(self, setpoint: Setpoint, snapshot: Snapshot) -> None:
        """Sends a setpoint, unless one was sent within the period of the backend's `setpoint_rate_hz`."""
        if snapshot.time_s - self._sent_s >= _DUE_SHARE / self._backend.info().setpoint_rate_hz:
            self.send(setpoint, snapshot)

    def send(self, setpoint: Setpoint, snapshot: Snapshot) -> None:
        """Sends a setpoint now, unless what the autopilot says is not read; see `LONGEST_BLIND_S`."""
        if snapshot.time_s - snapshot.updated_s > LONGEST_BLIND_S:
            return
        self._sent_s = snapshot.time_s
        if not isinstance(setpoint, VelocitySetpoint):
            info = self._backend.info()
            if info.drops_positions_beyond_fence and self._dropped.has(setpoint.position, snapshot):
                info = replace(info, takes=Takes.VELOCITY)
            setpoint = adapted(setpoint, info, snapshot, self._limits.get)
        self._backend.send(setpoint)
        if self.on_sent is not None:
            self.on_sent(setpoint)
