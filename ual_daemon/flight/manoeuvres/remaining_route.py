"""Checks that the rest of a way stays inside a geofence that has changed, a part at each update."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.course import CourseProgress
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.frames.fence import Exit
from ual_daemon.tracker.references import measured_motion

_POINTS_AT_ONCE = 40
"""Points that are checked at each update, the next ones first: 2 ms at most. They are farther ahead than any stop
takes.
"""


class RemainingRoute:
    """Rest of one route that is still to be checked."""

    def __init__(
        self, what: str, flown: CourseProgress, limits: Limits, geofence: GeofencePolicy, snapshot: Snapshot
    ) -> None:
        """Raises `WrongStateError` if it is not known where the geofence lies."""
        self._what, self._geofence = what, geofence
        self._fence = geofence.fence(snapshot)
        here = measured_motion(snapshot).position
        self._points = geofence.outline(flown.trajectory, flown.time_s, here, limits, snapshot)
        self._last = next(self._points)
        self.is_over = False
        """Whether all of it was checked."""

    def require_inside(self, snapshot: Snapshot) -> None:
        """Checks the next part.

        Raises:
            GeofenceError: It leads out of the geofence.

        """
        found = self._exit()
        if found is not None:
            self.is_over = True
            raise self._geofence.exit_error(self._what, found, snapshot)

    def _exit(self) -> Exit | None:
        if not self._fence.is_inside(self._last):
            return self._fence.exit(self._points_until_inside())
        part = [self._last, *islice(self._points, _POINTS_AT_ONCE)]
        self.is_over = len(part) <= _POINTS_AT_ONCE
        self._last = part[-1]
        return self._fence.exit(part)

    def _points_until_inside(self) -> Iterator[Vector3]:
        """Yields the points up to the first one inside; all if there is none. After that it must stay in."""
        yield self._last
        for point in self._points:
            self._last = point
            yield point
            if self._fence.is_inside(point):
                return
        self.is_over = True
