"""The gimbal through the daemon: what `ual.Uav.extension("gimbal")` returns."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator

from typing_extensions import override

from ual.aio.extension import Link as AioLink
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
        self._link.call(GimbalServiceStub, "PointAt", _target(point))


class AioGimbalClient:
    """The same for asyncio: the members of `Gimbal` as coroutines."""

    def __init__(self, link: AioLink) -> None:
        self._link = link

    async def attitude(self) -> Attitude:
        """Returns where it points; see `Gimbal.attitude`."""
        return _from_proto((await self._link.call(GimbalServiceStub, "GetAttitude", pb.GetAttitudeRequest())).attitude)

    async def watch(self, rate_hz: float = 10.0) -> AsyncIterator[Attitude]:
        """Yields where it points, so many times a second."""
        request = pb.WatchAttitudeRequest(rate_hz=rate_hz)
        async for response in self._link.stream(GimbalServiceStub, "WatchAttitude", request):
            yield _from_proto(response.attitude)

    async def point(self, pitch_rad: float, yaw_rad: float) -> None:
        """Points in a direction relative to the UAV; see `Gimbal.point`."""
        request = pb.PointRequest(attitude=pb.Attitude(pitch_rad=pitch_rad, yaw_rad=yaw_rad))
        await self._link.call(GimbalServiceStub, "Point", request)

    async def point_at(self, point: PointStamped) -> None:
        """Points at a position in any frame, and keeps pointing at it; see `Gimbal.point_at`."""
        await self._link.call(GimbalServiceStub, "PointAt", _target(point))


def _target(point: PointStamped) -> pb.PointAtRequest:
    p = point.point
    return pb.PointAtRequest(frame_id=point.frame_id, x_m=p.x, y_m=p.y, z_m=p.z)


def _from_proto(attitude: pb.Attitude) -> Attitude:
    return Attitude(attitude.pitch_rad, attitude.yaw_rad)
