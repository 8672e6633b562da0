"""Between the messages of `ParameterService` and the value types."""

from __future__ import annotations

from ual.parameters.values import Parameter, ParameterType
from ual.v1 import parameters_pb2 as pb

_KNOWN = {each.value for each in ParameterType}


def to_proto(parameter: Parameter) -> pb.Parameter:
    """Makes a message."""
    return pb.Parameter(
        name=parameter.name,
        type=pb.ParameterType.ValueType(parameter.type.value),
        value=parameter.value,
        is_relied_on=parameter.is_relied_on,
        minimum=parameter.minimum,
        maximum=parameter.maximum,
        unit=parameter.unit,
        description=parameter.description,
        needs_reboot=parameter.needs_reboot,
    )


def from_proto(message: pb.Parameter) -> Parameter:
    """Reads a message. A type that this version does not know counts as a number of 32 bits."""
    kind = ParameterType(message.type) if message.type in _KNOWN else ParameterType.REAL32
    is_integer = kind.is_whole and message.value.is_integer()
    value = int(message.value) if is_integer else message.value
    return Parameter(
        message.name,
        value,
        kind,
        message.is_relied_on,
        message.minimum if message.HasField("minimum") else None,
        message.maximum if message.HasField("maximum") else None,
        message.unit,
        message.description,
        message.needs_reboot,
    )


def of_response(response: pb.GetParameterResponse | pb.SetParameterResponse) -> Parameter:
    """Reads the parameter of a response."""
    return from_proto(response.parameter)
