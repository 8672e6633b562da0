"""Between the parts and faults of a simulation and their messages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum
from typing import TypeVar

from ual.errors import InvalidArgumentError
from ual.geometry import Vector3
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    FailsafeTriggered,
    Fault,
    LinkLost,
    MotorsWeak,
    PositionLost,
    SimulationPart,
)
from ual.v1 import simulation_pb2 as sim_pb
from ual.wire import convert

_E = TypeVar("_E", bound=Enum)


def fault_to_proto(fault: Fault) -> sim_pb.Fault:
    """A fault."""
    match fault:
        case LinkLost():
            return sim_pb.Fault(link_lost=sim_pb.LinkLost())
        case PositionLost():
            return sim_pb.Fault(position_lost=sim_pb.PositionLost())
        case EstimatorJumps(offset, period_s):
            jumps = sim_pb.EstimatorJumps(offset=convert.vector3_to_proto(offset), period_s=period_s)
            return sim_pb.Fault(estimator_jumps=jumps)
        case MotorsWeak(power_ratio):
            return sim_pb.Fault(motors_weak=sim_pb.MotorsWeak(power_ratio=power_ratio))
        case BatteryLow(remaining_percent):
            return sim_pb.Fault(battery_low=sim_pb.BatteryLow(remaining_percent=remaining_percent))
        case CommandRefused(command, text):
            return sim_pb.Fault(command_refused=sim_pb.CommandRefused(command=_command(command), text=text))
        case AckLost(command):
            return sim_pb.Fault(ack_lost=sim_pb.AckLost(command=_command(command)))
        case AckLate(command, delay_s):
            return sim_pb.Fault(ack_late=sim_pb.AckLate(command=_command(command), delay_s=delay_s))
        case FailsafeTriggered(cause):
            return sim_pb.Fault(failsafe_triggered=sim_pb.FailsafeTriggered(cause=cause))
    raise InvalidArgumentError(f"fault: {fault!r} is none of ual.simulation", {"field": "fault"})


def fault_from_proto(message: sim_pb.Fault, field: str = "fault") -> Fault:
    """A fault."""
    match message.WhichOneof("kind"):
        case "link_lost":
            return LinkLost()
        case "position_lost":
            return PositionLost()
        case "estimator_jumps":
            jumps = message.estimator_jumps
            if not jumps.HasField("offset"):
                raise convert.not_set(f"{field}.estimator_jumps.offset")
            return EstimatorJumps(convert.vector3_from_proto(jumps.offset), jumps.period_s)
        case "motors_weak":
            return MotorsWeak(message.motors_weak.power_ratio)
        case "battery_low":
            return BatteryLow(message.battery_low.remaining_percent)
        case "command_refused":
            refused = message.command_refused
            return CommandRefused(_enum(Command, refused.command, f"{field}.command_refused.command"), refused.text)
        case "ack_lost":
            return AckLost(_enum(Command, message.ack_lost.command, f"{field}.ack_lost.command"))
        case "ack_late":
            late = message.ack_late
            return AckLate(_enum(Command, late.command, f"{field}.ack_late.command"), late.delay_s)
        case "failsafe_triggered":
            return FailsafeTriggered(message.failsafe_triggered.cause)
        case _:
            raise convert.not_set(f"{field}.kind")


def parts_to_proto(parts: Iterable[SimulationPart]) -> sim_pb.ListPartsResponse:
    """The parts of a simulation, in a fixed order."""
    values = sorted(part.value for part in parts)
    return sim_pb.ListPartsResponse(parts=[sim_pb.SimulationPart.ValueType(value) for value in values])


def parts_from_proto(message: sim_pb.ListPartsResponse) -> frozenset[SimulationPart]:
    """The parts of a simulation. Those that only a newer client knows are left out."""
    known = {part.value for part in SimulationPart}
    return frozenset(SimulationPart(value) for value in message.parts if value in known)


def faults_to_proto(faults: Mapping[str, Fault]) -> sim_pb.ListFaultsResponse:
    """The faults under way, by their ids."""
    return sim_pb.ListFaultsResponse(
        faults=[sim_pb.ActiveFault(fault_id=key, fault=fault_to_proto(fault)) for key, fault in faults.items()]
    )


def faults_from_proto(faults: Iterable[sim_pb.ActiveFault]) -> dict[str, Fault]:
    """The faults under way, by their ids."""
    return {active.fault_id: fault_from_proto(active.fault) for active in faults}


def wind_from_proto(request: sim_pb.SetWindRequest) -> Vector3:
    """The wind of SetWind."""
    if not request.HasField("velocity_m_s"):
        raise convert.not_set("velocity_m_s")
    return convert.vector3_from_proto(request.velocity_m_s)


def place_from_proto(request: sim_pb.PlaceOnGroundRequest) -> Vector3:
    """The place of PlaceOnGround."""
    if not request.HasField("position"):
        raise convert.not_set("position")
    return convert.vector3_from_proto(request.position)


def _command(command: Command) -> sim_pb.Command.ValueType:
    return sim_pb.Command.ValueType(command.value)


def _enum(kind: type[_E], value: int, field: str) -> _E:
    try:
        return kind(value)
    except ValueError:
        known = ", ".join(f"{each.value} ({each.name})" for each in kind)
        raise InvalidArgumentError(f"{field}: {value} is none of {known}", {"field": field}) from None
