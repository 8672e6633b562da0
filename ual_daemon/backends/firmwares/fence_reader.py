"""Puts together the autopilot's own fence, from its parameters and its zones, and logs once what was found."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from ual_daemon import logs
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.fence_zones import UNREAD, FoundZones
from ual_daemon.backends.values import NO_FENCE, AutopilotFence

_log = logging.getLogger(__name__)


class FenceReader:
    """The fence by the newest `parameters`, which their owner fills. Belongs to the thread that receives.

    With `awaits_zones` nothing is logged until the zones are known, or until the wait for them is given up. A fence
    whose zones are about to be read is no reason for a warning.
    """

    def __init__(self, autopilot: Autopilot, parameters: Mapping[str, float], *, awaits_zones: bool = False) -> None:
        self._autopilot = autopilot
        self._parameters = parameters
        self._awaits_zones = awaits_zones
        self._is_enabled = False
        self._found = UNREAD
        self._fence = self._logged = NO_FENCE
        self.limits: AutopilotFence | None = None
        """The fence, where it limits something."""

    @property
    def is_applied(self) -> bool | None:
        """Whether the autopilot applies a fence. None while that is not read."""
        needed = (each.name for each in self._autopilot.fence_switches)
        if self._awaits_zones or not all(name in self._parameters for name in needed):
            return None
        return bool(self._fence.limits or self._fence.zones or self._fence.unread)

    def set_enabled(self, is_enabled: bool) -> None:
        """Takes whether the fence is switched on, by the newest SYS_STATUS."""
        if is_enabled is not self._is_enabled:
            self._is_enabled = is_enabled
            self.update()

    def set_zones(self, found: FoundZones) -> None:
        """Takes what was found when its zones were read."""
        self._found = found
        self.stop_waiting()

    def stop_waiting(self) -> None:
        """Takes it that the zones do not come for now. Those that are known stay."""
        self._awaits_zones = False
        self.update()

    def update(self) -> None:
        """Reads it again; to be called when parameters have come."""
        fence = self._autopilot.autopilot_fence(self._parameters, is_enabled=self._is_enabled, found=self._found)
        if fence != self._fence:
            self._fence = fence
            self.limits = fence if fence.limits or fence.zones else None
        if fence != self._logged and not self._awaits_zones:
            self._logged = fence
            _report(fence)


def _report(fence: AutopilotFence) -> None:
    limits = ", ".join(f"{each.parameter} {each.value_m:g} m" for each in fence.limits) or "none"
    level = logging.WARNING if fence.is_cut_by_unread else logging.INFO
    remedy = "configure it as the geofence of the vehicle" if fence.is_cut_by_unread else None
    unread = fence.unread or None
    logs.event(
        _log, level, "autopilot_fence", limits=limits, zones=len(fence.zones) or None, not_read=unread, remedy=remedy
    )
