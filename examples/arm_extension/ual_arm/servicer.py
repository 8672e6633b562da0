"""`ArmService`: roles, and unpack, call, pack. Written by ``tools.contract.extension``: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

from typing_extensions import override

from ual.access.roles import Role
from ual_arm import wire
from ual_arm.interface import Arm
from ual_arm.v1 import arm_pb2 as pb
from ual_arm.v1 import arm_pb2_grpc

ROLES: Mapping[str, Role] = {
    "GetJoints": Role.OBSERVER,
    "WatchJoints": Role.OBSERVER,
    "MoveJoints": Role.PILOT,
}
"""The role that each method needs."""


class ArmServicerBase(arm_pb2_grpc.ArmServiceServicer):
    """Methods of `ArmService` that are unpack, call and pack."""

    def __init__(self, served: Arm) -> None:
        self._served = served

    @override
    async def GetJoints(self, request: pb.GetJointsRequest, context: object) -> pb.GetJointsResponse:
        result = self._served.joints()
        return pb.GetJointsResponse(joints=wire.joints_to_proto(result))
