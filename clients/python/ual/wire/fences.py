"""Between the messages of `FenceService` and the value types."""

from __future__ import annotations

from collections.abc import Iterable

from ual.fences.values import FencePlan, FenceZone, KeptFence, RallyPoint
from ual.types import AltitudeReference
from ual.v1 import fence_pb2 as pb


def zones_to_proto(zones: Iterable[FenceZone]) -> list[pb.FenceZone]:
    """Makes messages."""
    return [
        pb.FenceZone(
            is_inclusion=zone.is_inclusion,
            points=[_point_to_proto(*point) for point in zone.points],
            radius_m=zone.radius_m,
        )
        for zone in zones
    ]


def rally_to_proto(points: Iterable[RallyPoint]) -> list[pb.RallyPoint]:
    """Makes messages."""
    return [
        pb.RallyPoint(
            latitude_deg=point.latitude_deg,
            longitude_deg=point.longitude_deg,
            height_m=point.height_m,
            is_amsl=point.reference is AltitudeReference.AMSL,
        )
        for point in points
    ]


def to_proto(fence: KeptFence) -> pb.KeptFence:
    """Makes a message."""
    return pb.KeptFence(
        zones=zones_to_proto(fence.zones),
        rally_points=rally_to_proto(fence.rally_points),
        is_enabled=fence.is_enabled,
        return_point=None if fence.return_point is None else _point_to_proto(*fence.return_point),
    )


def _point_to_proto(latitude_deg: float, longitude_deg: float) -> pb.FencePoint:
    return pb.FencePoint(latitude_deg=latitude_deg, longitude_deg=longitude_deg)


def plan_from_proto(request: pb.UploadFenceRequest) -> FencePlan:
    """Reads what is to be uploaded."""
    return FencePlan(_zones(request.zones), _rally_points(request.rally_points))


def of_response(
    response: pb.GetFenceResponse | pb.UploadFenceResponse | pb.ClearFenceResponse | pb.EnableFenceResponse,
) -> KeptFence:
    """Reads the fence of a response."""
    fence = response.fence
    is_enabled = fence.is_enabled if fence.HasField("is_enabled") else None
    point = fence.return_point if fence.HasField("return_point") else None
    place = None if point is None else (point.latitude_deg, point.longitude_deg)
    return KeptFence(_zones(fence.zones), _rally_points(fence.rally_points), is_enabled, place)


def _zones(zones: Iterable[pb.FenceZone]) -> tuple[FenceZone, ...]:
    return tuple(
        FenceZone(
            zone.is_inclusion,
            tuple((point.latitude_deg, point.longitude_deg) for point in zone.points),
            zone.radius_m if zone.HasField("radius_m") else None,
        )
        for zone in zones
    )


def _rally_points(points: Iterable[pb.RallyPoint]) -> tuple[RallyPoint, ...]:
    return tuple(
        RallyPoint(
            point.latitude_deg,
            point.longitude_deg,
            point.height_m,
            AltitudeReference.AMSL if point.is_amsl else AltitudeReference.HOME,
        )
        for point in points
    )
