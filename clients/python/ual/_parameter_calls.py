"""Every call of `ParameterService`; see `ual._calls`. ``make clients`` writes `ual.interface.Parameters` from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, built, of
from ual.parameters.values import Parameter
from ual.v1 import parameters_pb2 as pb
from ual.wire import parameters as convert


def get(name: str) -> Call[Parameter]:
    request = built(lambda: pb.GetParameterRequest(name=name), "name", name)
    return of("GetParameter", request, convert.of_response)


def get_all() -> Call[list[Parameter]]:
    def read(response: pb.ListParametersResponse) -> list[Parameter]:
        return [convert.from_proto(each) for each in response.parameters]

    return of("ListParameters", pb.ListParametersRequest(), read)


def set_(name: str, value: float, force: bool) -> Call[Parameter]:
    request = built(lambda: pb.SetParameterRequest(name=name, value=value, force=force), "value", value)
    return of("SetParameter", request, convert.of_response)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {"get": get, "get_all": get_all, "set": set_}
"""The members of `ual.interface.Parameters`, each with its call."""
