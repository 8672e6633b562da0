"""Sends setpoints to the autopilot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import PositionSetpoint, Setpoint, Snapshot, Takes, VehicleInfo, VelocitySetpoint
from ual_daemon.flight.current_manoeuvre import CurrentManoeuvre
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre
from ual_daemon.flight.policy.dropped_positions import DroppedPositions
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.setpoint_adaptation import WHOLE_MOTION, adapted

_DUE_PERIOD_SHARE = 0.9
"""An update sends a setpoint if none was sent for this share of the period: a margin for the jitter of the updates."""

LONGEST_BLIND_S = 0.25
"""A backend looks for data every 0.05 s, unless the computer starves it. Where it has not for this long, the autopilot
may be in another mode by now, and what it says waits unread: no setpoint leaves until that was read."""


class SetpointSender:
    """Sends the setpoints of what is flown, in the form that the autopilot takes. Any thread may call.

    Threads send without waiting for each other, so the setpoint of one may leave after a newer one of another. The one
    that was late sees this once it has sent, and sends the newer one again. So, when its call returns, what was sent
    last is what was given last.
    """

    def __init__(self, backend: Backend, limits: CurrentLimits, flown: CurrentManoeuvre) -> None:
        self._backend = backend
        self._limits = limits
        self._flown = flown
        self._sent_s = float("-inf")
        self.newest: tuple[Manoeuvre | None, Setpoint | None] = (None, None)
        """Newest setpoint, and its manoeuvre. Set with the lock of what is flown held."""
        self._dropped = DroppedPositions()
        self._whole: VehicleInfo | None = None
        """Properties of the autopilot, if that takes positions with their whole motion, wherever they are."""
        self.on_sent: Callable[[Setpoint], None] | None = None
        """Called with each setpoint that was sent, by the thread that sends it; never blocks."""

    def send_if_due(self, of: Manoeuvre, setpoint: Setpoint, snapshot: Snapshot) -> None:
        """Sends a setpoint, unless one was sent within the period of the backend's `setpoint_rate_hz`."""
        if snapshot.time_s - self._sent_s >= _DUE_PERIOD_SHARE / self._backend.info().setpoint_rate_hz:
            self.send(of, setpoint, snapshot)

    def send(self, of: Manoeuvre, setpoint: Setpoint, snapshot: Snapshot) -> None:
        """Sends a setpoint of a manoeuvre now, unless something else is flown by now, or what the autopilot says is not
        read; see `LONGEST_BLIND_S`.
        """
        if snapshot.time_s - snapshot.updated_s > LONGEST_BLIND_S:
            return
        if not isinstance(setpoint, VelocitySetpoint):
            info = self._backend.info()
            if info is not self._whole:
                setpoint = self._adapted(setpoint, info, snapshot)
        given = (of, setpoint)
        with self._flown.lock:  # so that what was replaced is never the newest
            if self._flown.manoeuvre is not of:
                return
            self.newest = given
        self.send_newest(given, setpoint, snapshot.time_s)

    def _adapted(self, setpoint: PositionSetpoint, info: VehicleInfo, snapshot: Snapshot) -> Setpoint:
        """Returns it as an autopilot takes it; see `adapted`. Keeps the one that takes every position as it is."""
        if info.drops_positions_beyond_fence:
            if self._dropped.has(setpoint.position, snapshot):
                info = replace(info, takes=Takes.VELOCITY)
        elif WHOLE_MOTION in info.takes:
            self._whole = info
        return adapted(setpoint, info, snapshot, self._limits.get)

    def send_newest(self, given: tuple[Manoeuvre, Setpoint], setpoint: Setpoint, now_s: float) -> None:
        """Sends the setpoint that was just made the newest, with the lock of what is flown held."""
        self._sent_s = now_s
        self._backend.send(setpoint)
        if self.on_sent is not None:
            self.on_sent(setpoint)
        if self.newest is not given:
            self._send_newer(given)

    def forget(self) -> None:
        """Forgets what was given last. To be called once no more updates come: it keeps a whole trajectory alive."""
        self.newest = (None, None)

    def _send_newer(self, given: tuple[Manoeuvre | None, Setpoint | None]) -> None:
        """Sends what was given meanwhile, as it may have left before; but not if it is not flown any more."""
        while self.newest is not given:
            given = self.newest
            of, setpoint = given
            if setpoint is None or self._flown.manoeuvre is not of:
                return
            self._backend.send(setpoint)
            if self.on_sent is not None:
                self.on_sent(setpoint)
