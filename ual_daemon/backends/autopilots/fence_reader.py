"""Reads the autopilot's own fence from its parameters, and logs once what was found."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from ual_daemon import logs
from ual_daemon.backends.autopilots.autopilot import Autopilot
from ual_daemon.backends.values import NO_FENCE, OwnFence

_log = logging.getLogger(__name__)


class FenceReader:
    """The fence by the newest `parameters`, which their owner fills. Belongs to the thread that receives."""

    def __init__(self, autopilot: Autopilot, parameters: Mapping[str, float]) -> None:
        self._autopilot = autopilot
        self._parameters = parameters
        self._is_enabled = False
        self._fence = NO_FENCE
        self.limits: OwnFence | None = None
        """The fence, where it limits something."""

    def set_enabled(self, is_enabled: bool) -> None:
        """Takes whether the fence is switched on, by the newest SYS_STATUS."""
        if is_enabled is not self._is_enabled:
            self._is_enabled = is_enabled
            self.update()

    def update(self) -> None:
        """Reads it anew; to be called when parameters have come."""
        fence = self._autopilot.own_fence(self._parameters, is_enabled=self._is_enabled)
        if fence == self._fence:
            return
        self._fence = fence
        self.limits = fence if fence.limits else None
        limits = ", ".join(f"{each.parameter} {each.value_m:g} m" for each in fence.limits) or "none"
        level = logging.WARNING if fence.is_cut_by_unread else logging.INFO
        remedy = "configure it as the geofence of the vehicle" if fence.is_cut_by_unread else None
        logs.event(_log, level, "autopilot_fence", limits=limits, not_read=fence.unread or None, remedy=remedy)
