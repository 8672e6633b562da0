"""Every call of `ParameterService`; see `ual._calls`. ``make clients`` writes `ual.interface.Parameters` from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, Service, built
from ual.parameters.values import Parameter
from ual.v1 import parameters_pb2 as pb
from ual.wire import parameters as convert

ONE_S = 30.0
"""How long one parameter may take: the daemon gives up before, also where it waits for others."""
ALL_S = 630.0
"""How long the list may take: the daemon gives up before."""
_NOT_KNOWN = "it is not known whether it was written: read it"


def get(name: str) -> Call[Parameter]:
    request = built(lambda: pb.GetParameterRequest(name=name), "name", name)
    return Call(Service.PARAMETERS, "GetParameter", request, convert.of_response, ONE_S)


def get_all() -> Call[list[Parameter]]:
    def read(response: pb.ListParametersResponse) -> list[Parameter]:
        return [convert.from_proto(each) for each in response.parameters]

    return Call(Service.PARAMETERS, "ListParameters", pb.ListParametersRequest(), read, ALL_S)


def set_(name: str, value: float, force: bool) -> Call[Parameter]:
    request = built(lambda: pb.SetParameterRequest(name=name, value=value, force=force), "value", value)
    return Call(Service.PARAMETERS, "SetParameter", request, convert.of_response, ONE_S, _NOT_KNOWN)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {"get": get, "get_all": get_all, "set": set_}
"""The members of `ual.interface.Parameters`, each with its call."""
