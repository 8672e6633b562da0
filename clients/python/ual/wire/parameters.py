"""Between the messages of ``parameters.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Mapping

from ual.contract.parameters import Parameter, ParameterType
from ual.v1 import parameters_pb2 as pb

_PARAMETER_TYPE: Mapping[int, ParameterType] = {each.value: each for each in ParameterType}


def parameter_to_proto(value: Parameter) -> pb.Parameter:
    """Makes a message."""
    return pb.Parameter(
        name=value.name,
        value=value.value,
        type=pb.ParameterType.ValueType(value.type.value),
        is_relied_on=value.is_relied_on,
        minimum=value.minimum,
        maximum=value.maximum,
        unit=value.unit,
        description=value.description,
        needs_reboot=value.needs_reboot,
    )


def parameter_from_proto(message: pb.Parameter) -> Parameter:
    """Reads a message."""
    return Parameter(
        message.name,
        message.value,
        _PARAMETER_TYPE.get(message.type, ParameterType.REAL32),
        message.is_relied_on,
        message.minimum if message.HasField("minimum") else None,
        message.maximum if message.HasField("maximum") else None,
        message.unit,
        message.description,
        message.needs_reboot,
    )
