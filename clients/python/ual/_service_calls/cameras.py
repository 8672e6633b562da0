"""The calls of `ual.interface.Cameras`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, of
from ual.cameras import CameraInfo
from ual.v1 import camera_pb2 as pb
from ual.wire import camera as wire


def get_all() -> Call[list[CameraInfo]]:
    return of(
        "ListCameras",
        pb.ListCamerasRequest(),
        lambda response: list(map(wire.camera_info_from_proto, response.cameras)),
    )


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "get_all": get_all,
}
