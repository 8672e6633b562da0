"""`GripperService`: the grippers, winches, servos and relays that a UAV carries."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from typing_extensions import override

from ual.v1 import gripper_pb2 as pb
from ual.v1 import gripper_pb2_grpc
from ual.wire import gripper as convert
from ual_daemon.extensions.base import lease_of
from ual_daemon.extensions.shipped.gripper import ORDER_S, EquippedVehicle, VehicleGripper
from ual_daemon.server.shipped.waiting import ended


class GripperServicer(gripper_pb2_grpc.GripperServiceServicer):
    """What one UAV carries. ``ual/v1/gripper.proto`` describes each method."""

    def __init__(self, vehicle: EquippedVehicle) -> None:
        self._gripper = VehicleGripper(vehicle)

    # Names and order are those of the contract.

    @override
    async def GetEquipment(self, request: pb.GetEquipmentRequest, context: object) -> pb.GetEquipmentResponse:
        return convert.equipment_to_proto(await ended(self._gripper.get_all(), ORDER_S, "GetEquipment"))

    @override
    async def Grip(self, request: pb.GripRequest, context: object) -> pb.GripResponse:
        await _ordered(self._gripper.grip(request.gripper, lease_of(context)), "Grip")
        return pb.GripResponse()

    @override
    async def Release(self, request: pb.ReleaseRequest, context: object) -> pb.ReleaseResponse:
        await _ordered(self._gripper.release(request.gripper, lease_of(context)), "Release")
        return pb.ReleaseResponse()

    @override
    async def OrderWinch(self, request: pb.OrderWinchRequest, context: object) -> pb.OrderWinchResponse:
        action = convert.action_from_proto(request.action)
        length_m = request.length_m if request.HasField("length_m") else None
        rate_m_s = request.rate_m_s if request.HasField("rate_m_s") else None
        order = self._gripper.order_winch(request.winch, action, length_m, rate_m_s, lease_of(context))
        await _ordered(order, "OrderWinch")
        return pb.OrderWinchResponse()

    @override
    async def SetServo(self, request: pb.SetServoRequest, context: object) -> pb.SetServoResponse:
        pwm_us = request.pwm_us if request.HasField("pwm_us") else None
        order = self._gripper.set_servo(request.servo, request.position, pwm_us, lease_of(context))
        await _ordered(order, "SetServo")
        return pb.SetServoResponse()

    @override
    async def SetRelay(self, request: pb.SetRelayRequest, context: object) -> pb.SetRelayResponse:
        await _ordered(self._gripper.set_relay(request.relay, request.state, lease_of(context)), "SetRelay")
        return pb.SetRelayResponse()


async def _ordered(order: Future[None], what: str) -> None:
    await ended(order, ORDER_S, what)


def gripper_service(vehicle: EquippedVehicle) -> tuple[str, Callable[[Any], None]]:
    """Returns the name of the service, and what registers its methods."""
    name: str = pb.DESCRIPTOR.services_by_name["GripperService"].full_name
    return name, partial(gripper_pb2_grpc.add_GripperServiceServicer_to_server, GripperServicer(vehicle))
