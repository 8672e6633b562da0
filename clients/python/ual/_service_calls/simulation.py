"""The calls of `ual.interface.Simulation`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, built, nothing, of, request
from ual._wrong_type import require
from ual.geometry import Vector3
from ual.simulation import Fault, SimulationPart
from ual.v1 import simulation_pb2 as pb
from ual.wire import convert
from ual.wire import simulation as wire


def parts() -> Call[frozenset[SimulationPart]]:
    return of(
        "ListParts",
        pb.ListPartsRequest(),
        lambda response: frozenset(
            SimulationPart(each) for each in response.parts if each in SimulationPart._value2member_map_
        ),
    )


def pilot_arm() -> Call[None]:
    return of("PilotArm", pb.PilotArmRequest(), nothing)


def pilot_disarm() -> Call[None]:
    return of("PilotDisarm", pb.PilotDisarmRequest(), nothing)


def pilot_take_over() -> Call[None]:
    return of("PilotTakeOver", pb.PilotTakeOverRequest(), nothing)


def pilot_move_sticks(forward: float, left: float, up: float, turn: float) -> Call[None]:
    return of(
        "PilotMoveSticks", request(pb.PilotMoveSticksRequest, forward=forward, left=left, up=up, turn=turn), nothing
    )


def pilot_give_back() -> Call[None]:
    return of("PilotGiveBack", pb.PilotGiveBackRequest(), nothing)


def begin_fault(fault: Fault, duration_s: float) -> Call[str]:
    return of(
        "BeginFault",
        built(lambda: pb.BeginFaultRequest(fault=wire.fault_to_proto(fault), duration_s=duration_s), "fault"),
        lambda response: response.fault_id,
    )


def end_fault(fault_id: str) -> Call[None]:
    require(fault_id, str, "fault_id")
    return of("EndFault", request(pb.EndFaultRequest, fault_id=fault_id), nothing)


def faults() -> Call[dict[str, Fault]]:
    return of(
        "ListFaults", pb.ListFaultsRequest(), lambda response: dict(map(wire.active_fault_from_proto, response.faults))
    )


def set_speed_factor(speed_factor: float) -> Call[None]:
    return of("SetSpeedFactor", request(pb.SetSpeedFactorRequest, speed_factor=speed_factor), nothing)


def step(duration_s: float) -> Call[None]:
    return of("Step", request(pb.StepRequest, duration_s=duration_s), nothing)


def set_noise(position_m: float, velocity_m_s: float) -> Call[None]:
    return of("SetNoise", request(pb.SetNoiseRequest, position_m=position_m, velocity_m_s=velocity_m_s), nothing)


def set_wind(velocity_m_s: Vector3) -> Call[None]:
    require(velocity_m_s, Vector3, "velocity_m_s")
    return of(
        "SetWind",
        built(lambda: pb.SetWindRequest(velocity_m_s=convert.vector3_to_proto(velocity_m_s)), "velocity_m_s"),
        nothing,
    )


def place_on_ground(position: Vector3, yaw_rad: float) -> Call[None]:
    require(position, Vector3, "position")
    return of(
        "PlaceOnGround",
        built(
            lambda: pb.PlaceOnGroundRequest(position=convert.vector3_to_proto(position), yaw_rad=yaw_rad), "position"
        ),
        nothing,
    )
