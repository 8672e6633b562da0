"""Poses of the UAV that are measured from outside (motion capture, vision): checked here, used by the autopilot."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable
from dataclasses import replace

from ual.errors import UalError
from ual.geometry import Vector3
from ual.types import Capability, ExternalPose
from ual_daemon import logs, validation
from ual_daemon.backends import values
from ual_daemon.backends.base import Backend
from ual_daemon.flight.external_silence import ExternalSilence
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.vehicle.pose_gate import POSE_GAP_S, Drop, PoseGate
from ual_daemon.vehicle.pose_sources import PoseSources
from ual_daemon.vehicle.preconditions import Preconditions

_log = logging.getLogger(__name__)

CONTINUED_STREAM_S = 0.5
"""A pose that a caller gives within this time of its last one belongs to a stream; the client has the same."""
_MOST_STD_DEV_VALUE = 1000.0
_SPEED_FACTOR = 2.0
"""By wind and in braking a UAV is faster than the limits with which the autopilot flies."""
_SPEED_MARGIN_M_S = 3.0
"""By how much it may be faster than its newest velocity, which is a moment old."""
_VELOCITY_S = 0.5
"""An older velocity of the autopilot says nothing."""
_STEPS_S = 1.0
"""Seconds between two log lines about steps."""
_NAME = "set_external_pose"
_SIMULATED = "simulated time is not that of your clock: give no stamp (0), and it counts as measured just now"
_TOO_SOON = Drop("it comes too soon after the one before", f"at most {1.0 / POSE_GAP_S:g} a second are passed on")


class ExternalPoses:
    """The poses from outside of one UAV. Any thread may call."""

    def __init__(
        self,
        backend: Backend,
        resolver: FrameResolver,
        preconditions: Preconditions,
        silence: ExternalSilence,
        on_moved: Callable[[float], None],
    ) -> None:
        """`on_moved` is called with the present time when the source has moved: the position will jump."""
        self._on_moved = on_moved
        self._backend = backend
        self._resolver = resolver
        self._preconditions = preconditions
        self._silence = silence
        self._gate = PoseGate() if backend.simulation() is None else PoseGate(_SIMULATED)
        self._sources = PoseSources()
        self._stepped_s = -math.inf
        self._lock = threading.Lock()

    def set(self, measured: ExternalPose) -> str:
        """Gives the autopilot a pose. Returns why it was dropped (a jump), or an empty text.

        Raises:
            UalError: As `ual.interface.Uav.set_external_pose`, also for a pose that is old.

        """
        return self._on_pose(measured, is_stream=False)

    def offer(self, measured: ExternalPose) -> str:
        """Gives the autopilot a pose of a stream. Returns why it was dropped (also for its age), or an empty text.

        Raises:
            UalError: As `set`, but not for a pose that is old.

        """
        return self._on_pose(measured, is_stream=True)

    def _on_pose(self, measured: ExternalPose, *, is_stream: bool) -> str:
        try:
            self._preconditions.require_flying_allowed(_NAME)
            self._preconditions.require_capability(Capability.EXTERNAL_POSE, _NAME)
            drop = self._pass_on(measured, is_stream=is_stream)
        except UalError as error:
            self._preconditions.log_refusal(_NAME, error)
            self._silence.dropped(self._backend.clock.now_s(), str(error))
            raise
        if drop is None:
            return ""
        if drop is not _TOO_SOON:
            logs.event(_log, logging.WARNING, "external_pose_dropped", why=drop.why, detail=drop.detail)
        return str(drop)

    def _pass_on(self, measured: ExternalPose, *, is_stream: bool) -> Drop | None:
        """Gives the backend a valid pose. Returns why it did not."""
        now_s = self._backend.clock.now_s()
        local = self._to_local(measured, now_s)
        velocity = self._velocity()
        with self._lock:
            self._sources.on_pose(logs.caller_text(), now_s)
            resets_count = self._gate.resets_count
            drop = self._judge(local, now_s, velocity, is_stream=is_stream)
            local = replace(local, resets_count=self._gate.resets_count)
            step_m = (
                0.0
                if drop is not None
                else self._sources.step_m(local.pose.position, local.time_s, local.position_std_dev_m or 0.0, velocity)
            )
            two = self._sources.two(now_s)
        self._tell(now_s, two, step_m if local.resets_count == resets_count else 0.0, local.pose.position)
        if drop is not None:
            self._silence.dropped(now_s, drop.why)
            return drop
        if local.resets_count != resets_count:
            logs.event(_log, logging.WARNING, "external_poses_moved", to=self._resolver.describe(local.pose.position))
            self._on_moved(now_s)
        self._backend.set_external_pose(local)
        self._silence.on_pose(now_s)
        return None

    def _tell(self, now_s: float, two: str, step_m: float, position: Vector3) -> None:
        """Logs a step of the source, and that there are two sources."""
        if two:
            if not self._silence.doubt(now_s):
                logs.event(_log, logging.WARNING, "external_poses_of_two", why=two)
            self._silence.doubted(now_s, two)
        elif step_m and now_s - self._stepped_s >= _STEPS_S:
            self._stepped_s = now_s
            to = self._resolver.describe(position)
            logs.event(_log, logging.WARNING, "external_pose_step", step_m=round(step_m, 2), to=to)

    def _velocity(self) -> Vector3 | None:
        """Returns the velocity that the autopilot has now, in the local frame; None where that is not known."""
        snapshot = self._backend.snapshot()
        estimator, velocity = snapshot.motion.estimator, snapshot.motion.velocity
        if estimator is None or velocity is None or not estimator.value.is_good:
            return None
        return velocity.value.linear if snapshot.time_s - velocity.time_s <= _VELOCITY_S else None

    def _judge(
        self, local: values.ExternalPose, now_s: float, velocity: Vector3 | None, *, is_stream: bool
    ) -> Drop | None:
        """Returns why a pose is not to be passed on. Called with the lock held.

        Raises:
            InvalidArgumentError: It is old, and not of a stream.

        """
        drop = self._gate.untimely(local.time_s, now_s)
        if drop is not None and not is_stream:
            raise validation.refuse("pose.header.stamp", str(drop))
        if drop is None and self._gate.is_too_soon(local.time_s):
            return _TOO_SOON
        if drop is not None:
            return drop
        return self._gate.jump(local.pose, local.time_s, local.position_std_dev_m or 0.0, self._fastest_m_s(velocity))

    def _fastest_m_s(self, velocity: Vector3 | None) -> float:
        """Returns the highest speed at which the UAV may move now: little more than it flies, where that is known."""
        if velocity is not None:
            return velocity.norm() + _SPEED_MARGIN_M_S
        limits = self._backend.info().limits
        fastest_m_s = max(limits.horizontal_speed_m_s, limits.climb_speed_m_s, limits.descent_speed_m_s)
        return _SPEED_FACTOR * fastest_m_s

    def _to_local(self, measured: ExternalPose, now_s: float) -> values.ExternalPose:
        """Validates a pose, and converts it to the backend's frame and clock. `now_s` is that clock's present time."""
        utc_s, stamp_s = self._backend.utc_s(), measured.pose.stamp_s
        stamp_s = validation.not_negative(stamp_s, "pose.header.stamp", at_most=validation.MAX_STAMP_S) or utc_s
        return values.ExternalPose(
            self._resolver.external_pose(measured.pose, now_s),
            now_s - (utc_s - stamp_s),
            stamp_s,
            _std_dev(measured.position_std_dev_m, "position_std_dev_m"),
            _std_dev(measured.orientation_std_dev_rad, "orientation_std_dev_rad"),
        )


def _std_dev(value: float | None, field: str) -> float | None:
    return None if value is None else validation.positive(value, field, at_most=_MOST_STD_DEV_VALUE)
