"""Fetches pictures on a connection of its own: the simulator serves the requests of one connection in turn.

A request of a picture holds one of the simulator's few threads until it has rendered it: for ever, if it renders
nothing. Without a free thread it takes no setpoint. So there is never more than one request without an answer.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple, TypeVar

from ual.cameras import ImageFormat, ImageKind
from ual.errors import LinkLostError, RejectedByAutopilotError, UalError, UalTimeoutError
from ual_daemon import logs
from ual_daemon.backends.airsim.pictures import AirsimPicture, CameraState, EmptyPictureError, data_of, request_of
from ual_daemon.backends.airsim.rpc import RemoteError, RpcConnection
from ual_daemon.backends.airsim.settings import AirsimAddress
from ual_daemon.backends.engine.picture_worker import PictureWorker

T = TypeVar("T")

_log = logging.getLogger(__name__)

PICTURE_TIMEOUT_S = 10.0
"""Seconds that the simulator may take for a picture, ..."""
QUEUED_PICTURE_TIMEOUT_S = 15.0
"""... and when one that has waited for others is given up."""
_CAMERA_S = 2.0
_OTHER_COUNT, _IS_EXTERNAL = "number of arguments", False
_LARGEST_ANSWER_BYTES = 1 << 27
"""A picture of distances of 4096 x 4096 pixels has 84 MB."""


_WHY = "does it run with a display (-RenderOffscreen, and not -nullrhi)?"


class Fetched(NamedTuple):
    """A picture, its bytes, and the tangent of half the view of the camera's scene (see `CameraState.tangent`)."""

    picture: AirsimPicture
    data: bytes
    format: ImageFormat
    tangent: float | None


class PictureFetcher:
    """Fetches one picture after another. From any thread; `vehicle` returns the vehicle's name in the simulator."""

    def __init__(self, address: AirsimAddress, thread_name: str, vehicle: Callable[[], str]) -> None:
        self._address = address
        self._vehicle = vehicle
        self._worker = PictureWorker(thread_name)
        self._lock = threading.Lock()
        self._connection: RpcConnection | None = None
        self._overdue_since_s = math.nan
        self._is_closed = False
        self._more: tuple[object, ...] = ()
        """Further argument of Microsoft's simulator: whether the camera is an external one."""
        self.patience_s = PICTURE_TIMEOUT_S

    def fetch(self, camera: str, kind: ImageKind) -> Future[Fetched]:
        """Fetches a picture of a camera, by its name. The future fails within `QUEUED_PICTURE_TIMEOUT_S`."""
        deadline_s = time.monotonic() + QUEUED_PICTURE_TIMEOUT_S
        return self._worker.submit(lambda: self._fetched(camera, kind, deadline_s))

    def disconnect(self) -> None:
        """Closes the connection; the next picture makes a new one."""
        with self._lock:
            connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()

    def close(self) -> None:
        """Ends the thread. A picture that is waited for is given up."""
        with self._lock:
            self._is_closed = True
        self.disconnect()
        self._worker.close()

    # --- On its thread ------------------------------------------------------------------------------------------------

    def _fetched(self, camera: str, kind: ImageKind, deadline_s: float) -> Fetched:
        try:
            connection = self._connected()
            self._require_answered(connection)
            return self._ask(connection, camera, kind, min(self.patience_s, deadline_s - time.monotonic()))
        except (RemoteError, EmptyPictureError) as error:
            text = str(error)
            raise RejectedByAutopilotError(f"the simulator made no picture: {text}", {"text": text}) from None
        except UalError:
            raise
        except (OSError, ValueError) as error:
            self.disconnect()
            raise LinkLostError(f"the simulator sent no picture: {error or repr(error)}") from None

    def _ask(self, connection: RpcConnection, camera: str, kind: ImageKind, patience_s: float) -> Fetched:
        request = [request_of(camera, kind)]
        found = self._call(connection, list[AirsimPicture], patience_s, "simGetImages", request, self._vehicle())
        if not found:
            raise EmptyPictureError("it sent none")
        data, encoding = data_of(found[0], kind)
        # A camera that has given a picture is there. The simulator ends if it is asked about one that is not.
        state = self._call(connection, CameraState, _CAMERA_S, "simGetCameraInfo", camera, self._vehicle())
        return Fetched(found[0], data, encoding, state.tangent)

    def _call(self, connection: RpcConnection, kind: type[T], patience_s: float, method: str, *arguments: object) -> T:
        try:
            return self._answered(connection, kind, patience_s, method, *arguments, *self._more)
        except RemoteError as error:
            if self._more or _OTHER_COUNT not in str(error):
                raise
            self._more = (_IS_EXTERNAL,)
            return self._answered(connection, kind, patience_s, method, *arguments, *self._more)

    def _answered(
        self, connection: RpcConnection, kind: type[T], patience_s: float, method: str, *arguments: object
    ) -> T:
        number = connection.request(method, *arguments)
        if not connection.has_answer(number, patience_s):
            connection.give_up(number)
            self._overdue_since_s = time.monotonic() - patience_s
            logs.event(_log, logging.WARNING, "picture_not_rendered", method=method)
            raise UalTimeoutError(f"the simulator has not rendered a picture within {patience_s:.1f} s: {_WHY}")
        return connection.answer(kind, number, 0.0)

    def _require_answered(self, connection: RpcConnection) -> None:
        connection.drain()
        if connection.unwanted_count:
            late_s = time.monotonic() - self._overdue_since_s
            raise UalTimeoutError(f"the simulator still renders a picture requested {late_s:.0f} s ago: {_WHY}")

    def _connected(self) -> RpcConnection:
        with self._lock:
            if self._is_closed:
                raise ConnectionAbortedError("the backend is closed")
            if self._connection is None:
                self._connection = RpcConnection(self._address, _LARGEST_ANSWER_BYTES)
            return self._connection
