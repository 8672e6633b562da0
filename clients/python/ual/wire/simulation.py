"""Between the messages of ``simulation.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

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
)
from ual.v1 import simulation_pb2 as pb
from ual.wire import convert
from ual.wire.enums import member_of

_COMMAND: Mapping[int, Command] = {each.value: each for each in Command}


def link_lost_to_proto(_: LinkLost) -> pb.LinkLost:
    """Makes a message."""
    return pb.LinkLost()


def link_lost_from_proto(_: pb.LinkLost) -> LinkLost:
    """Reads a message."""
    return LinkLost()


def position_lost_to_proto(_: PositionLost) -> pb.PositionLost:
    """Makes a message."""
    return pb.PositionLost()


def position_lost_from_proto(_: pb.PositionLost) -> PositionLost:
    """Reads a message."""
    return PositionLost()


def estimator_jumps_to_proto(value: EstimatorJumps) -> pb.EstimatorJumps:
    """Makes a message."""
    return pb.EstimatorJumps(
        offset=convert.vector3_to_proto(value.offset),
        period_s=value.period_s,
    )


def estimator_jumps_from_proto(message: pb.EstimatorJumps) -> EstimatorJumps:
    """Reads a message."""
    return EstimatorJumps(
        convert.vector3_from_proto(convert.with_part(message, "offset", "fault.estimator_jumps.offset").offset),
        message.period_s,
    )


def motors_weak_to_proto(value: MotorsWeak) -> pb.MotorsWeak:
    """Makes a message."""
    return pb.MotorsWeak(
        power_ratio=value.power_ratio,
    )


def motors_weak_from_proto(message: pb.MotorsWeak) -> MotorsWeak:
    """Reads a message."""
    return MotorsWeak(
        message.power_ratio,
    )


def battery_low_to_proto(value: BatteryLow) -> pb.BatteryLow:
    """Makes a message."""
    return pb.BatteryLow(
        remaining_percent=value.remaining_percent,
    )


def battery_low_from_proto(message: pb.BatteryLow) -> BatteryLow:
    """Reads a message."""
    return BatteryLow(
        message.remaining_percent,
    )


def command_refused_to_proto(value: CommandRefused) -> pb.CommandRefused:
    """Makes a message."""
    return pb.CommandRefused(
        command=pb.Command.ValueType(value.command.value),
        text=value.text,
    )


def command_refused_from_proto(message: pb.CommandRefused) -> CommandRefused:
    """Reads a message."""
    return CommandRefused(
        member_of(message.command, _COMMAND, "fault.command_refused.command", Command.ANY),
        message.text,
    )


def ack_lost_to_proto(value: AckLost) -> pb.AckLost:
    """Makes a message."""
    return pb.AckLost(
        command=pb.Command.ValueType(value.command.value),
    )


def ack_lost_from_proto(message: pb.AckLost) -> AckLost:
    """Reads a message."""
    return AckLost(
        member_of(message.command, _COMMAND, "fault.ack_lost.command", Command.ANY),
    )


def ack_late_to_proto(value: AckLate) -> pb.AckLate:
    """Makes a message."""
    return pb.AckLate(
        command=pb.Command.ValueType(value.command.value),
        delay_s=value.delay_s,
    )


def ack_late_from_proto(message: pb.AckLate) -> AckLate:
    """Reads a message."""
    return AckLate(
        member_of(message.command, _COMMAND, "fault.ack_late.command", Command.ANY),
        message.delay_s,
    )


def failsafe_triggered_to_proto(value: FailsafeTriggered) -> pb.FailsafeTriggered:
    """Makes a message."""
    return pb.FailsafeTriggered(
        cause=value.cause,
    )


def failsafe_triggered_from_proto(message: pb.FailsafeTriggered) -> FailsafeTriggered:
    """Reads a message."""
    return FailsafeTriggered(
        message.cause,
    )


def fault_to_proto(value: Fault) -> pb.Fault:
    """Makes a message. Raises `InvalidArgumentError` for what is none of its kinds."""
    match value:
        case LinkLost():
            return pb.Fault(link_lost=link_lost_to_proto(value))
        case PositionLost():
            return pb.Fault(position_lost=position_lost_to_proto(value))
        case EstimatorJumps():
            return pb.Fault(estimator_jumps=estimator_jumps_to_proto(value))
        case MotorsWeak():
            return pb.Fault(motors_weak=motors_weak_to_proto(value))
        case BatteryLow():
            return pb.Fault(battery_low=battery_low_to_proto(value))
        case CommandRefused():
            return pb.Fault(command_refused=command_refused_to_proto(value))
        case AckLost():
            return pb.Fault(ack_lost=ack_lost_to_proto(value))
        case AckLate():
            return pb.Fault(ack_late=ack_late_to_proto(value))
        case FailsafeTriggered():
            return pb.Fault(failsafe_triggered=failsafe_triggered_to_proto(value))
    raise convert.no_kind(value, "fault")


def fault_from_proto(message: pb.Fault) -> Fault:
    """Reads a message. Raises `InvalidArgumentError` where no kind is set."""
    match message.WhichOneof("kind"):
        case "link_lost":
            return link_lost_from_proto(message.link_lost)
        case "position_lost":
            return position_lost_from_proto(message.position_lost)
        case "estimator_jumps":
            return estimator_jumps_from_proto(message.estimator_jumps)
        case "motors_weak":
            return motors_weak_from_proto(message.motors_weak)
        case "battery_low":
            return battery_low_from_proto(message.battery_low)
        case "command_refused":
            return command_refused_from_proto(message.command_refused)
        case "ack_lost":
            return ack_lost_from_proto(message.ack_lost)
        case "ack_late":
            return ack_late_from_proto(message.ack_late)
        case "failsafe_triggered":
            return failsafe_triggered_from_proto(message.failsafe_triggered)
        case _:
            raise convert.not_set("fault.kind")


def active_fault_to_proto(value: tuple[str, Fault]) -> pb.ActiveFault:
    """Makes a message."""
    fault_id, fault = value
    return pb.ActiveFault(
        fault_id=fault_id,
        fault=fault_to_proto(fault),
    )


def active_fault_from_proto(message: pb.ActiveFault) -> tuple[str, Fault]:
    """Reads a message."""
    return (
        message.fault_id,
        fault_from_proto(message.fault),
    )
