"""The gimbal through the daemon: what `ual.Uav.extension("gimbal")` returns."""

from __future__ import annotations

from collections.abc import Iterator

from typing_extensions import override

from ual.extension import Link
from ual.geometry import PointStamped
from ual_gimbal.interface import Attitude, Gimbal
from ual_gimbal.v1 import gimbal_pb2 as pb
from ual_gimbal.v1.gimbal_pb2_grpc import GimbalServiceStub


class GimbalClient(Gimbal):
    """The gimbal of one UAV."""

    def __init__(self, link: Link) -> None:
        self._link = link

    @override
    def attitude(self) -> Attitude:
        return _from_proto(self._link.call(GimbalServiceStub, "GetAttitude", pb.GetAttitudeRequest()).attitude)

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[Attitude]:
        for response in self._link.stream(GimbalServiceStub, "WatchAttitude", pb.WatchAttitudeRequest(rate_hz=rate_hz)):
            yield _from_proto(response.attitude)

    @override
    def point(self, pitch_rad: float, yaw_rad: float) -> None:
        request = pb.PointRequest(attitude=pb.Attitude(pitch_rad=pitch_rad, yaw_rad=yaw_rad))
        self._link.call(GimbalServiceStub, "Point", request)

    @override
    def point_at(self, point: PointStamped) -> None:
        p = point.point
        request = pb.PointAtRequest(frame_id=point.frame_id, x_m=p.x, y_m=p.y, z_m=p.z)
        self._link.call(GimbalServiceStub, "PointAt", request)


def _from_proto(attitude: pb.Attitude) -> Attitude:
    return Attitude(attitude.pitch_rad, attitude.yaw_rad)
