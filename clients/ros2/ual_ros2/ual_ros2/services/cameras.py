"""Pictures of cameras in ROS, but for their topics. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

import ual
from ual.cameras import CameraAbility, Image, ImageFormat, ImageKind, Photo
from ual_ros2 import pictures
from ual_ros2.derived.values import photo_fields
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields, Stamp, named

MOST_PHOTOS = 100
"""Most photos in one answer: to make messages of 10,000 takes a second, in which nothing else is served."""


async def take_photo(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves TakePhoto."""
    return {"photo": photo_of(request.camera, await uav.cameras[request.camera].take_photo())}


async def list_photos(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves ListPhotos."""
    found = await uav.cameras[request.camera].photos(request.first)
    return {"photos": [photo_of(request.camera, each) for each in found[:MOST_PHOTOS]]}


async def get_image(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GetImage."""
    kind = named(ImageKind, request.kind, "kind", ImageKind.COLOUR)
    photo = request.photo if request.is_photo else None
    image = await uav.cameras[request.camera].image(photo, kind, max_age_s=request.max_age)
    return image_fields(uav.ns, request.camera, image)


class Photos:
    """The pictures that are taken while a topic is heard, each one once."""

    def __init__(self) -> None:
        self._next: dict[int, int] = {}

    async def begin(self, uav: ual.aio.Uav) -> None:
        """Leaves out what was taken until now: `list_photos` has it."""
        self._next.clear()
        for number in await self._cameras(uav):
            listed = await uav.cameras[number].photos()
            self._next[number] = listed[-1].number + 1 if listed else 0

    async def get_new(self, uav: ual.aio.Uav) -> list[Fields]:
        """Returns what was taken since the last call."""
        return [each for number in await self._cameras(uav) for each in await self._new_of(uav, number)]

    async def _cameras(self, uav: ual.aio.Uav) -> list[int]:
        return [each.number for each in await uav.cameras.get_all() if CameraAbility.PHOTO in each.abilities]

    async def _new_of(self, uav: ual.aio.Uav, number: int) -> list[Fields]:
        """The last one that is known is asked for, too: where it is not there, a daemon has begun anew."""
        first = self._next.get(number, 0)
        listed = await uav.cameras[number].photos(max(0, first - 1))
        if first and not listed:
            first, listed = 0, await uav.cameras[number].photos()
        new = [each for each in listed if each.number >= first][:MOST_PHOTOS]
        self._next[number] = new[-1].number + 1 if new else first
        return [photo_of(number, each) for each in new]


def photo_of(camera: int, photo: Photo) -> Fields:
    """Returns a Photo of the camera of a number."""
    return {"camera": camera, **photo_fields(photo)}


def image_fields(ns: str, camera: int, image: Image) -> Fields:
    """Returns what GetImage answers."""
    header = {"frame_id": pictures.optical_frame_of(ns, camera), "stamp": Stamp(image.stamp_s)}
    is_distances = image.format is ImageFormat.FLOAT32
    picture = pictures.distances(image) if is_distances else pictures.compressed(image)
    return {
        "distances" if is_distances else "compressed": {"header": header, **picture},
        "camera_info": {"header": header, **pictures.camera_info(image)},
        "viewpoint": pictures.viewpoint(image),
    }
