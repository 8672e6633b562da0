"""The calls of `ual.interface.Uav`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, built, nothing, of, request
from ual._wrong_type import require
from ual.geometry import Transform, checked_transform
from ual.shared.flags import flag
from ual.types import Frame, Geofence, Info, LeaseInfo, Route, Telemetry
from ual.v1 import ual_pb2 as pb
from ual.wire import convert, samples
from ual.wire import uav as wire


def info() -> Call[Info]:
    return of("GetInfo", pb.GetInfoRequest(), wire.info_from_proto)


def telemetry() -> Call[Telemetry]:
    return of(
        "GetTelemetry", pb.GetTelemetryRequest(), lambda response: samples.telemetry_from_proto(response.telemetry)
    )


def transform(target_frame_id: str, source_frame_id: str) -> Call[Transform]:
    require(target_frame_id, str, "target_frame_id")
    require(source_frame_id, str, "source_frame_id")
    return of(
        "GetTransform",
        request(pb.GetTransformRequest, target_frame_id=target_frame_id, source_frame_id=source_frame_id),
        lambda response: convert.transform_from_proto(response.transform),
    )


def frames() -> Call[list[Frame]]:
    return of("ListFrames", pb.ListFramesRequest(), lambda response: list(map(wire.frame_from_proto, response.frames)))


def geofence() -> Call[Geofence]:
    return of("GetGeofence", pb.GetGeofenceRequest(), lambda response: wire.geofence_from_proto(response.geofence))


def route() -> Call[Route | None]:
    return of(
        "GetRoute",
        pb.GetRouteRequest(),
        lambda response: wire.route_from_proto(response.route) if response.HasField("route") else None,
    )


def add_frame(transform: Transform) -> Call[None]:
    checked_transform(transform)
    return of(
        "AddFrame",
        built(lambda: pb.AddFrameRequest(transform=convert.transform_to_proto(transform)), "transform", transform),
        nothing,
    )


def remove_frame(frame_id: str) -> Call[None]:
    require(frame_id, str, "frame_id")
    return of("RemoveFrame", request(pb.RemoveFrameRequest, frame_id=frame_id), nothing)


def set_home(set_z: bool) -> Call[None]:
    return of("SetHome", request(pb.SetHomeRequest, set_z=flag(set_z, "set_z")), nothing)


def arm() -> Call[None]:
    return of("Arm", pb.ArmRequest(), nothing)


def disarm() -> Call[None]:
    return of("Disarm", pb.DisarmRequest(), nothing)


def lease_info() -> Call[LeaseInfo | None]:
    return of(
        "GetLease",
        pb.GetLeaseRequest(),
        lambda response: wire.lease_info_from_proto(response.lease) if response.HasField("lease") else None,
    )
