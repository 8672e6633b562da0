"""The cameras of a UAV in ROS, but for their topics. It needs no ROS: requests are known by their fields."""

from __future__ import annotations

from collections.abc import Awaitable

import ual
from ual.cameras import (
    CameraAbility,
    CameraInfo,
    CameraMode,
    CameraStatus,
    Image,
    ImageFormat,
    ImageKind,
    Photo,
    VideoStream,
)
from ual_ros2 import pictures, values
from ual_ros2.beside.fields import Fields, Stamp, made, name_of, named, names_of, pose_stamped, ratio
from ual_ros2.messages import Message

MOST_PHOTOS = 100
"""So many are in one answer: to make messages of 10,000 takes a second, in which nothing else is served."""
MIB = 1024 * 1024


async def list_all(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListCameras."""
    return {"cameras": [info_fields(each) for each in await uav.cameras.get_all()]}


async def get_status(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GetCameraStatus."""
    return {"status": status_fields(await uav.cameras[request.camera].status())}


async def take_photo(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves TakePhoto."""
    return {"photo": photo_fields(request.camera, await uav.cameras[request.camera].take_photo())}


def start_photos(uav: ual.aio.Uav, request: Message) -> Awaitable[object]:
    """Serves StartPhotos. An interval or a distance of 0 is none."""
    interval_s, distance_m = request.interval or None, request.distance or None
    return uav.cameras[request.camera].start_photos(interval_s=interval_s, distance_m=distance_m, count=request.count)


async def list_photos(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves ListPhotos."""
    found = await uav.cameras[request.camera].photos(request.first)
    return {"photos": [photo_fields(request.camera, each) for each in found[:MOST_PHOTOS]]}


async def list_streams(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves ListVideoStreams."""
    return {"streams": [stream_fields(each) for each in await uav.cameras[request.camera].streams()]}


async def get_image(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GetImage."""
    kind = named(ImageKind, request.kind, "kind", ImageKind.COLOUR)
    photo = request.photo if request.is_photo else None
    image = await uav.cameras[request.camera].image(photo, kind, max_age_s=request.max_age)
    return image_fields(uav.ns, request.camera, image)


def set_mode(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves SetCameraMode."""
    return uav.cameras[request.camera].set_mode(named(CameraMode, request.mode, "mode"))


def set_zoom(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves SetCameraZoom."""
    return uav.cameras[request.camera].set_zoom(100.0 * request.zoom)


def set_focus(uav: ual.aio.Uav, request: Message) -> Awaitable[None]:
    """Serves SetCameraFocus."""
    return uav.cameras[request.camera].set_focus(None if request.is_automatic else 100.0 * request.focus)


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
        return [photo_fields(number, each) for each in new]


def info_fields(info: CameraInfo) -> Fields:
    """Returns a Camera."""
    known = info.intrinsics
    size = (info.width_px, info.height_px) if known is None else (known.width_px, known.height_px)
    return {
        "number": info.number,
        "name": info.name,
        "firmware_version": info.firmware_version,
        "abilities": names_of(info.abilities),
        "image_kinds": names_of(info.image_kinds),
        "is_connected": info.is_connected,
        "width": info.width_px,
        "height": info.height_px,
        "camera_info": made(pictures.fill_camera_info, *size, known),
        "note": info.note,
    }


def status_fields(status: CameraStatus) -> Fields:
    """Returns a CameraStatus."""
    return {
        "mode": name_of(status.mode),
        "is_taking_photos": status.is_taking_photos,
        "interval": values.known(status.interval_s),
        "distance": values.known(status.distance_m),
        "is_recording": status.is_recording,
        "recording_time": status.recording_s,
        "photos_count": status.photos_count,
        "missed_count": status.missed_count,
        "storage": name_of(status.storage.state),
        "storage_total": _bytes(status.storage.total_mib),
        "storage_available": _bytes(status.storage.available_mib),
        "zoom": ratio(status.zoom_percent),
        "focus": ratio(status.focus_percent),
        "battery": ratio(status.battery_percent),
    }


def photo_fields(camera: int, photo: Photo) -> Fields:
    """Returns a Photo."""
    return {
        "camera": camera,
        "number": photo.number,
        "is_stored": photo.is_stored,
        "viewpoint": viewpoint_fields(photo),
        "file_url": photo.file_url,
    }


def viewpoint_fields(taken: Photo | Image) -> Fields:
    """Returns a Viewpoint."""
    camera, at = taken.camera, taken.position_geo
    optical = None if camera is None else ual.PoseStamped(pictures.optical(camera.pose), camera.frame_id)
    return {
        "stamp": Stamp(taken.stamp_s),
        "body": pose_stamped(taken.body, taken.stamp_s),
        "optical": pose_stamped(optical, taken.stamp_s),
        "position": {
            "header": {"stamp": Stamp(taken.stamp_s)},
            "latitude": values.known(None if at is None else at.latitude_deg),
            "longitude": values.known(None if at is None else at.longitude_deg),
            "altitude": values.known(None if at is None else at.altitude_ellipsoid_m),
        },
        "altitude_amsl": values.known(None if at is None else at.altitude_amsl_m),
        "altitude_home": values.known(None if at is None else at.altitude_home_m),
    }


def stream_fields(stream: VideoStream) -> Fields:
    """Returns a VideoStream."""
    return {
        "name": stream.name,
        "url": stream.url,
        "encoding": stream.encoding,
        "width": stream.width_px,
        "height": stream.height_px,
        "rate": stream.rate_hz,
        "is_running": stream.is_running,
        "is_thermal": stream.is_thermal,
    }


def image_fields(ns: str, camera: int, image: Image) -> Fields:
    """Returns what GetImage answers."""
    header = {"frame_id": pictures.optical_frame_of(ns, camera), "stamp": Stamp(image.stamp_s)}
    is_distances = image.format is ImageFormat.FLOAT32
    fill = pictures.fill_distances if is_distances else pictures.fill_compressed
    info = made(pictures.fill_camera_info, image.width_px, image.height_px, image.intrinsics)
    return {
        "distances" if is_distances else "compressed": {"header": header, **made(fill, image)},
        "camera_info": {"header": header, **info},
        "viewpoint": viewpoint_fields(image),
    }


def _bytes(mib: float | None) -> float:
    return values.known(None if mib is None else mib * MIB)
