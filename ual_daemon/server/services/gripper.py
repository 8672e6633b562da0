"""`GripperService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from typing_extensions import override

from ual.v1 import gripper_pb2 as pb
from ual.v1 import gripper_pb2_grpc
from ual.wire import gripper as wire
from ual_daemon.extensions.base import lease_of
from ual_daemon.server.services.waiting import answer
from ual_daemon.services.gripper import EquippedVehicle, VehicleGripper


class GripperServicer(gripper_pb2_grpc.GripperServiceServicer):
    """The methods of `GripperService` for one UAV. ``ual/v1/gripper.proto`` describes each of them."""

    def __init__(self, vehicle: EquippedVehicle) -> None:
        self._of_vehicle = VehicleGripper(vehicle)

    @override
    async def GetEquipment(self, request: pb.GetEquipmentRequest, context: object) -> pb.GetEquipmentResponse:
        result = await answer(self._of_vehicle.get_all(), "GetEquipment")
        return wire.equipment_to_proto(result)

    @override
    async def Grip(self, request: pb.GripRequest, context: object) -> pb.GripResponse:
        await answer(self._of_vehicle.grip(gripper=request.gripper, lease_id=lease_of(context)), "Grip")
        return pb.GripResponse()

    @override
    async def Release(self, request: pb.ReleaseRequest, context: object) -> pb.ReleaseResponse:
        await answer(self._of_vehicle.release(gripper=request.gripper, lease_id=lease_of(context)), "Release")
        return pb.ReleaseResponse()

    @override
    async def OrderWinch(self, request: pb.OrderWinchRequest, context: object) -> pb.OrderWinchResponse:
        await answer(
            self._of_vehicle.order_winch(
                winch=request.winch,
                action=wire.winch_action_from_proto(request.action, "action"),
                length_m=request.length_m if request.HasField("length_m") else None,
                rate_m_s=request.rate_m_s if request.HasField("rate_m_s") else None,
                lease_id=lease_of(context),
            ),
            "OrderWinch",
        )
        return pb.OrderWinchResponse()

    @override
    async def SetServo(self, request: pb.SetServoRequest, context: object) -> pb.SetServoResponse:
        await answer(
            self._of_vehicle.set_servo(
                servo=request.servo,
                position=request.position,
                pwm_us=request.pwm_us if request.HasField("pwm_us") else None,
                lease_id=lease_of(context),
            ),
            "SetServo",
        )
        return pb.SetServoResponse()

    @override
    async def SetRelay(self, request: pb.SetRelayRequest, context: object) -> pb.SetRelayResponse:
        await answer(
            self._of_vehicle.set_relay(relay=request.relay, state=request.state, lease_id=lease_of(context)), "SetRelay"
        )
        return pb.SetRelayResponse()
