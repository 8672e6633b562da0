"""`CameraService` on the event loop, on which setpoints come, too."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

from ual.cameras import Photo
from ual.v1 import camera_pb2 as pb
from ual_daemon.server.services.camera import CameraServicer


class Cameras:
    """Notes which thread lists the pictures."""

    def __init__(self) -> None:
        self.thread: threading.Thread | None = None

    def photos(self, number: int, first: int) -> list[Photo]:
        assert (number, first) == (1, 2)
        self.thread = threading.current_thread()
        return [Photo(2, 7.5)]


def test_a_long_list_of_pictures_is_not_made_on_the_event_loop() -> None:
    nothing: Any = None
    servicer = CameraServicer(nothing)
    servicer._of_vehicle = cameras = Cameras()  # type: ignore[assignment]  # all that it is asked for
    found = asyncio.run(servicer.ListPhotos(pb.ListPhotosRequest(camera=1, first=2), None))
    assert [(each.number, each.stamp.seconds, each.stamp.nanos) for each in found.photos] == [(2, 7, 500_000_000)]
    assert cameras.thread is not threading.current_thread()
