"""The cameras of a MAVLink vehicle: what any thread requests goes to the thread that receives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import TypeVar

from typing_extensions import override

from ual.cameras import CameraAbility, CameraInfo, CameraIntrinsics, CameraMode, CameraStatus, ImageKind, VideoStream
from ual.errors import InvalidArgumentError, LinkLostError, NotSupportedError
from ual_daemon.backends import futures
from ual_daemon.backends.chain import then
from ual_daemon.backends.engine.command import ONCE
from ual_daemon.backends.firmwares.trigger_camera import TRIGGER_DISTANCE
from ual_daemon.backends.mavlink.dialects.command_long import LongCommand, command_of
from ual_daemon.backends.mavlink.offers.http_pictures import FetchedPicture, HttpPictures
from ual_daemon.backends.mavlink.offers.protocol_access import ProtocolAccess
from ual_daemon.backends.mavlink.protocols.camera_link import CameraLink
from ual_daemon.backends.mavlink.protocols.camera_values import MODE_NUMBERS
from ual_daemon.backends.mavlink.wire.messages import mavlink
from ual_daemon.backends.offers.cameras import CameraDriver, CameraDrivers, EncodedImage, TakenPhoto

T = TypeVar("T")

_PHOTO = {"field": "photo"}


class MavlinkCamera(CameraDriver):
    """One camera.

    Args:
        link: The camera on the thread that receives.
        now_s: The backend's clock.
        reach: The way to the thread that receives.
        pictures: Fetches them.

    """

    def __init__(
        self,
        link: CameraLink,
        now_s: Callable[[], float],
        access: ProtocolAccess,
        pictures: HttpPictures,
    ) -> None:
        self._link = link
        self._now_s = now_s
        self._access = access
        self._pictures = pictures

    @property
    @override
    def info(self) -> CameraInfo:
        info = self._link.info(self._now_s())
        gives = {CameraAbility.IMAGE} if self._pictures.has_hosts and CameraAbility.PHOTO in info.abilities else set()
        return replace(info, abilities=info.abilities | gives)

    @override
    def status(self) -> Future[CameraStatus]:
        return self._run_on_loop("ask its camera", self._link.read_status)

    @override
    def photos(self, first: int) -> Sequence[TakenPhoto]:
        return self._link.photos.since(first)

    @override
    def take_photo(self) -> Future[TakenPhoto]:
        return self._run_on_loop("take a photo", self._link.shoot)

    @override
    def start_interval(self, interval_s: float, count: int) -> Future[None]:
        return self._run_on_loop("take photos", lambda future: self._link.start_interval(interval_s, count, future))

    @override
    def start_distance(self, distance_m: float) -> Future[None]:
        def start(future: Future[None]) -> None:
            if not self.info.is_connected:
                futures.fail(future, LinkLostError(f"{self._link.name} is not heard"))
                return
            self._link.start_distance(distance_m)
            futures.end(future)

        return self._run_on_loop("take photos", start)

    @override
    def stop_photos(self) -> Future[None]:
        def stop(future: Future[None]) -> None:
            if self._link.stop_distance():
                futures.end(future)
            else:
                self._link.order(mavlink.MAV_CMD_IMAGE_STOP_CAPTURE, (), future)

        return self._run_on_loop("stop taking photos", stop)

    @override
    def start_video(self) -> Future[None]:
        return self._order("start a video", mavlink.MAV_CMD_VIDEO_START_CAPTURE)

    @override
    def stop_video(self) -> Future[None]:
        return self._order("stop the video", mavlink.MAV_CMD_VIDEO_STOP_CAPTURE)

    @override
    def set_mode(self, mode: CameraMode) -> Future[None]:
        return self._order("set its camera's mode", mavlink.MAV_CMD_SET_CAMERA_MODE, 0.0, float(MODE_NUMBERS[mode]))

    @override
    def set_zoom(self, percent: float) -> Future[None]:
        return self._order("zoom", mavlink.MAV_CMD_SET_CAMERA_ZOOM, float(mavlink.ZOOM_TYPE_RANGE), percent)

    @override
    def set_focus(self, percent: float | None) -> Future[None]:
        kind = mavlink.FOCUS_TYPE_AUTO_SINGLE if percent is None else mavlink.FOCUS_TYPE_RANGE
        return self._order("focus", mavlink.MAV_CMD_SET_CAMERA_FOCUS, float(kind), percent or 0.0)

    @override
    def streams(self) -> Future[list[VideoStream]]:
        return self._run_on_loop("list its video streams", self._link.list_streams)

    @override
    def image(self, photo: int | None, kind: ImageKind = ImageKind.COLOUR) -> Future[EncodedImage]:
        if photo is None:
            return futures.failed(NotSupportedError(f"{self._link.name} gives the pictures that it took: name a photo"))
        taken = next(iter(self._link.photos.since(photo)), None)
        if taken is None or taken.number != photo:
            return futures.failed(
                InvalidArgumentError(f"photo: {self._link.name} has told of no photo {photo}", _PHOTO)
            )
        if not taken.file_url:
            return futures.failed(NotSupportedError(f"{self._link.name} has not told where its photo {photo} is"))
        intrinsics = self.info.intrinsics
        return then(self._pictures.fetch(taken.file_url), lambda found: _encoded(found, taken, intrinsics))

    def _order(self, what: str, command_id: int, *params: float) -> Future[None]:
        return self._run_on_loop(what, lambda future: self._link.order(command_id, params, future))

    def _run_on_loop(self, what: str, begin: Callable[[Future[T]], None]) -> Future[T]:
        return self._access.run_on_loop(what, lambda _, future: begin(future))


def _encoded(found: FetchedPicture, taken: TakenPhoto, intrinsics: CameraIntrinsics | None) -> EncodedImage:
    known = intrinsics if intrinsics is not None and _is_for(intrinsics, found) else None
    return EncodedImage(*found, taken.stamp_s, known, taken.viewpoint)


def trigger_order(what: str, command_id: int, params: tuple[float, ...]) -> LongCommand:
    """Returns an order to the camera that the autopilot triggers. One of a picture is sent once."""
    command = command_of(command_id, params, what, group=f"camera {command_id}")
    if command_id == TRIGGER_DISTANCE:  # what starts and what stops it have the same key
        return replace(command, is_told_by_answer=True)
    return replace(command, repeat=ONCE)


def _is_for(intrinsics: CameraIntrinsics, found: FetchedPicture) -> bool:
    return (intrinsics.width_px, intrinsics.height_px) == (found.width_px, found.height_px)


class MavlinkCameras(CameraDrivers):
    """The cameras of one backend; see `MavlinkCamera`. `found` returns those that were found; `trigger` comes first."""

    def __init__(
        self,
        found: Callable[[], Sequence[CameraLink]],
        now_s: Callable[[], float],
        access: ProtocolAccess,
        pictures: HttpPictures,
        trigger: CameraDriver | None = None,
    ) -> None:
        self._first = [] if trigger is None else [trigger]
        self._found = found
        self._now_s = now_s
        self._access = access
        self._pictures = pictures

    @override
    def all(self) -> Sequence[CameraDriver]:
        found = [MavlinkCamera(link, self._now_s, self._access, self._pictures) for link in self._found()]
        return [*self._first, *found]
