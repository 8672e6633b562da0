"""Sources of the external poses: detects steps of a source, and two sources at once.

A step within what the gate passes is taken, as a vehicle may have been pushed; it is reported. Poses that step to and
fro, or callers that take turns, are two sources: the autopilot flies to a place between them, or to each in turn.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from ual.geometry import Vector3

SOURCE_STEP_M = 0.15
"""Less than this is noise of a source that does not say how noisy it is."""
_STD_DEV_FACTOR = 3.0
SPEED_SLACK_M_S = 2.0
"""By how much the autopilot's velocity may be wrong, or change from one pose to the next."""
UNKNOWN_SPEED_M_S = 5.0
"""The same where its velocity is not known."""
RETURNS_COUNT = 3
"""Returns, or turns of callers, within `SOURCE_WINDOW_S` that prove two sources."""
SOURCE_WINDOW_S = 1.0
_OWN = "this process"


class SourcePose(NamedTuple):
    """The measured place of a pose, and when that was."""

    position: Vector3
    time_s: float


class PoseSources:
    """Watches the poses of one UAV that go to its autopilot. Times are of one clock. Not thread-safe."""

    def __init__(self) -> None:
        self._last: SourcePose | None = None
        self._left: SourcePose | None = None
        """The last pose from before the newest step."""
        self._returns_s: deque[float] = deque(maxlen=RETURNS_COUNT)
        self._apart_m = 0.0
        self._caller: str | None = None
        self._turns: deque[tuple[float, str]] = deque(maxlen=RETURNS_COUNT)

    def on_pose(self, caller: str, now_s: float) -> None:
        """Notes the caller that sends a pose; empty: this process."""
        if self._caller is not None and caller != self._caller:
            self._turns.append((now_s, self._caller))
        self._caller = caller

    def step_m(self, position: Vector3, time_s: float, std_dev_m: float, velocity: Vector3 | None) -> float:
        """Takes a pose that is passed on. Returns how far it steps from the motion that is flown; 0 if it follows it.

        `velocity` is the autopilot's; None where it is not known.
        """
        last, self._last = self._last, SourcePose(position, time_s)
        if last is None:
            return 0.0
        beside_m = _deviation_m(last, self._last, std_dev_m, velocity)
        if not beside_m:
            return 0.0
        left, self._left = self._left, last
        if (
            left is not None
            and time_s - left.time_s <= SOURCE_WINDOW_S
            and not _deviation_m(left, self._last, std_dev_m, velocity)
        ):
            self._returns_s.append(time_s)
            self._apart_m = beside_m
        return beside_m

    def two(self, now_s: float) -> str:
        """Returns that there are two sources, and which, human-readable; empty if nothing shows that."""
        begin_s = now_s - SOURCE_WINDOW_S
        if len(self._turns) == RETURNS_COUNT and self._turns[0][0] >= begin_s:
            callers = {self._caller or "", *(each for _, each in self._turns)}
            return f"poses from outside come from {' and '.join(sorted(each or _OWN for each in callers))}"
        if len(self._returns_s) == RETURNS_COUNT and self._returns_s[0] >= begin_s:
            return f"poses from outside step to and fro by {self._apart_m:.1f} m: they come from two sources"
        return ""


def _deviation_m(begin: SourcePose, end: SourcePose, std_dev_m: float, velocity: Vector3 | None) -> float:
    """Returns how far a pose is from where the motion leads; 0 where that may be noise."""
    passed_s = max(0.0, end.time_s - begin.time_s)
    way = Vector3() if velocity is None else velocity * passed_s
    beside_m = (end.position - begin.position - way).norm()
    slack_m_s = UNKNOWN_SPEED_M_S if velocity is None else SPEED_SLACK_M_S
    return beside_m if beside_m > SOURCE_STEP_M + _STD_DEV_FACTOR * std_dev_m + slack_m_s * passed_s else 0.0
