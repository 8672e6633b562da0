"""The calls of `GimbalService` that are about all gimbals: one function for each member of `ual.interface.Gimbals`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, of
from ual.gimbals import GimbalInfo
from ual.v1 import gimbal_pb2 as pb
from ual.wire import gimbals as convert


def get_all() -> Call[list[GimbalInfo]]:
    def read(response: pb.ListGimbalsResponse) -> list[GimbalInfo]:
        return [convert.info_from_proto(each) for each in response.gimbals]

    return of("ListGimbals", pb.ListGimbalsRequest(), read)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {"get_all": get_all}
"""The members of `ual.interface.Gimbals`, each with its call."""
