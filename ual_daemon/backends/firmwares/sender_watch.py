"""Notices that another program sends setpoints to the same autopilot."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from ual.geometry import Vector3
from ual_daemon.backends.firmwares.setpoint_monitor import Sent, SetpointMonitor
from ual_daemon.backends.values import Control, LandedState, Mode, PositionSetpoint, Sample

OWN_SILENCE_S = 4.0
"""Seconds without a message of ours after which no target of the autopilot is ours any more. ArduPilot ends the last
one by itself after GUID_TIMEOUT (3 s), and PX4 leaves OFFBOARD without setpoints (COM_OF_LOSS_T, 1 s).
"""
MOVED_M, MOVED_M_S = 0.5, 0.3
"""A target that changes by more than this was sent by somebody. It shows the last one exactly, without noise."""
STRANGE_M, STRANGE_M_S = 1.0, 0.5
"""A target this far from all that we have sent lately is another program's: each autopilot shows the last one exactly.
"""
EXTRAPOLATION_S = 3.0
"""Most seconds for which ArduPilot moves a position on with its velocity until the next one comes (GUID_TIMEOUT)."""
STRANGE_COUNT, STRANGE_S = 2, 3.0
"""Foreign targets that prove another sender, and the seconds within which they count, while we send."""
LEAST_TARGET_GAP_S = 0.1
"""Least seconds between two that count. PX4 moves a setpoint of ours as its estimate is reset, until our next one."""
AUTOPILOT_SILENCE_S = 2.0
"""Seconds of the autopilot's silence after which it may show for `OWN_SILENCE_S` what we had sent before, and what
a link that was stuck delivers late.
"""
LEAST_SENDING_TIME_S = 0.5
"""Seconds of our sending from which a target is assessed by ours: an older one is from before."""
_SILENT = "another program sends setpoints: {}"
_REFERENCES = Control.REFERENCES
_IN_AIR = LandedState.IN_AIR
"""As names of the module: Python looks up a member of an enumeration by a call, and each update would pay."""


class SenderWatch:
    """Watches one autopilot for the setpoints of others. Belongs to the thread that receives.

    `stays_without_setpoints` is whether the autopilot stays in the mode that takes setpoints when none come; where it
    leaves that mode, its staying there shows another program.
    """

    def __init__(self, sent: SetpointMonitor, *, stays_without_setpoints: bool) -> None:
        self._sent = sent
        self._stays = stays_without_setpoints
        self.round_trip_s = 0.0
        """Seconds after which a setpoint of ours can show in a target, by the link."""
        self._flies_since_s = math.inf
        self._received_s = -math.inf
        self._back_s = -math.inf
        """Time of its return after a silence."""
        self._target: _ReportedTarget | None = None
        self._strange_s: deque[float] = deque(maxlen=STRANGE_COUNT)
        self._doubted_s = math.inf
        """Time of the last of enough foreign targets, while the mode in which it was flown is not known yet."""
        self._found = ""
        self._found_s = -math.inf

    def on_target(self, position: Vector3, velocity: Vector3, now_s: float, *, has_position: bool) -> None:
        """Takes the target that the autopilot flies to, in the local frame; what it does not have may be NaN."""
        has_velocity = all(map(math.isfinite, (velocity.x, velocity.y, velocity.z)))
        new = _ReportedTarget(now_s, _finite(position), _finite(velocity), has_position, has_velocity)
        old, self._target = self._target, new
        self._note_received(now_s)
        if old is None or now_s < self._flies_since_s or now_s - self._back_s <= OWN_SILENCE_S:
            return
        silent_s = now_s - self._sent.last_s
        if silent_s <= LEAST_SENDING_TIME_S:
            self._judge_during_ours(new)
        elif new.has_jumped_from(old) and self._is_strange(new):
            self._find("the autopilot's target has changed, and UAL has sent none", now_s)
        elif min(silent_s, now_s - self._flies_since_s) > OWN_SILENCE_S and new.has_moved_from(old):
            self._find("the autopilot's target moves, and UAL sends none", now_s)

    def _judge_during_ours(self, target: _ReportedTarget) -> None:
        now_s, round_trip_s = target.time_s, self.round_trip_s
        is_too_early = self._sent.duration_s(now_s) <= LEAST_SENDING_TIME_S + round_trip_s
        if is_too_early or self._sent.last_s - self._flies_since_s <= round_trip_s or not self._is_strange(target):
            return
        if self._strange_s and now_s - self._strange_s[-1] < LEAST_TARGET_GAP_S:
            return
        self._strange_s.append(now_s)
        if len(self._strange_s) == STRANGE_COUNT and now_s - self._strange_s[0] <= STRANGE_S:
            self._doubted_s = min(self._doubted_s, now_s)

    @property
    def wants_mode(self) -> bool:
        """Whether the mode is to be received again: a foreign target may come from a pilot who has taken over."""
        return self._doubted_s < math.inf

    def another(
        self,
        now_s: float,
        armed: Sample[bool] | None,
        mode: Sample[Mode] | None,
        landed: Sample[LandedState] | None,
    ) -> str:
        """Returns what shows another sender, human-readable; empty while nothing does."""
        if mode is not None:
            self._note_received(mode.time_s)
        if not _follows_setpoints(armed, mode, landed):
            self._flies_since_s, self._doubted_s, self._found = math.inf, math.inf, ""
            self._strange_s.clear()
            return ""
        if mode is not None and mode.time_s > self._doubted_s:  # it is still in the mode of our setpoints
            self._find("the autopilot's target is at times one that UAL has not sent", mode.time_s)
            self._doubted_s = math.inf
        self._flies_since_s = min(self._flies_since_s, now_s)
        ours_s = max(self._flies_since_s, self._back_s, self._sent.last_s)
        is_quiet = now_s - ours_s > OWN_SILENCE_S
        stays_s = 0.0 if mode is None else mode.time_s - ours_s  # a link that is lost says nothing of it
        if stays_s > OWN_SILENCE_S and not self._stays:
            self._find("the autopilot stays in a mode that it leaves without setpoints, and UAL sends none", now_s)
        if self._found and not is_quiet and now_s - self._found_s > OWN_SILENCE_S:
            self._found = ""  # UAL flies now, and the other one has been silent
        return self._found

    def _note_received(self, time_s: float) -> None:
        if math.isfinite(self._received_s) and time_s - self._received_s > AUTOPILOT_SILENCE_S:
            self._back_s = time_s
        if time_s > self._received_s:
            self._received_s = time_s

    def _find(self, what: str, now_s: float) -> None:
        self._found, self._found_s = _SILENT.format(what), now_s

    def _is_strange(self, target: _ReportedTarget) -> bool:
        """Returns whether a target is none of those that we have sent lately. Most are the newest one."""
        recent = self._sent.recent
        if not (target.has_position or target.has_velocity) or (recent and _explains(recent[-1][1], target)):
            return False
        since_s, before, has_position = target.time_s - STRANGE_S, None, target.has_position
        for time_s, sent in reversed(tuple(recent)):
            if time_s < since_s:
                break
            if has_position and sent.__class__ is tuple:  # a velocity explains no position
                continue
            if sent is not before or sent is None:  # a hover is the same one repeatedly
                if _explains(sent, target):
                    return False
                before = sent
        return True


class _ReportedTarget(NamedTuple):
    """A target of the autopilot, in the local frame; what it does not have is 0."""

    time_s: float
    position: Vector3
    velocity: Vector3
    has_position: bool
    has_velocity: bool

    def has_jumped_from(self, old: _ReportedTarget) -> bool:
        """Returns whether both are positions, and the velocity does not explain the way between them."""
        distance_m = MOVED_M + 1.5 * (self.time_s - old.time_s) * max(self.velocity.norm(), old.velocity.norm())
        return self.has_position and old.has_position and (self.position - old.position).norm() > distance_m

    def has_moved_from(self, old: _ReportedTarget) -> bool:
        """Returns whether it is another target."""
        is_elsewhere = (self.position - old.position).norm() > MOVED_M
        return is_elsewhere or (self.velocity - old.velocity).norm() > MOVED_M_S


def _explains(sent: Sent, target: _ReportedTarget) -> bool:
    """Returns whether a target may be that of a setpoint: a position as it was sent, or on its way, or a velocity.

    In numbers, without vectors: each target of another program is compared with all that was sent lately.
    """
    if sent is None:
        return True
    if not isinstance(sent, PositionSetpoint):
        if target.has_position:
            return False
        other = target.velocity
        x, y, z = sent if isinstance(sent, tuple) else sent.velocity
        return math.hypot(other.x - x, other.y - y, other.z - z) <= STRANGE_M_S
    if not target.has_position:
        return False
    v = sent.velocity
    own, other = sent.position, target.position
    x, y, z = other.x - own.x, other.y - own.y, other.z - own.z
    speed2 = v.x * v.x + v.y * v.y + v.z * v.z
    if speed2 > 0.0:
        ahead_s = (x * v.x + y * v.y + z * v.z) / speed2
        if ahead_s > 0.0:  # no `min` and `max`, which would take as long as the rest
            ahead_s = ahead_s if ahead_s < EXTRAPOLATION_S else EXTRAPOLATION_S  # noqa: FURB136
            x, y, z = x - v.x * ahead_s, y - v.y * ahead_s, z - v.z * ahead_s
    return math.hypot(x, y, z) <= STRANGE_M


def _finite(vector: Vector3) -> Vector3:
    return Vector3(*(each if math.isfinite(each) else 0.0 for each in (vector.x, vector.y, vector.z)))


def _follows_setpoints(
    armed: Sample[bool] | None, mode: Sample[Mode] | None, landed: Sample[LandedState] | None
) -> bool:
    if armed is None or mode is None or landed is None:
        return False
    return armed.value and mode.value.control is _REFERENCES and landed.value is _IN_AIR
