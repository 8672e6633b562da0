"""The calls of `ual.interface.Parameters`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from ual._calls import Call, of, request
from ual._wrong_type import require
from ual.parameters.values import Parameter
from ual.shared.flags import flag
from ual.v1 import parameters_pb2 as pb
from ual.wire import parameters as wire


def get(name: str) -> Call[Parameter]:
    require(name, str, "name")
    return of(
        "GetParameter",
        request(pb.GetParameterRequest, name=name),
        lambda response: wire.parameter_from_proto(response.parameter),
    )


def get_all() -> Call[list[Parameter]]:
    return of(
        "ListParameters",
        pb.ListParametersRequest(),
        lambda response: list(map(wire.parameter_from_proto, response.parameters)),
    )


def set_(name: str, value: float, force: bool) -> Call[Parameter]:
    require(name, str, "name")
    return of(
        "SetParameter",
        request(pb.SetParameterRequest, name=name, value=value, force=flag(force, "force")),
        lambda response: wire.parameter_from_proto(response.parameter),
    )
