"""Says once that UAL has a geofence, and the autopilot none: without UAL nothing keeps the UAV inside."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

from ual_daemon import logs
from ual_daemon.backends.values import VehicleInfo

CHECK_PERIOD_S = 1.0
"""Seconds between two looks until it is known whether the autopilot has a fence."""

_log = logging.getLogger(__name__)


class FenceNotice:
    """Belongs to the thread that updates. `is_needed`: UAL has a polygon of its own, and does not only watch."""

    def __init__(self, info: Callable[[], VehicleInfo], *, is_needed: bool) -> None:
        self._info = info
        self.due_s = -math.inf if is_needed else math.inf
        """Time of the next look. An attribute, as each update asks."""

    def observe(self, now_s: float) -> None:
        """Looks, now and then. To be called at each update."""
        if now_s < self.due_s:
            return
        self.due_s = now_s + CHECK_PERIOD_S
        applies = self._info().applies_fence
        if applies is None:
            return
        self.due_s = math.inf
        if not applies:
            why = "UAL has a geofence, the autopilot applies none: without UAL nothing keeps the UAV inside"
            logs.event(_log, logging.WARNING, "autopilot_lacks_fence", why=why, remedy="ual fence upload")
