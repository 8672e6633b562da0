"""The topics of the cameras of one UAV: pictures are fetched while they are heard."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable

from sensor_msgs.msg import CameraInfo, CompressedImage, Image

import ual
from ual.cameras import CameraAbility, ImageKind
from ual.cameras import CameraInfo as Described
from ual.cameras import Image as Picture
from ual_ros2 import pictures, topics
from ual_ros2.messages import Entity
from ual_ros2.ros_time import RosTime
from ual_ros2.services.fields import Stamp
from ual_ros2.services.filling import Filling

_log = logging.getLogger(__name__)

LOOK_S = 2.0
"""Seconds between two questions to the daemon for its cameras."""
_TOPICS = {
    ImageKind.COLOUR: ("image/compressed", CompressedImage, pictures.compressed),
    ImageKind.SEGMENTATION: ("segmentation/compressed", CompressedImage, pictures.compressed),
    ImageKind.DEPTH: ("depth/image", Image, pictures.distances),
    ImageKind.RANGE: ("range/image", Image, pictures.distances),
}


class RosCameras:
    """All cameras of one UAV. Only the event loop calls it.

    Args:
        node: Has the topics.
        uav: The client.
        ns: Its name.
        time: The node's clock.
        tell: Publishes where frames are, at a time.
        rate_hz: How often a picture that is heard is fetched.

    """

    def __init__(
        self,
        node: Entity,
        uav: ual.aio.Uav,
        ns: str,
        time: RosTime,
        tell: Callable[[Iterable[ual.Transform], float], object],
        rate_hz: float,
    ) -> None:
        self._node = node
        self._uav = uav
        self._ns = ns
        self._time = time
        self._tell = tell
        self._period_s = 1.0 / rate_hz
        self._cameras: dict[int, _Camera] = {}

    def destroy(self) -> None:
        """Ends the topics."""
        for camera in self._cameras.values():
            camera.destroy()

    async def follow(self) -> None:
        """Publishes for ever what is heard. One camera that is slow delays no other."""
        following: dict[int, asyncio.Task[None]] = {}
        try:
            while True:
                for each in await self._found():
                    if each.number not in self._cameras:
                        self._cameras[each.number] = self._made(each)
                    if each.number not in following:
                        following[each.number] = asyncio.create_task(self._cameras[each.number].follow())
                await asyncio.sleep(LOOK_S)
                for ended in filter(asyncio.Task.done, following.values()):
                    ended.result()  # only a mistake in this program ends one: `follow` ends, too, so that it is said
        finally:
            for task in following.values():
                task.cancel()

    async def _found(self) -> list[Described]:
        try:
            listed = await self._uav.cameras.get_all()
        except ual.UalError:  # it has none, or the daemon is not there: which `state` tells
            return []
        return [each for each in listed if CameraAbility.IMAGE in each.abilities]

    def _made(self, described: Described) -> _Camera:
        return _Camera(self._node, self._uav, self._ns, described, self._time, self._tell, self._period_s)


class _Camera:
    """One camera."""

    def __init__(
        self,
        node: Entity,
        uav: ual.aio.Uav,
        ns: str,
        described: Described,
        time: RosTime,
        tell: Callable[[Iterable[ual.Transform], float], object],
        period_s: float,
    ) -> None:
        self._node = node
        self._camera = uav.cameras[described.number]
        self._ns = ns
        self._number = described.number
        self._filling = Filling(time)
        self._tell = tell
        self._period_s = period_s
        self._trouble = ""
        self._told_s: dict[ImageKind, float] = {}
        self._info = self._publisher(CameraInfo, "camera_info")
        self._images = {kind: self._publisher(_TOPICS[kind][1], _TOPICS[kind][0]) for kind in described.image_kinds}

    def destroy(self) -> None:
        for publisher in (self._info, *self._images.values()):
            self._node.destroy_publisher(publisher)

    async def follow(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            begun_s = loop.time()
            for kind in self._subscribed():
                await self._fetch(kind)
            await asyncio.sleep(max(0.0, begun_s + self._period_s - loop.time()))

    def _subscribed(self) -> list[ImageKind]:
        heard = [kind for kind, publisher in self._images.items() if topics.has_subscribers(publisher)]
        if not heard and ImageKind.COLOUR in self._images and topics.has_subscribers(self._info):
            return [ImageKind.COLOUR]
        return heard

    async def _fetch(self, kind: ImageKind) -> None:
        try:
            image = await self._camera.image(kind=kind, max_age_s=0.5 * self._period_s)
        except ual.UalError as error:
            self._note(f"{error.reason}: {error.message}")
            return
        self._note("")
        if image.stamp_s != self._told_s.get(kind):
            self._told_s[kind] = image.stamp_s
            self._publish(kind, image)

    def _publish(self, kind: ImageKind, image: Picture) -> None:
        self._tell(pictures.links(self._ns, self._number, image), image.stamp_s)
        header = {"frame_id": pictures.optical_frame_of(self._ns, self._number), "stamp": Stamp(image.stamp_s)}
        _, make, fields = _TOPICS[kind]
        self._images[kind].publish(self._filling.filled(make(), {"header": header, **fields(image)}))
        if topics.has_subscribers(self._info):
            info = {"header": header, **pictures.camera_info(image)}
            self._info.publish(self._filling.filled(CameraInfo(), info))

    def _note(self, trouble: str) -> None:
        """Says once why no pictures come."""
        if trouble and trouble != self._trouble:
            _log.warning("%s: camera %d gives no picture: %s", self._ns, self._number, trouble)
        self._trouble = trouble

    def _publisher(self, kind: Entity, name: str) -> Entity:
        topic = f"/{self._ns}/ual/camera_{self._number}/{name}"
        return self._node.create_publisher(kind, topic, **topics.overridable(topics.SENSOR_DATA))
