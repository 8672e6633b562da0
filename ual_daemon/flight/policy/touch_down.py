"""Whether a UAV that its autopilot calls landed stands on the ground: one disarmed in the air is called so, too."""

from __future__ import annotations

from ual.types import State
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.state import Estimate

STANDING_TIME_S = 0.4
"""Seconds after which a UAV without its motors falls at 4 m/s."""
STANDING_SPEED_M_S = 1.0
"""Speed in m/s below which a UAV may stand on the ground."""
_WITHOUT_VELOCITY_S = 2.0
"""Seconds for which a velocity is awaited."""
_LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)


class TouchDown:
    """The touch-down of one landing. Only the update thread calls it."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def has_landed(self, snapshot: Snapshot, estimate: Estimate) -> bool:
        """Takes an update. Returns whether it stands on the ground, by the autopilot's word and by its velocity."""
        if estimate.state not in _LANDED:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = snapshot.time_s
        velocity = snapshot.motion.velocity
        if velocity is None or velocity.time_s - self._since_s < STANDING_TIME_S:
            return snapshot.time_s - self._since_s >= _WITHOUT_VELOCITY_S
        if abs(velocity.value.linear.z) > STANDING_SPEED_M_S:
            self._since_s = None
            return False
        return True
