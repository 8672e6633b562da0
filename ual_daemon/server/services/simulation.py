"""Methods that are unpack, call and pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from typing_extensions import override

from ual.v1 import simulation_pb2 as pb
from ual.wire import convert
from ual.wire import simulation as wire
from ual_daemon.server.simulation_service import SimulationServicerBase


class SimulationServicer(SimulationServicerBase):
    """The interface of one simulation. ``ual/v1/simulation.proto`` describes each method."""

    @override
    async def PilotArm(self, request: pb.PilotArmRequest, context: object) -> pb.PilotArmResponse:
        await self._act(self._simulation.pilot_arm)
        return pb.PilotArmResponse()

    @override
    async def PilotDisarm(self, request: pb.PilotDisarmRequest, context: object) -> pb.PilotDisarmResponse:
        await self._act(self._simulation.pilot_disarm)
        return pb.PilotDisarmResponse()

    @override
    async def PilotTakeOver(self, request: pb.PilotTakeOverRequest, context: object) -> pb.PilotTakeOverResponse:
        await self._act(self._simulation.pilot_take_over)
        return pb.PilotTakeOverResponse()

    @override
    async def PilotMoveSticks(self, request: pb.PilotMoveSticksRequest, context: object) -> pb.PilotMoveSticksResponse:
        await self._act(
            self._simulation.pilot_move_sticks,
            forward=request.forward,
            left=request.left,
            up=request.up,
            turn=request.turn,
        )
        return pb.PilotMoveSticksResponse()

    @override
    async def PilotGiveBack(self, request: pb.PilotGiveBackRequest, context: object) -> pb.PilotGiveBackResponse:
        await self._act(self._simulation.pilot_give_back)
        return pb.PilotGiveBackResponse()

    @override
    async def BeginFault(self, request: pb.BeginFaultRequest, context: object) -> pb.BeginFaultResponse:
        result = await self._act(
            self._simulation.begin_fault, fault=wire.fault_from_proto(request.fault), duration_s=request.duration_s
        )
        return pb.BeginFaultResponse(fault_id=result)

    @override
    async def EndFault(self, request: pb.EndFaultRequest, context: object) -> pb.EndFaultResponse:
        await self._act(self._simulation.end_fault, fault_id=request.fault_id)
        return pb.EndFaultResponse()

    @override
    async def ListFaults(self, request: pb.ListFaultsRequest, context: object) -> pb.ListFaultsResponse:
        result = await self._act(self._simulation.faults)
        return pb.ListFaultsResponse(faults=map(wire.active_fault_to_proto, result.items()))

    @override
    async def SetNoise(self, request: pb.SetNoiseRequest, context: object) -> pb.SetNoiseResponse:
        await self._act(self._simulation.set_noise, position_m=request.position_m, velocity_m_s=request.velocity_m_s)
        return pb.SetNoiseResponse()

    @override
    async def SetWind(self, request: pb.SetWindRequest, context: object) -> pb.SetWindResponse:
        await self._act(
            self._simulation.set_wind,
            velocity_m_s=convert.vector3_from_proto(
                convert.with_part(request, "velocity_m_s", "velocity_m_s").velocity_m_s
            ),
        )
        return pb.SetWindResponse()

    @override
    async def PlaceOnGround(self, request: pb.PlaceOnGroundRequest, context: object) -> pb.PlaceOnGroundResponse:
        await self._act(
            self._simulation.place_on_ground,
            position=convert.vector3_from_proto(convert.with_part(request, "position", "position").position),
            yaw_rad=request.yaw_rad,
        )
        return pb.PlaceOnGroundResponse()
