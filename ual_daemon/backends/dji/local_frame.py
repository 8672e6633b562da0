"""The local frame, which is ours: east, north, up from the first good fix."""

from __future__ import annotations

from ual.geometry import Vector3
from ual_daemon.geodesy import EllipsoidProjection


class DjiLocalFrame:
    """Begins at the first good fix, and stays there. Positions by RTK are used while there are any.

    Where RTK ends, the aircraft's own position goes on from there, without a jump.
    """

    def __init__(self) -> None:
        self.projection: EllipsoidProjection | None = None
        self._rtk: Vector3 | None = None
        self._rtk_s = float("-inf")
        self._offset = Vector3()

    def note_rtk(self, latitude_deg: float, longitude_deg: float, now_s: float, *, is_fixed: bool) -> None:
        """Takes a position by RTK."""
        self._rtk = None
        if is_fixed:
            self._rtk = Vector3(latitude_deg, longitude_deg, 0.0)
            self._rtk_s = now_s

    def position(
        self, latitude_deg: float, longitude_deg: float, altitude_m: float, now_s: float, *, is_good: bool
    ) -> Vector3 | None:
        """Takes the aircraft's own (fused) position. Returns the local one; None before the first good fix."""
        rtk = self._rtk if now_s - self._rtk_s <= RTK_S else None
        if self.projection is None:
            if not is_good:
                return None
            latitude_longitude = (latitude_deg, longitude_deg) if rtk is None else (rtk.x, rtk.y)
            self.projection = EllipsoidProjection(*latitude_longitude, altitude_m)
        own = self.projection.to_local(latitude_deg, longitude_deg, altitude_m)
        if rtk is not None:
            better = self.projection.to_local(rtk.x, rtk.y, altitude_m)
            self._offset = Vector3(better.x - own.x, better.y - own.y, 0.0)
        return own + self._offset


RTK_S = 0.5
"""An older position by RTK is not used."""
