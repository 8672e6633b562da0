"""Positions of UAVs in `map`, the frame that all UAVs share, from one sample of telemetry. What is not known is
None.
"""

from __future__ import annotations

import math

from ual.geometry import Pose, Transform, Vector3
from ual.types import Telemetry


def position(sample: Telemetry) -> Vector3 | None:
    """Returns where it is."""
    found = body(sample)
    return None if found is None else found.position


def body(sample: Telemetry) -> Pose | None:
    """Returns its pose."""
    transform = sample.transform
    return None if transform is None else _finite(Pose(transform.translation, transform.rotation))


def odom(sample: Telemetry) -> Transform | None:
    """Returns the transform from ``<ns>/odom``: the sample has the pose of the body in both frames."""
    if sample.transform is None or sample.odometry is None:
        return None
    return _between(sample.transform, sample.odometry.pose)


def reference(sample: Telemetry) -> Pose | None:
    """Returns the reference: the sample has it, and the pose of the body, in the same frame."""
    if sample.transform is None or sample.pose is None or sample.reference_pose is None:
        return None
    return _finite(_between(sample.transform, sample.pose).apply_pose(sample.reference_pose))


def _between(body_in_map: Transform, pose: Pose) -> Transform:
    return body_in_map.compose(Transform(pose.position, pose.orientation).inverse())


def _finite(pose: Pose) -> Pose | None:
    return pose if all(map(math.isfinite, (*pose.position, *pose.orientation))) else None
