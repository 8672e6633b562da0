"""Position of the autopilot's local frame on Earth, and its validity."""

from __future__ import annotations

import logging
import math

from ual.geometry import Vector3
from ual.types import GeoPoint
from ual_daemon import logs
from ual_daemon.geodesy import Projection

_log = logging.getLogger(__name__)

ORIGIN_TOLERANCE_M = 0.5
"""A recorded flight of ArduPilot differs by 0.014 m at most; both positions are of the same estimate."""
_DISTANCE_SHARE = 1e-4
"""The part of the distance from the origin that is added to it, for projections that differ a little."""
_LONGEST_POSITION_GAP_S = 0.3
"""Positions that are farther apart in time are not compared."""
_ACCELERATION_M_S2 = 5.0
_CONTRARY_POSITIONS_COUNT = 2
"""Consecutive positions that must contradict the origin: one of them may have been lost or have come late."""


class LocalOrigin:
    """The origin of the local frame on Earth (GPS_GLOBAL_ORIGIN), checked by the positions that come all the time.

    PX4 sends its origin only once and on a change, which a link may lose. Until the new one has come, every place on
    Earth would be wrong by as much as it has moved. But both positions, the local and that on Earth, come all the time
    and are of the same estimate. Where they contradict the origin, it is not `projection` any more. Not thread-safe.
    """

    def __init__(self) -> None:
        self._origin: Projection | None = None
        self._newest: tuple[int, Vector3, Vector3] | None = None
        self._doubts_count = 0
        self._doubted = logs.RecurringEvent(_log, logging.WARNING, "origin_doubted")
        self.is_wanted = False
        """Whether the origin should be requested now. The caller sets this back."""

    @property
    def projection(self) -> Projection | None:
        """The projection at the origin; None while it is not known."""
        return None if self._doubts_count >= _CONTRARY_POSITIONS_COUNT else self._origin

    def on_origin(self, origin: Projection) -> None:
        """Takes the origin that the autopilot sends. One that is contradicted is not believed for being repeated."""
        if origin != self._origin:  # else it stays the same object
            self._origin, self._doubts_count = origin, 0

    def on_position(self, boot_ms: int, position: Vector3, velocity: Vector3) -> None:
        """Takes a local position, at a time since boot."""
        self._newest = (boot_ms, position, velocity)

    def on_geo(self, boot_ms: int, point: GeoPoint) -> None:
        """Takes a position on Earth, at a time since boot."""
        newest, origin = self._newest, self._origin
        if newest is None or origin is None:
            return
        passed_s = (boot_ms - newest[0]) / 1000.0
        if abs(passed_s) > _LONGEST_POSITION_GAP_S:
            return
        # In plain numbers: 50 come each second.
        _, p, v = newest
        there = origin.to_local(point.latitude_deg, point.longitude_deg, origin.altitude_amsl_m)
        off_m = math.hypot(there.x - p.x - v.x * passed_s, there.y - p.y - v.y * passed_s)
        far_m = math.hypot(p.x, p.y, p.z)
        if off_m <= ORIGIN_TOLERANCE_M + _DISTANCE_SHARE * far_m + _ACCELERATION_M_S2 / 2 * passed_s * passed_s:
            self._doubts_count = 0
            return
        self._doubts_count += 1
        if self._doubts_count == _CONTRARY_POSITIONS_COUNT:
            self._doubted.note(boot_ms / 1000.0, why="its positions contradict its origin on Earth")
        self.is_wanted = self._doubts_count >= _CONTRARY_POSITIONS_COUNT
