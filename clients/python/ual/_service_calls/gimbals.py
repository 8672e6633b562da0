"""The calls of `ual.interface.Gimbals`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, of
from ual.gimbals import GimbalInfo
from ual.v1 import gimbal_pb2 as pb
from ual.wire import gimbal as wire


def get_all() -> Call[list[GimbalInfo]]:
    return of(
        "ListGimbals",
        pb.ListGimbalsRequest(),
        lambda response: list(map(wire.gimbal_info_from_proto, response.gimbals)),
    )


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "get_all": get_all,
}
