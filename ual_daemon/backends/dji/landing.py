"""Landings that were requested here: near the ground the aircraft waits for their confirmation."""

from __future__ import annotations

from ual_daemon.backends.dji.telemetry import DjiTelemetry

_LANDING_BEGIN_S = 2.5
"""A landing that was accepted shows in the display mode within this time."""
_HEIGHT_S, _MODE_S = 1.5, 1.5
"""With an older height or mode nothing is confirmed."""


class LandingRequest:
    """A landing by the aircraft itself, which the wrapper has accepted. It is confirmed until it has ended."""

    def __init__(self, accepted_s: float) -> None:
        self._accepted_s = accepted_s
        self._has_begun = False
        self.has_ended = False

    def needs_confirmation(self, telemetry: DjiTelemetry, below_m: float, now_s: float) -> bool:
        """Returns whether it is to be confirmed now. Notes its end; to be called often."""
        if self.has_ended or now_s - telemetry.mode_s > _MODE_S:
            return False
        is_ours = telemetry.has_authority or not telemetry.wrapper.says_authority
        self._has_begun = self._has_begun or telemetry.is_descending
        is_late = not self._has_begun and now_s - self._accepted_s > _LANDING_BEGIN_S
        is_over = self._has_begun and not telemetry.is_descending
        self.has_ended = telemetry.is_on_ground or not is_ours or is_over or is_late
        height = telemetry.height.sample
        if self.has_ended or not telemetry.is_landing or height is None:
            return False
        return now_s - height.time_s <= _HEIGHT_S and height.value <= below_m
