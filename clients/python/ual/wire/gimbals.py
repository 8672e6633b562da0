"""Between the messages of `GimbalService` and the value types."""

from __future__ import annotations

from enum import Enum
from typing import TypeVar

from ual.errors import InvalidArgumentError
from ual.geometry import PointStamped, Quaternion
from ual.gimbals import (
    AngleRange,
    GimbalAbility,
    GimbalActivity,
    GimbalAngles,
    GimbalControl,
    GimbalInfo,
    GimbalReference,
    GimbalStatus,
)
from ual.v1 import gimbal_pb2 as pb
from ual.v1 import ual_pb2
from ual.wire import convert

E = TypeVar("E", bound=Enum)


def info_to_proto(info: GimbalInfo) -> pb.Gimbal:
    """Makes a message."""
    return pb.Gimbal(
        number=info.number,
        name=info.name,
        abilities=[pb.GimbalAbility.ValueType(each.value) for each in sorted(info.abilities, key=lambda it: it.value)],
        is_connected=info.is_connected,
        frame_id=info.frame_id,
        roll=_range_to_proto(info.roll),
        pitch=_range_to_proto(info.pitch),
        yaw=_range_to_proto(info.yaw),
        note=info.note,
    )


def info_from_proto(message: pb.Gimbal) -> GimbalInfo:
    """Reads a message. Abilities that this version does not know are left out."""
    abilities = (_known(GimbalAbility, each) for each in message.abilities)
    return GimbalInfo(
        message.number,
        message.name,
        frozenset(each for each in abilities if each is not None),
        message.is_connected,
        message.frame_id,
        _range_from_proto(message.roll) if message.HasField("roll") else None,
        _range_from_proto(message.pitch) if message.HasField("pitch") else None,
        _range_from_proto(message.yaw) if message.HasField("yaw") else None,
        message.note,
    )


def status_to_proto(status: GimbalStatus) -> pb.GimbalStatus:
    """Makes a message."""
    message = pb.GimbalStatus(
        angles=None if status.angles is None else angles_to_proto(status.angles),
        in_body=_orientation_to_proto(status.in_body),
        in_odom=_orientation_to_proto(status.in_odom),
        activity=pb.GimbalActivity.ValueType(0 if status.activity is None else status.activity.value),
        target=None if status.target is None else convert.point_stamped_to_proto(status.target),
        off_target_rad=status.off_target_rad,
        control=pb.GimbalControl.ValueType(0 if status.control is None else status.control.value),
        controller=status.controller,
        problems=status.problems,
    )
    if status.stamp_s is not None:
        convert.stamp_to_proto(status.stamp_s, message.stamp)
    return message


def status_from_proto(message: pb.GimbalStatus) -> GimbalStatus:
    """Reads a message."""
    has = message.HasField
    return GimbalStatus(
        convert.stamp_from_proto(message.stamp) if has("stamp") else None,
        angles_from_proto(message.angles) if has("angles") else None,
        _orientation_from_proto(message.in_body) if has("in_body") else None,
        _orientation_from_proto(message.in_odom) if has("in_odom") else None,
        _known(GimbalActivity, message.activity),
        convert.point_stamped_from_proto(message.target, "target") if has("target") else None,
        message.off_target_rad if has("off_target_rad") else None,
        _known(GimbalControl, message.control),
        message.controller,
        tuple(message.problems),
    )


def angles_to_proto(angles: GimbalAngles) -> pb.GimbalAngles:
    """Makes a message."""
    return pb.GimbalAngles(roll_rad=angles.roll_rad, pitch_rad=angles.pitch_rad, yaw_rad=angles.yaw_rad)


def angles_from_proto(message: pb.GimbalAngles) -> GimbalAngles:
    """Reads a message."""
    return GimbalAngles(message.roll_rad, message.pitch_rad, message.yaw_rad)


def reference_to_proto(reference: GimbalReference) -> pb.GimbalReference.ValueType:
    """Makes a value of the enum."""
    if not isinstance(reference, GimbalReference):
        raise InvalidArgumentError(f"reference: {reference!r:.80} is no GimbalReference", {"field": "reference"})
    return pb.GimbalReference.ValueType(reference.value)


def reference_from_proto(value: pb.GimbalReference.ValueType) -> GimbalReference:
    """Reads a value of the enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    reference = _known(GimbalReference, value)
    if reference is None:
        known = ", ".join(each.name for each in GimbalReference)
        raise InvalidArgumentError(f"reference: {value} is none of {known}", {"field": "reference"})
    return reference


def point_request(gimbal: int, point: PointStamped) -> pb.PointGimbalRequest:
    """Makes a message."""
    return pb.PointGimbalRequest(gimbal=gimbal, point=convert.point_stamped_to_proto(point))


def point_from_request(request: pb.PointGimbalRequest) -> PointStamped:
    """Reads a message. Raises `InvalidArgumentError` where the point is not set."""
    return convert.point_stamped_from_proto(request.point, "point")


def _range_to_proto(found: AngleRange | None) -> pb.AngleRange | None:
    return None if found is None else pb.AngleRange(least_rad=found.least_rad, most_rad=found.most_rad)


def _range_from_proto(message: pb.AngleRange) -> AngleRange:
    return AngleRange(message.least_rad, message.most_rad)


def _orientation_to_proto(found: Quaternion | None) -> ual_pb2.Quaternion | None:
    return None if found is None else ual_pb2.Quaternion(x=found.x, y=found.y, z=found.z, w=found.w)


def _orientation_from_proto(message: ual_pb2.Quaternion) -> Quaternion:
    return Quaternion(message.x, message.y, message.z, message.w)


def _known(kind: type[E], number: int) -> E | None:
    """Returns the member of a number; None for one that is not set, or that this version does not know."""
    return next((each for each in kind if each.value == number), None)
