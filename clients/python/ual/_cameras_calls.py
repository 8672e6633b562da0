"""The calls of `CameraService` that are about all cameras: one function for each member of `ual.interface.Cameras`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ual._calls import Call, of
from ual.cameras import CameraInfo
from ual.v1 import camera_pb2 as pb
from ual.wire import cameras as convert


def get_all() -> Call[list[CameraInfo]]:
    def read(response: pb.ListCamerasResponse) -> list[CameraInfo]:
        return [convert.info_from_proto(each) for each in response.cameras]

    return of("ListCameras", pb.ListCamerasRequest(), read)


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {"get_all": get_all}
"""The members of `ual.interface.Cameras`, each with its call."""
