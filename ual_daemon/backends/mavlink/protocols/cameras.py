"""The cameras of a vehicle: components of its system with ids of their own, which send heartbeats.

https://mavlink.io/en/services/camera.html, version 2.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from typing_extensions import override

from ual.errors import LinkLostError
from ual_daemon.backends.engine.agreement import Agreement
from ual_daemon.backends.mavlink.dialects.command_long import request_message
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.camera_link import CameraLink, Carried
from ual_daemon.backends.mavlink.protocols.camera_trigger import AutopilotCameraTrigger
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.offers.cameras import Viewpoint

_log = logging.getLogger(__name__)

COMPONENTS = range(mavlink.MAV_COMP_ID_CAMERA, mavlink.MAV_COMP_ID_CAMERA6 + 1)
"""The component ids of cameras."""
MESSAGE_IDS = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
        mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION,
        mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS,
        mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION,
        mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS,
        mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED,
        mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
    }
)
"""Messages of cameras that are taken; everything else is not even decoded."""


class CameraProtocol(Protocol):
    """Belongs to the thread that receives; `found` is for any thread. `send` sends a message.

    `may_be_flying` is whether the vehicle may be in flight: none is taken for another one then.

    A camera keeps its number while the daemon runs, also if nothing is received from it any more.
    """

    def __init__(self, send: Callable[[Message], object], may_be_flying: Callable[[], bool] = lambda: False) -> None:
        self.found: tuple[CameraLink, ...] = ()
        self.trigger = AutopilotCameraTrigger()
        """Trigger of the autopilot itself."""
        self.first_number = 0
        """The number of the camera that is found first. Set by the backend."""
        self.look: Callable[[], Viewpoint] = Viewpoint
        """Returns from where a picture is taken now. Set by the backend; never blocks."""
        self.carried: Carried = lambda _device_id, _body: None
        """Returns how what is on the gimbal of a device id is mounted now. Set by the backend; never blocks."""
        self._send = send
        self._may_be_flying = may_be_flying
        self._doubted: dict[int, Agreement[bool]] = {}
        """The components that have reported once that they are cameras."""
        self._target: MessageSource | None = None
        self._by_component: dict[int, CameraLink] = {}

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return self.trigger.handlers

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        if self._target is not None and self._target.system_id != target.system_id:
            self.drop("another autopilot was found")
            self._by_component.clear()
            self._doubted.clear()
        self._target = target

    @override
    def drop(self, why: str) -> None:
        for each in self.found:
            each.drop(LinkLostError(f"{each.name} was given up: {why}"))
        self.trigger.drop(LinkLostError(f"the autopilot's camera was given up: {why}"))

    @override
    def tick(self, now_s: float) -> None:
        for each in self.found:
            each.tick(now_s)
        self.trigger.tick(now_s)

    def on_component(self, source: MessageSource, message: Message, now_s: float, utc_now_s: float) -> None:
        """Takes a message of a component of the vehicle that has a camera's id."""
        camera = self._by_component.get(source.component_id)
        message_id = message.get_msgId()
        is_heartbeat = message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and message.type == mavlink.MAV_TYPE_CAMERA
        says_camera = is_heartbeat or message_id == mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION
        if camera is None and says_camera and self._is_sure(source, now_s):
            camera = self._add(source)
        if camera is not None and is_heartbeat:
            camera.on_heartbeat(now_s)
        elif camera is not None and message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            camera.on_message(message, now_s, utc_now_s)

    def _is_sure(self, source: MessageSource, now_s: float) -> bool:
        """Returns whether a component has reported twice that it is a camera: it keeps its number for good. Else it is
        asked.
        """
        there = self._doubted.setdefault(source.component_id, Agreement(assumed=False, count=2, span_s=0.0))
        if there.note(True, now_s, is_flying=False):
            del self._doubted[source.component_id]
            return True
        self._send(request_message(mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION).request.encode(source, 0))
        return False

    def _add(self, source: MessageSource) -> CameraLink:
        camera = CameraLink(
            self.first_number + len(self.found), source, self._send, self.look, self.carried, self._may_be_flying
        )
        self._by_component[source.component_id] = camera
        self.found = (*self.found, camera)
        _log.info("camera %d was found: component %d", camera.number, source.component_id)
        return camera
