"""`SimulationService`: the world around a simulated vehicle. Offered by simulated backends only."""

from __future__ import annotations

import asyncio

from typing_extensions import override

from ual import _convert
from ual.interface import Simulation
from ual.v1 import simulation_pb2 as pb
from ual.v1 import simulation_pb2_grpc

_SLICE_S = 1.0
_LONGEST_STEP_S = 3600.0


class SimulationServicer(simulation_pb2_grpc.SimulationServiceServicer):
    """The interface of one simulation. ``ual/v1/simulation.proto`` describes each method.

    The members of a simulation may block (a step, the pilot's switches), so each runs on a worker thread.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    # Names and order are those of the contract.

    @override
    async def PilotArm(self, request: pb.PilotArmRequest, context: object) -> pb.PilotArmResponse:
        await asyncio.to_thread(self._simulation.pilot_arm)
        return pb.PilotArmResponse()

    @override
    async def PilotDisarm(self, request: pb.PilotDisarmRequest, context: object) -> pb.PilotDisarmResponse:
        await asyncio.to_thread(self._simulation.pilot_disarm)
        return pb.PilotDisarmResponse()

    @override
    async def PilotTakeOver(self, request: pb.PilotTakeOverRequest, context: object) -> pb.PilotTakeOverResponse:
        await asyncio.to_thread(self._simulation.pilot_take_over)
        return pb.PilotTakeOverResponse()

    @override
    async def PilotMoveSticks(self, request: pb.PilotMoveSticksRequest, context: object) -> pb.PilotMoveSticksResponse:
        await asyncio.to_thread(
            self._simulation.pilot_move_sticks,
            forward=request.forward,
            left=request.left,
            up=request.up,
            turn=request.turn,
        )
        return pb.PilotMoveSticksResponse()

    @override
    async def PilotGiveBack(self, request: pb.PilotGiveBackRequest, context: object) -> pb.PilotGiveBackResponse:
        await asyncio.to_thread(self._simulation.pilot_give_back)
        return pb.PilotGiveBackResponse()

    @override
    async def BeginFault(self, request: pb.BeginFaultRequest, context: object) -> pb.BeginFaultResponse:
        fault = _convert.fault_from_proto(request.fault)
        return pb.BeginFaultResponse(
            fault_id=await asyncio.to_thread(self._simulation.begin_fault, fault, request.duration_s)
        )

    @override
    async def EndFault(self, request: pb.EndFaultRequest, context: object) -> pb.EndFaultResponse:
        await asyncio.to_thread(self._simulation.end_fault, request.fault_id)
        return pb.EndFaultResponse()

    @override
    async def ListFaults(self, request: pb.ListFaultsRequest, context: object) -> pb.ListFaultsResponse:
        return _convert.faults_to_proto(await asyncio.to_thread(self._simulation.faults))

    @override
    async def SetSpeedFactor(self, request: pb.SetSpeedFactorRequest, context: object) -> pb.SetSpeedFactorResponse:
        await asyncio.to_thread(self._simulation.set_speed_factor, request.speed_factor)
        return pb.SetSpeedFactorResponse()

    @override
    async def Step(self, request: pb.StepRequest, context: object) -> pb.StepResponse:
        # A thread cannot be interrupted: slices let a step end with its caller, or with the daemon. A duration that is
        # not allowed is passed on as it is, to be refused.
        left_s = request.duration_s
        while 2.0 * _SLICE_S < left_s <= _LONGEST_STEP_S:
            await asyncio.to_thread(self._simulation.step, _SLICE_S)
            left_s -= _SLICE_S
        await asyncio.to_thread(self._simulation.step, left_s)
        return pb.StepResponse()

    @override
    async def SetNoise(self, request: pb.SetNoiseRequest, context: object) -> pb.SetNoiseResponse:
        await asyncio.to_thread(
            self._simulation.set_noise, position_m=request.position_m, velocity_m_s=request.velocity_m_s
        )
        return pb.SetNoiseResponse()

    @override
    async def SetWind(self, request: pb.SetWindRequest, context: object) -> pb.SetWindResponse:
        await asyncio.to_thread(self._simulation.set_wind, _convert.wind_from_proto(request))
        return pb.SetWindResponse()
