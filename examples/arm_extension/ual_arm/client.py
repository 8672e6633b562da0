"""The clients of `ArmService`, blocking and for asyncio. Written by ``tools.contract.extension``: do not edit it."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator

from typing_extensions import override

from ual.aio.extension import Link as AioLink
from ual.extension import Link
from ual_arm import wire
from ual_arm.interface import Arm
from ual_arm.v1 import arm_pb2 as pb
from ual_arm.v1.arm_pb2_grpc import ArmServiceStub
from ual_arm.values import Joints


class ArmClient(Arm):
    """`Arm`, over gRPC."""

    def __init__(self, link: Link) -> None:
        self._link = link

    @override
    def joints(self) -> Joints:
        response = self._link.call(ArmServiceStub, "GetJoints", pb.GetJointsRequest())
        return wire.joints_from_proto(response.joints)

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[Joints]:
        for response in self._link.stream(ArmServiceStub, "WatchJoints", pb.WatchJointsRequest(rate_hz=rate_hz)):
            yield wire.joints_from_proto(response.joints)

    @override
    def move(self, shoulder_rad: float, elbow_rad: float) -> Joints:
        response = self._link.call(
            ArmServiceStub, "MoveJoints", pb.MoveJointsRequest(shoulder_rad=shoulder_rad, elbow_rad=elbow_rad), 60.0
        )
        return wire.joints_from_proto(response.joints)


class AioArmClient:
    """The same for asyncio: the members of `Arm` as coroutines."""

    def __init__(self, link: AioLink) -> None:
        self._link = link

    async def joints(self) -> Joints:
        """See `Arm.joints`."""
        response = await self._link.call(ArmServiceStub, "GetJoints", pb.GetJointsRequest())
        return wire.joints_from_proto(response.joints)

    async def watch(self, rate_hz: float = 10.0) -> AsyncIterator[Joints]:
        """See `Arm.watch`."""
        async for response in self._link.stream(ArmServiceStub, "WatchJoints", pb.WatchJointsRequest(rate_hz=rate_hz)):
            yield wire.joints_from_proto(response.joints)

    async def move(self, shoulder_rad: float, elbow_rad: float) -> Joints:
        """See `Arm.move`."""
        response = await self._link.call(
            ArmServiceStub, "MoveJoints", pb.MoveJointsRequest(shoulder_rad=shoulder_rad, elbow_rad=elbow_rad), 60.0
        )
        return wire.joints_from_proto(response.joints)
