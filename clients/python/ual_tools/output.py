"""Converts values of the interface to JSON and to text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum

from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Vector3
from ual.types import Plan, TaskInfo


def error_text(error: UalError) -> str:
    """Returns in one line why something was refused or failed."""
    return f"{error.reason}: {' '.join(error.message.split())}"


def remedy_text(error: UalError) -> str:
    """Returns where the pages say what to do about a reason."""
    return f"see docs/reference/errors.md#{error.reason.lower()}"


def to_json(value: object) -> object:
    """Converts a value to what JSON can express: the names of enums, null for a number that is not finite."""
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


def running_text(task: TaskInfo) -> str:
    """Returns what a task was told to do, and whether it is paused."""
    text = task.description or task.kind.name
    return f"{text} (paused)" if task.is_paused else text


def vector_text(vector: Vector3) -> str:
    """Returns the three components with two decimals."""
    return " ".join(f"{component:.2f}" for component in vector)


def pose_text(pose: Pose) -> str:
    """Returns position and heading."""
    return f"{vector_text(pose.position)}  {math.degrees(pose.yaw_rad):.1f}°"


def pose_json(pose: PoseStamped) -> dict[str, object]:
    """Converts a pose to the form of a waypoint file."""
    position = pose.pose.position
    return {
        "frame_id": pose.frame_id,
        "x": position.x,
        "y": position.y,
        "z": position.z,
        "yaw_rad": pose.pose.yaw_rad,
    }


def plan_text(plan: Plan) -> str:
    """Returns the result of a dry run in one line."""
    length = "" if plan.length_m is None else f", {plan.length_m:.2f} m"
    duration = "" if plan.duration_s is None else f", {plan.duration_s:.1f} s"
    return f"would be accepted{length}{duration}"


def task_text(task: TaskInfo) -> str:
    """Returns in one line how a task ended."""
    return f"{task.kind.name} {task.status.name} after {task.elapsed_s:.1f} s"
