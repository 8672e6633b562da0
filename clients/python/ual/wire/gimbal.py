"""Between the messages of ``gimbal.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

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
from ual.wire import convert
from ual.wire.enums import member_of, number_of

_GIMBAL_ABILITY: Mapping[int, GimbalAbility] = {each.value: each for each in GimbalAbility}

_GIMBAL_REFERENCE: Mapping[int, GimbalReference] = {each.value: each for each in GimbalReference}

_GIMBAL_ACTIVITY: Mapping[int, GimbalActivity] = {each.value: each for each in GimbalActivity}

_GIMBAL_CONTROL: Mapping[int, GimbalControl] = {each.value: each for each in GimbalControl}


def gimbal_reference_to_proto(value: GimbalReference, field: str) -> pb.GimbalReference.ValueType:
    """Makes a number of an enum. Raises `InvalidArgumentError` for what is no member of it."""
    return pb.GimbalReference.ValueType(number_of(value, GimbalReference, field))


def gimbal_reference_from_proto(number: int, field: str) -> GimbalReference:
    """Reads a number of an enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    return member_of(number, _GIMBAL_REFERENCE, field)


def angle_range_to_proto(value: AngleRange) -> pb.AngleRange:
    """Makes a message."""
    return pb.AngleRange(
        least_rad=value.least_rad,
        most_rad=value.most_rad,
    )


def angle_range_from_proto(message: pb.AngleRange) -> AngleRange:
    """Reads a message."""
    return AngleRange(
        message.least_rad,
        message.most_rad,
    )


def gimbal_angles_to_proto(value: GimbalAngles) -> pb.GimbalAngles:
    """Makes a message."""
    return pb.GimbalAngles(
        roll_rad=value.roll_rad,
        pitch_rad=value.pitch_rad,
        yaw_rad=value.yaw_rad,
    )


def gimbal_angles_from_proto(message: pb.GimbalAngles) -> GimbalAngles:
    """Reads a message."""
    return GimbalAngles(
        message.roll_rad,
        message.pitch_rad,
        message.yaw_rad,
    )


def gimbal_info_to_proto(value: GimbalInfo) -> pb.Gimbal:
    """Makes a message."""
    return pb.Gimbal(
        number=value.number,
        name=value.name,
        abilities=[pb.GimbalAbility.ValueType(each) for each in sorted(each.value for each in value.abilities)],
        is_connected=value.is_connected,
        frame_id=value.frame_id,
        roll=None if value.roll is None else angle_range_to_proto(value.roll),
        pitch=None if value.pitch is None else angle_range_to_proto(value.pitch),
        yaw=None if value.yaw is None else angle_range_to_proto(value.yaw),
        note=value.note,
    )


def gimbal_info_from_proto(message: pb.Gimbal) -> GimbalInfo:
    """Reads a message."""
    return GimbalInfo(
        message.number,
        message.name,
        frozenset(_GIMBAL_ABILITY[each] for each in message.abilities if each in _GIMBAL_ABILITY),
        message.is_connected,
        message.frame_id,
        angle_range_from_proto(message.roll) if message.HasField("roll") else None,
        angle_range_from_proto(message.pitch) if message.HasField("pitch") else None,
        angle_range_from_proto(message.yaw) if message.HasField("yaw") else None,
        message.note,
    )


def gimbal_status_to_proto(value: GimbalStatus) -> pb.GimbalStatus:
    """Makes a message."""
    return pb.GimbalStatus(
        stamp=None if value.stamp_s is None else convert.timestamp_to_proto(value.stamp_s),
        angles=None if value.angles is None else gimbal_angles_to_proto(value.angles),
        in_body=None if value.in_body is None else convert.quaternion_to_proto(value.in_body),
        in_odom=None if value.in_odom is None else convert.quaternion_to_proto(value.in_odom),
        activity=pb.GimbalActivity.ValueType(0 if value.activity is None else value.activity.value),
        target=None if value.target is None else convert.point_stamped_to_proto(value.target),
        off_target_rad=value.off_target_rad,
        control=pb.GimbalControl.ValueType(0 if value.control is None else value.control.value),
        controller=value.controller,
        problems=value.problems,
    )


def gimbal_status_from_proto(message: pb.GimbalStatus) -> GimbalStatus:
    """Reads a message."""
    return GimbalStatus(
        convert.stamp_from_proto(message.stamp) if message.HasField("stamp") else None,
        gimbal_angles_from_proto(message.angles) if message.HasField("angles") else None,
        convert.quaternion_from_proto(message.in_body) if message.HasField("in_body") else None,
        convert.quaternion_from_proto(message.in_odom) if message.HasField("in_odom") else None,
        _GIMBAL_ACTIVITY.get(message.activity),
        convert.point_stamped_from_proto(message.target, "target") if message.HasField("target") else None,
        message.off_target_rad if message.HasField("off_target_rad") else None,
        _GIMBAL_CONTROL.get(message.control),
        message.controller,
        tuple(message.problems),
    )
