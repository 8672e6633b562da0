"""The calls of `ual.interface.Gimbals` and `ual.interface.Gimbal`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, built, nothing, of, request
from ual._wrong_type import require
from ual.geometry import PointStamped, Vector3, stamped_point
from ual.gimbals import GimbalInfo, GimbalReference, GimbalStatus
from ual.v1 import gimbal_pb2 as pb
from ual.wire import convert, requests
from ual.wire import gimbal as wire


def status(gimbal: int) -> Call[GimbalStatus]:
    return of(
        "GetGimbalStatus",
        request(pb.GetGimbalStatusRequest, gimbal=gimbal),
        lambda response: wire.gimbal_status_from_proto(response.status),
    )


def watch(gimbal: int, rate_hz: float) -> Call[GimbalStatus]:
    return of(
        "WatchGimbal",
        request(pb.WatchGimbalRequest, gimbal=gimbal, rate_hz=rate_hz),
        lambda response: wire.gimbal_status_from_proto(response.status),
    )


def set_angles(
    gimbal: int, pitch_rad: float, yaw_rad: float, roll_rad: float, reference: GimbalReference, frame_id: str
) -> Call[None]:
    require(frame_id, str, "frame_id")
    return of(
        "SetGimbalAngles",
        built(
            lambda: requests.set_gimbal_angles_request(
                gimbal=gimbal,
                pitch_rad=pitch_rad,
                yaw_rad=yaw_rad,
                roll_rad=roll_rad,
                reference=reference,
                frame_id=frame_id,
            ),
            "pitch_rad",
            pitch_rad,
        ),
        nothing,
    )


def set_rates(gimbal: int, pitch_rad_s: float, yaw_rad_s: float) -> Call[None]:
    return of(
        "SetGimbalRates",
        request(pb.SetGimbalRatesRequest, gimbal=gimbal, pitch_rad_s=pitch_rad_s, yaw_rad_s=yaw_rad_s),
        nothing,
    )


def point_at(gimbal: int, point: PointStamped | Vector3) -> Call[None]:
    return of(
        "PointGimbal",
        request(pb.PointGimbalRequest, gimbal=gimbal, point=convert.point_stamped_to_proto(stamped_point(point))),
        nothing,
    )


def move_to_neutral(gimbal: int) -> Call[None]:
    return of("MoveGimbalToNeutral", request(pb.MoveGimbalToNeutralRequest, gimbal=gimbal), nothing)


def retract(gimbal: int) -> Call[None]:
    return of("RetractGimbal", request(pb.RetractGimbalRequest, gimbal=gimbal), nothing)


def take_control(gimbal: int) -> Call[None]:
    return of("TakeGimbalControl", request(pb.TakeGimbalControlRequest, gimbal=gimbal), nothing)


def release_control(gimbal: int) -> Call[None]:
    return of("ReleaseGimbalControl", request(pb.ReleaseGimbalControlRequest, gimbal=gimbal), nothing)


def get_all() -> Call[list[GimbalInfo]]:
    return of(
        "ListGimbals",
        pb.ListGimbalsRequest(),
        lambda response: list(map(wire.gimbal_info_from_proto, response.gimbals)),
    )
