"""The simulated arm: two joints that turn at a constant speed. Pure functions of time, in seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ual.errors import InvalidArgumentError
from ual.geometry import Quaternion, Transform, Vector3
from ual_arm.values import Joints


@dataclass(frozen=True)
class Joint:
    """A joint on its way from an angle to another one."""

    start_rad: float
    goal_rad: float
    began_s: float
    speed_rad_s: float

    @property
    def arrives_s(self) -> float:
        """Time of its arrival."""
        return self.began_s + abs(self.goal_rad - self.start_rad) / self.speed_rad_s

    def at(self, time_s: float) -> float:
        """Returns its angle."""
        if time_s >= self.arrives_s:
            return self.goal_rad
        turned_rad = max(0.0, time_s - self.began_s) * self.speed_rad_s
        return self.start_rad + math.copysign(turned_rad, self.goal_rad - self.start_rad)

    def towards(self, goal_rad: float, time_s: float) -> Joint:
        """Returns the joint on its way to another angle from where it is now."""
        return Joint(self.at(time_s), goal_rad, time_s, self.speed_rad_s)


@dataclass(frozen=True)
class Motion:
    """Both joints."""

    shoulder: Joint
    elbow: Joint

    @property
    def arrives_s(self) -> float:
        """Time at which both have arrived."""
        return max(self.shoulder.arrives_s, self.elbow.arrives_s)

    def at(self, time_s: float) -> Joints:
        """Returns where they are."""
        return Joints(self.shoulder.at(time_s), self.elbow.at(time_s), time_s < self.arrives_s)


def checked(angle_rad: float, limit_rad: float, field: str) -> float:
    """Accepts an angle within the limit.

    Raises:
        InvalidArgumentError: It is not.

    """
    if not abs(angle_rad) <= limit_rad:  # also NaN
        raise InvalidArgumentError(f"{field}: {angle_rad:g} is not within {limit_rad:g} rad of zero", {"field": field})
    return angle_rad


def frames(ns: str, joints: Joints, mount: Vector3, upper_m: float, lower_m: float) -> list[Transform]:
    """Returns the frames of the arm below ``<ns>/base_link``: shoulder, elbow and tool."""
    shoulder, elbow, tool = (f"{ns}/arm/{name}" for name in ("shoulder", "elbow", "tool"))
    return [
        Transform(
            mount,
            Quaternion.from_euler(0.0, joints.shoulder_rad, 0.0),
            frame_id=f"{ns}/base_link",
            child_frame_id=shoulder,
        ),
        Transform(
            Vector3(upper_m, 0.0, 0.0),
            Quaternion.from_euler(0.0, joints.elbow_rad, 0.0),
            frame_id=shoulder,
            child_frame_id=elbow,
        ),
        Transform(Vector3(lower_m, 0.0, 0.0), frame_id=elbow, child_frame_id=tool),
    ]
