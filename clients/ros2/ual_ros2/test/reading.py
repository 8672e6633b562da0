"""Parts of messages that the tests' program in ROS makes and reads by no rule of the contract. It needs no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import ual
from ual.cameras import OPTICAL, CameraIntrinsics
from ual.gimbals import AngleRange
from ual.parameters.values import ParameterType
from ual_ros2 import naming, values
from ual_ros2.services.fields import MIB, Fields, Stamp, quaternion, vector

_OF_UAL = {"height": "height_m", "pitch": "pitch_rad"}
"""Fields that the checks ask for, by their names in ROS."""


class Member(NamedTuple):
    """A member of `ual.interface` as a service: its type and name, its request, and what it returns of an answer."""

    kind: Any
    name: str
    ask: Callable[..., Fields]
    read: Callable[[Any], Any]


def nothing(_: Any) -> None:
    """Reads an answer that says no more than that it is done."""


def error_of(answer: Any) -> ual.UalError:
    """The error of an answer, result or message that tells a refusal, as UAL's client names its field."""
    metadata = {each.key: each.value for each in answer.metadata}
    field = metadata.get("field", "")
    if field not in _OF_UAL:
        return ual.errors.from_reason(answer.reason, answer.message, metadata)
    words = naming.in_text(answer.message, field, _OF_UAL[field])
    return ual.errors.from_reason(answer.reason, words, {**metadata, "field": _OF_UAL[field]})


# --- Numbers ----------------------------------------------------------------------------------------------------------


def number(told: float) -> float | None:
    """A number that may not be known."""
    return None if math.isnan(told) else float(told)


def finite(told: float) -> float | None:
    """A bound, which may be lacking."""
    return float(told) if math.isfinite(told) else None


def percent(ratio: float) -> float | None:
    """A share of 100 that may not be known."""
    return None if math.isnan(ratio) else 100.0 * ratio


def in_mib(size_bytes: float) -> float | None:
    """A size that may not be known."""
    return None if math.isnan(size_bytes) else size_bytes / MIB


def parameter_value(message: Any) -> float:
    """The value of a Parameter, whole where it is one."""
    return int(message.value) if ParameterType[message.type].is_whole else float(message.value)


# --- Geometry ---------------------------------------------------------------------------------------------------------


def orientation(message: Any) -> ual.Quaternion | None:
    """A Quaternion that may not be known."""
    found = values.quaternion(message)
    return found if found.norm() else None


def point_of(message: Any) -> ual.PointStamped | None:
    """A PointStamped that may not be known."""
    return values.point_stamped(message) if message.header.frame_id else None


def transform_of(message: Any) -> ual.Transform:
    """A TransformStamped with its stamp."""
    return values.transform_stamped(message, values.stamp_s(message.header.stamp))


def link_of(frame: Any) -> ual.Transform | None:
    """Returns the pose of a Frame in its parent, where that is known."""
    there = frame.transform
    where, turn = values.vector(there.translation), values.quaternion(there.rotation)
    return ual.Transform(where, turn, frame.parent_frame_id, frame.frame_id) if frame.is_known else None


def read_angle_range(told: Any) -> AngleRange | None:
    """The least and the most of angles, where they are known."""
    least_rad, most_rad = map(float, told)
    return None if math.isnan(least_rad) else AngleRange(least_rad, most_rad)


def fix(latitude_deg: float, longitude_deg: float, altitude_m: float) -> Fields:
    """A NavSatFix."""
    return {"latitude": latitude_deg, "longitude": longitude_deg, "altitude": altitude_m}


def pose_stamped(value: ual.PoseStamped) -> Fields:
    """A PoseStamped."""
    pose = {"position": vector(value.pose.position), "orientation": quaternion(value.pose.orientation)}
    return {"header": {"frame_id": value.frame_id, "stamp": Stamp(value.stamp_s)}, "pose": pose}


def path(waypoints: Iterable[ual.PoseStamped | ual.GeoWaypoint]) -> Fields:
    """A Path of those that are poses."""
    return {"poses": [pose_stamped(each) for each in waypoints if isinstance(each, ual.PoseStamped)]}


def twist_stamped(value: ual.TwistStamped) -> Fields:
    """A TwistStamped without a stamp."""
    twist = {"linear": vector(value.twist.linear), "angular": vector(value.twist.angular)}
    return {"header": {"frame_id": value.frame_id}, "twist": twist}


def transform_stamped(value: ual.Transform) -> Fields:
    """A TransformStamped."""
    link = {"translation": vector(value.translation), "rotation": quaternion(value.rotation)}
    header = {"frame_id": value.frame_id, "stamp": Stamp(value.stamp_s)}
    return {"header": header, "child_frame_id": value.child_frame_id, "transform": link}


# --- Pictures ---------------------------------------------------------------------------------------------------------


def intrinsics(message: Any) -> CameraIntrinsics | None:
    """A CameraInfo; None where the camera is not calibrated."""
    fx, _, cx, _, fy, cy, *_ = map(float, message.k)
    return CameraIntrinsics(message.width, message.height, fx, fy, cx, cy) if fx else None


def read_viewpoint(message: Any) -> dict[str, Any]:
    """A Viewpoint, as arguments of a Photo or an Image."""
    seen = _pose(message.optical)
    camera = None if seen is None else ual.Pose(seen.pose.position, seen.pose.orientation * OPTICAL.inverse())
    at = message.position
    place = ual.GeoPoint(
        at.latitude, at.longitude, number(message.altitude_amsl), number(message.altitude_home), number(at.altitude)
    )
    return {
        "stamp_s": values.stamp_s(message.stamp),
        "body": _pose(message.body),
        "camera": None if camera is None or seen is None else ual.PoseStamped(camera, seen.frame_id),
        "position_geo": None if math.isnan(at.latitude) else place,
    }


def _pose(message: Any) -> ual.PoseStamped | None:
    return values.pose_stamped(message) if message.header.frame_id else None
