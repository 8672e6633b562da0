"""Between a sample and its message. Samples flow often: fields are set one by one, the fastest way in protobuf."""

from __future__ import annotations

from collections.abc import Mapping

from ual.contract.odometry import Odometry
from ual.types import State, Telemetry
from ual.v1 import ual_pb2 as pb
from ual.wire.convert import stamp_to_proto, write_pose, write_transform, write_twist
from ual.wire.uav import (
    TELEMETRY_READERS,
    geo_point_to_proto,
    task_info_from_proto,
    task_info_to_proto,
    write_rare_of_telemetry,
)

_STATES: Mapping[int, State] = {state.value: state for state in State}


def telemetry_to_proto(telemetry: Telemetry) -> pb.Telemetry:
    """One sample. `missed_count` belongs to a subscriber and is sent with it."""
    message = pb.Telemetry()
    write_telemetry(telemetry, message)
    return message


def write_telemetry(telemetry: Telemetry, message: pb.Telemetry) -> None:
    """As `telemetry_to_proto`, into an empty message, or part of one."""
    write_rare_of_telemetry(telemetry, message)
    header = message.header
    stamp_to_proto(telemetry.stamp_s, header.stamp)
    header.frame_id = telemetry.frame_id
    message.sequence = telemetry.sequence
    if telemetry.pose is not None:
        write_pose(telemetry.pose, message.pose)
    if telemetry.velocity is not None:
        write_twist(telemetry.velocity, message.velocity)
    if telemetry.odometry is not None:
        _write_odometry(telemetry.odometry, message.odometry, telemetry, message)
    if telemetry.transform is not None:
        write_transform(telemetry.transform, message.transform)
    if telemetry.reference_pose is not None:
        write_pose(telemetry.reference_pose, message.reference_pose)
    if telemetry.position_geo is not None:
        message.position_geo.CopyFrom(geo_point_to_proto(telemetry.position_geo))
    if telemetry.task is not None:
        message.task.CopyFrom(task_info_to_proto(telemetry.task))


def telemetry_from_proto(message: pb.Telemetry, missed_count: int = 0) -> Telemetry:
    """One sample, with how many the subscriber missed before it.

    Most of it is made when it is first read: few subscribers read all of it. What a newer daemon may tell and we do not
    know is read now, so that it fails here.
    """
    return Telemetry.late(
        lambda name: TELEMETRY_READERS[name](message),
        state=_STATES.get(message.state) or TELEMETRY_READERS["state"](message),
        task=task_info_from_proto(message.task) if message.HasField("task") else None,
        missed_count=missed_count,
    )


def _write_odometry(odometry: Odometry, message: pb.Odometry, telemetry: Telemetry, written: pb.Telemetry) -> None:
    """Writes odometry. Values of `telemetry` that `written` has already are copied: that is faster."""
    stamp_to_proto(odometry.stamp_s, message.header.stamp)
    message.header.frame_id = odometry.frame_id
    message.child_frame_id = odometry.child_frame_id
    if odometry.pose is telemetry.pose:
        message.pose.CopyFrom(written.pose)
    else:
        write_pose(odometry.pose, message.pose)
    write_twist(odometry.twist, message.twist)
