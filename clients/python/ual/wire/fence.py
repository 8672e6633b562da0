"""Between the messages of ``fence.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual.contract.fence import FenceZone, KeptFence
from ual.v1 import fence_pb2 as pb
from ual.wire import rally_points


def fence_point_to_proto(value: tuple[float, float]) -> pb.FencePoint:
    """Makes a message."""
    latitude_deg, longitude_deg = value
    return pb.FencePoint(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
    )


def fence_point_from_proto(message: pb.FencePoint) -> tuple[float, float]:
    """Reads a message."""
    return (
        message.latitude_deg,
        message.longitude_deg,
    )


def fence_zone_to_proto(value: FenceZone) -> pb.FenceZone:
    """Makes a message."""
    return pb.FenceZone(
        is_inclusion=value.is_inclusion,
        points=map(fence_point_to_proto, value.points),
        radius_m=value.radius_m,
    )


def fence_zone_from_proto(message: pb.FenceZone) -> FenceZone:
    """Reads a message."""
    return FenceZone(
        message.is_inclusion,
        tuple(map(fence_point_from_proto, message.points)),
        message.radius_m if message.HasField("radius_m") else None,
    )


def kept_fence_to_proto(value: KeptFence) -> pb.KeptFence:
    """Makes a message."""
    return pb.KeptFence(
        zones=map(fence_zone_to_proto, value.zones),
        rally_points=map(rally_points.rally_point_to_proto, value.rally_points),
        is_enabled=value.is_enabled,
        return_point=None if value.return_point is None else fence_point_to_proto(value.return_point),
    )


def kept_fence_from_proto(message: pb.KeptFence) -> KeptFence:
    """Reads a message."""
    return KeptFence(
        tuple(map(fence_zone_from_proto, message.zones)),
        tuple(map(rally_points.rally_point_from_proto, message.rally_points)),
        message.is_enabled if message.HasField("is_enabled") else None,
        fence_point_from_proto(message.return_point) if message.HasField("return_point") else None,
    )
