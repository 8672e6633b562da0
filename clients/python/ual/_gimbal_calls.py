"""The calls of `GimbalService` about one gimbal: one function for each member of `ual.interface.Gimbal`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, built, of
from ual.geometry import PointStamped, Vector3, stamped_point
from ual.gimbals import GimbalAngles, GimbalReference, GimbalStatus
from ual.v1 import gimbal_pb2 as pb
from ual.wire import gimbals as convert


def status(gimbal: int) -> Call[GimbalStatus]:
    request = _of(pb.GetGimbalStatusRequest, gimbal)
    return of("GetGimbalStatus", request, _read_status)


def watch(gimbal: int, rate_hz: float) -> Call[GimbalStatus]:
    request = built(lambda: pb.WatchGimbalRequest(gimbal=gimbal, rate_hz=rate_hz), "rate_hz", rate_hz)
    return of("WatchGimbal", request, _read_status)


def set_angles(
    gimbal: int, pitch_rad: float, yaw_rad: float, roll_rad: float, reference: GimbalReference, frame_id: str
) -> Call[None]:
    def make() -> pb.SetGimbalAnglesRequest:
        return pb.SetGimbalAnglesRequest(
            gimbal=gimbal,
            angles=convert.angles_to_proto(GimbalAngles(roll_rad, pitch_rad, yaw_rad)),
            reference=convert.reference_to_proto(reference),
            frame_id=frame_id,
        )

    return _order("SetGimbalAngles", built(make, "pitch_rad"))


def set_rates(gimbal: int, pitch_rad_s: float, yaw_rad_s: float) -> Call[None]:
    def make() -> pb.SetGimbalRatesRequest:
        return pb.SetGimbalRatesRequest(gimbal=gimbal, pitch_rad_s=pitch_rad_s, yaw_rad_s=yaw_rad_s)

    return _order("SetGimbalRates", built(make, "pitch_rad_s", pitch_rad_s))


def point_at(gimbal: int, point: PointStamped | Vector3) -> Call[None]:
    stamped = stamped_point(point)
    return _order("PointGimbal", built(lambda: convert.point_request(gimbal, stamped), "point", point))


def move_to_neutral(gimbal: int) -> Call[None]:
    return _order("MoveGimbalToNeutral", _of(pb.MoveGimbalToNeutralRequest, gimbal))


def retract(gimbal: int) -> Call[None]:
    return _order("RetractGimbal", _of(pb.RetractGimbalRequest, gimbal))


def take_control(gimbal: int) -> Call[None]:
    return _order("TakeGimbalControl", _of(pb.TakeGimbalControlRequest, gimbal))


def release_control(gimbal: int) -> Call[None]:
    return _order("ReleaseGimbalControl", _of(pb.ReleaseGimbalControlRequest, gimbal))


def _read_status(response: pb.GetGimbalStatusResponse | pb.WatchGimbalResponse) -> GimbalStatus:
    return convert.status_from_proto(response.status)


def _of(make: Callable[..., Any], gimbal: int) -> Any:  # noqa: ANN401 (the request of a method)
    return built(lambda: make(gimbal=gimbal), "gimbal", gimbal)


def _order(method: str, request: Any) -> Call[None]:  # noqa: ANN401 (the request of a method)
    return of(method, request, lambda _: None)


BOUND = "number"
"""What each client's object has, and each call takes first: the number of the gimbal."""
MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "status": status,
    "watch": watch,
    "set_angles": set_angles,
    "set_rates": set_rates,
    "point_at": point_at,
    "move_to_neutral": move_to_neutral,
    "retract": retract,
    "take_control": take_control,
    "release_control": release_control,
}
"""The members of `ual.interface.Gimbal`, each with its call. Those that return an iterator are streams."""
