"""Between the messages of ``arm.proto`` and their values. Written by ``tools.contract.extension``: do not edit it."""

from __future__ import annotations

from ual_arm.v1 import arm_pb2 as pb
from ual_arm.values import Joints


def joints_to_proto(value: Joints) -> pb.Joints:
    """Makes a message."""
    return pb.Joints(
        shoulder_rad=value.shoulder_rad,
        elbow_rad=value.elbow_rad,
        is_moving=value.is_moving,
    )


def joints_from_proto(message: pb.Joints) -> Joints:
    """Reads a message."""
    return Joints(
        message.shoulder_rad,
        message.elbow_rad,
        message.is_moving,
    )
