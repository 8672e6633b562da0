"""Watches for collisions."""

from __future__ import annotations

from ual_daemon.backends.airsim.state import AirsimReport

_GROUND_NORMAL_Z = -0.7
"""Downward component of a collision's normal (north, east, down) below which the UAV touches the ground: it stands
there, or lands.
"""
_CONTACT_PAUSE_S = 1.0
"""Seconds without a reported contact after which the next one is another collision: contacts come at each frame."""


class CollisionWatch:
    """Tells new collisions with anything but the ground below."""

    def __init__(self) -> None:
        self._last_s: float | None = None

    def observe(self, report: AirsimReport) -> str:
        """Returns with what the vehicle has just collided; empty if with nothing."""
        collision = report.collision
        touched_s = collision.time_stamp * 1e-9
        last_s, self._last_s = self._last_s, touched_s
        if last_s is None or touched_s <= last_s or collision.normal.z_val < _GROUND_NORMAL_Z:
            return ""  # it may be old where this is the first report
        return "" if touched_s - last_s < _CONTACT_PAUSE_S else collision.object_name or "something"
