"""How values of the interface look as JSON and as text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum

from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Vector3
from ual.types import Plan, TaskInfo


def error_text(error: UalError) -> str:
    """Why something was refused or failed, in one line."""
    return f"{error.reason}: {' '.join(error.message.split())}"


def to_json(value: object) -> object:
    """A value as JSON knows them: names for enums, null for what is not known."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, UalError):
        return {"reason": value.reason, "message": value.message, "metadata": dict(value.metadata)}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_json(each) for key, each in value.items()}
    if isinstance(value, (set, frozenset)):
        return sorted((to_json(each) for each in value), key=str)
    if isinstance(value, (list, tuple)):
        return [to_json(each) for each in value]
    return value


def vector_text(vector: Vector3) -> str:
    """Three components, to the centimetre."""
    return " ".join(f"{component:.2f}" for component in vector)


def pose_text(pose: Pose) -> str:
    """Position and heading."""
    return f"{vector_text(pose.position)}  {math.degrees(pose.yaw_rad):.1f}°"


def pose_json(pose: PoseStamped) -> dict[str, object]:
    """A pose as a waypoint file has it."""
    position = pose.pose.position
    return {
        "frame_id": pose.frame_id,
        "x": position.x,
        "y": position.y,
        "z": position.z,
        "yaw_rad": pose.pose.yaw_rad,
    }


def plan_text(plan: Plan) -> str:
    """What would happen, in one line."""
    length = "" if plan.length_m is None else f", {plan.length_m:.2f} m"
    duration = "" if plan.duration_s is None else f", {plan.duration_s:.1f} s"
    return f"would be accepted{length}{duration}"


def task_text(task: TaskInfo) -> str:
    """How a task ended, in one line."""
    return f"{task.kind.name} {task.status.name} after {task.elapsed_s:.1f} s"
