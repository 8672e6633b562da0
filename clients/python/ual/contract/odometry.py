"""Odometry, whose frames stand behind what is in them."""

from __future__ import annotations

from dataclasses import dataclass

from ual.geometry import Pose, Twist


@dataclass(frozen=True, slots=True)
class Odometry:
    """Pose of the child frame (``<ns>/base_link``) in `frame_id` (``<ns>/odom``), twist in the child frame."""

    pose: Pose
    twist: Twist
    frame_id: str
    child_frame_id: str
    stamp_s: float
