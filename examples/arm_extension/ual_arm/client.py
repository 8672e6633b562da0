"""The arm through the daemon: what `ual.Uav.extension("arm")` returns."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator

from typing_extensions import override

from ual.aio.extension import Link as AioLink
from ual.extension import Link
from ual_arm.interface import Arm, Joints
from ual_arm.v1 import arm_pb2 as pb
from ual_arm.v1.arm_pb2_grpc import ArmServiceStub

_LONGEST_S = 60.0
"""Most seconds of a movement."""


class ArmClient(Arm):
    """The arm of one UAV."""

    def __init__(self, link: Link) -> None:
        self._link = link

    @override
    def joints(self) -> Joints:
        return _from_proto(self._link.call(ArmServiceStub, "GetJoints", pb.GetJointsRequest()).joints)

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[Joints]:
        for response in self._link.stream(ArmServiceStub, "WatchJoints", pb.WatchJointsRequest(rate_hz=rate_hz)):
            yield _from_proto(response.joints)

    @override
    def move(self, shoulder_rad: float, elbow_rad: float) -> Joints:
        request = pb.MoveJointsRequest(shoulder_rad=shoulder_rad, elbow_rad=elbow_rad)
        return _from_proto(self._link.call(ArmServiceStub, "MoveJoints", request, _LONGEST_S).joints)


class AioArmClient:
    """The same for asyncio: the members of `Arm` as coroutines."""

    def __init__(self, link: AioLink) -> None:
        self._link = link

    async def joints(self) -> Joints:
        """Returns where the joints are."""
        return _from_proto((await self._link.call(ArmServiceStub, "GetJoints", pb.GetJointsRequest())).joints)

    async def watch(self, rate_hz: float = 10.0) -> AsyncIterator[Joints]:
        """Yields where the joints are, so many times a second."""
        request = pb.WatchJointsRequest(rate_hz=rate_hz)
        async for response in self._link.stream(ArmServiceStub, "WatchJoints", request):
            yield _from_proto(response.joints)

    async def move(self, shoulder_rad: float, elbow_rad: float) -> Joints:
        """Moves both joints, and returns when they are there; see `Arm.move`."""
        request = pb.MoveJointsRequest(shoulder_rad=shoulder_rad, elbow_rad=elbow_rad)
        return _from_proto((await self._link.call(ArmServiceStub, "MoveJoints", request, _LONGEST_S)).joints)


def _from_proto(joints: pb.Joints) -> Joints:
    return Joints(joints.shoulder_rad, joints.elbow_rad, joints.is_moving)
