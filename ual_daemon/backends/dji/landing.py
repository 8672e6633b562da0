"""Landings that were asked for here: confirmed near the ground, or flown by velocities."""

from __future__ import annotations

import math

from ual.geometry import Pose, Vector3
from ual.types import Limits
from ual_daemon.backends.dji import modes
from ual_daemon.backends.dji.telemetry import Telemetry
from ual_daemon.backends.values import Sample, VelocitySetpoint

_BEGINS_S = 2.5
"""A landing that was accepted shows in the display mode within this time."""
_HEIGHT_S, _MODE_S = 1.5, 1.5
"""With an older height or mode nothing is confirmed."""
_FAST_M_S, _SLOW_M_S = 1.0, 0.5
_SLOW_BELOW_M = 5.0
"""The height above the take-off says little about the ground here: it descends slowly early."""
_POSITION_PER_S = 0.8
_ASIDE_M_S = 1.0
_HEARD_S = 0.5
"""Without a display mode that is younger no velocity is sent: it hovers."""
_SETTLED_M_S, _SETTLED_S = 0.15, 4.0
_STOP_AGAIN_S, _MOST_STOPS = 3.0, 3
_MEASURED_S = 1.0
"""With an older position it is not flown aside, and an older velocity does not show whether it descends."""
_WAITS = "it does not descend any further: land it by hand, as its landing protection may wait for the pilot"


class LandingRequest:
    """A landing by the aircraft itself, which the wrapper has accepted. It is confirmed until it has ended."""

    def __init__(self, accepted_s: float) -> None:
        self._accepted_s = accepted_s
        self._has_begun = False
        self.has_ended = False

    def needs_confirmation(self, telemetry: Telemetry, below_m: float, now_s: float) -> bool:
        """Whether it is to be confirmed now. Notes its end; to be called often."""
        if self.has_ended or now_s - telemetry.mode_s > _MODE_S:
            return False
        is_ours = telemetry.has_authority or not telemetry.wrapper.says_authority
        self._has_begun = self._has_begun or telemetry.is_descending
        is_late = not self._has_begun and now_s - self._accepted_s > _BEGINS_S
        is_over = self._has_begun and not telemetry.is_descending
        self.has_ended = telemetry.is_on_ground or not is_ours or is_over or is_late
        height = telemetry.height
        if self.has_ended or not telemetry.is_landing or height is None:
            return False
        return now_s - height.time_s <= _HEIGHT_S and height.value <= below_m


class Descent:
    """A landing by velocities, straight down, for a wrapper whose own landing blocks it.

    It ends when the motors have stopped or cannot be stopped, or another one flies it.
    """

    def __init__(self, place: Vector3, limits: Limits) -> None:
        self._place = place
        self._fastest_m_s = limits.descent_speed_m_s
        self._descended_s: float | None = None
        self.waits = False
        """Whether it does not descend any more, and has not touched down."""
        self._stops_count = 0
        self._stopped_s = -math.inf

    def has_ended(self, telemetry: Telemetry, now_s: float) -> bool:
        """Whether it is over."""
        if telemetry.is_on_ground:
            return telemetry.flight_status == modes.STOPPED or bool(self.why_motors_run(telemetry, now_s))
        return telemetry.is_authority_known and not telemetry.has_authority

    def why_motors_run(self, telemetry: Telemetry, now_s: float) -> str:
        """Returns why its motors run on the ground and are not stopped any more, for people; empty otherwise."""
        if telemetry.flight_status != modes.ON_GROUND or self._stops_count == 0:
            return ""
        if telemetry.is_authority_lost:
            return "it stands, and others have taken it over: its motors are theirs to stop"
        is_late = self._stops_count >= _MOST_STOPS and now_s - self._stopped_s > _STOP_AGAIN_S
        return "it stands, and its motors do not stop: stop them by hand, or disarm it" if is_late else ""

    def begins_stop(self, telemetry: Telemetry, now_s: float) -> bool:
        """Whether the motors are to be stopped now: again where that failed, but not those of others."""
        if not telemetry.is_on_ground or now_s - self._stopped_s < _STOP_AGAIN_S or self._stops_count >= _MOST_STOPS:
            return False
        self._stops_count, self._stopped_s = self._stops_count + 1, now_s
        return True

    def setpoint(self, telemetry: Telemetry, now_s: float) -> VelocitySetpoint | None:
        """Returns the velocity: down, slower near the ground, and back over the place. None: nothing may be sent."""
        if not telemetry.follows_us(now_s, _HEARD_S):
            return None
        self._watch(telemetry, now_s)
        height = telemetry.height
        is_high = height is not None and now_s - height.time_s <= _HEIGHT_S and height.value > _SLOW_BELOW_M
        speed_m_s = min(self._fastest_m_s, _FAST_M_S if is_high else _SLOW_M_S)
        back = self._back(telemetry.pose, now_s)
        return VelocitySetpoint(Vector3(back.x, back.y, -speed_m_s))

    def _back(self, pose: Sample[Pose] | None, now_s: float) -> Vector3:
        """Returns the velocity back over the place; none where its position is not known."""
        if pose is None or _is_old(pose, now_s):
            return Vector3()
        back = (self._place - pose.value.position) * _POSITION_PER_S
        return back * min(1.0, _ASIDE_M_S / max(back.horizontal_norm(), 1e-9))

    def words(self, telemetry: Telemetry, now_s: float) -> str:
        """Returns what is wrong with it, for people; empty if nothing is."""
        if self.waits:
            return _WAITS
        measured = {"a position": telemetry.pose, "a velocity": telemetry.velocity}
        lacking = " and ".join(name for name, sample in measured.items() if _is_old(sample, now_s))
        return f"it descends without {lacking}: take over where it drifts or stops" if lacking else ""

    def _watch(self, telemetry: Telemetry, now_s: float) -> None:
        velocity = telemetry.velocity
        descends = velocity is None or _is_old(velocity, now_s) or velocity.value.z < -_SETTLED_M_S
        if descends or telemetry.is_on_ground or self._descended_s is None:
            self._descended_s = now_s
        self.waits = now_s - self._descended_s > _SETTLED_S


def _is_old(sample: Sample[Pose] | Sample[Vector3] | None, now_s: float) -> bool:
    return sample is None or now_s - sample.time_s > _MEASURED_S
