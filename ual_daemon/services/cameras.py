"""The cameras of a UAV: their requests, and the roles that may send them. The manual is docs/how-to/cameras.md.

None of it moves the UAV, so no lease is needed: what is filmed is often another program's than what is flown.
"""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future
from typing import NamedTuple

from ual.cameras import (
    CameraAbility,
    CameraInfo,
    CameraMode,
    CameraStatus,
    Image,
    ImageKind,
    Photo,
    VideoStream,
)
from ual.errors import InvalidArgumentError, NotSupportedError
from ual.geometry import PoseStamped
from ual_daemon import validation
from ual_daemon.backends.chain import shared, then
from ual_daemon.backends.offers.cameras import (
    CameraDriver,
    CameraDrivers,
    EncodedImage,
    TakenPhoto,
    Viewpoint,
    mounted,
)
from ual_daemon.flight.refusals import only_watching
from ual_daemon.services.answers import in_thread
from ual_daemon.services.vehicle import LocatedVehicle, driver_of

LONGEST_PHOTO_INTERVAL_S = 3600.0
LONGEST_DISTANCE_M = 10_000.0
SHORTEST_PHOTO_INTERVAL_S = 0.05
LEAST_DISTANCE_M = 0.1
MOST_PHOTOS = 1_000_000
OLDEST_PICTURE_S = 60.0
"""Of a picture that is shared."""


class _Ordered(NamedTuple):
    """A picture, and when it was ordered (monotonic clock)."""

    ordered_s: float
    image: Future[Image]

    def is_of_no_use(self, max_age_s: float) -> bool:
        """Returns whether it is too old, or was not made."""
        if time.monotonic() - self.ordered_s > max_age_s:
            return True
        return self.image.done() and (self.image.cancelled() or self.image.exception() is not None)


class VehicleCameras:
    """The cameras of one UAV. From any thread; no method waits."""

    def __init__(self, vehicle: LocatedVehicle) -> None:
        self._vehicle = vehicle
        self._lock = threading.Lock()
        self._newest: dict[tuple[int, ImageKind], _Ordered] = {}
        """The last picture of each camera and kind that may be shared."""

    def get_all(self) -> list[CameraInfo]:
        """See `ual.interface.Cameras`."""
        return [each.info for each in self._offer().all()]

    def status(self, number: int) -> Future[CameraStatus]:
        """See `ual.interface.Camera`."""
        return self._found(number).status()

    @in_thread  # ten thousand take 0.2 s, and setpoints wait for none
    def photos(self, number: int, first: int) -> list[Photo]:
        """See `ual.interface.Camera`."""
        first = _whole(first, "first", at_most=2**32 - 1)
        return [self._photo(each) for each in self._found(number).photos(first)]

    def take_photo(self, number: int) -> Future[Photo]:
        """See `ual.interface.Camera`."""
        return then(self._ordered(number, CameraAbility.PHOTO, "take a photo").take_photo(), self._photo)

    def start_photos(self, number: int, interval_s: float | None, distance_m: float | None, count: int) -> Future[None]:
        """See `ual.interface.Camera`."""
        if (interval_s is None) is (distance_m is None):
            raise validation.refuse("interval_s", "give either a time between two pictures, or a distance_m")
        count = _whole(count, "count", at_most=MOST_PHOTOS)
        if interval_s is not None:
            interval_s = _within(interval_s, "interval_s", SHORTEST_PHOTO_INTERVAL_S, LONGEST_PHOTO_INTERVAL_S)
            return self._ordered(number, CameraAbility.PHOTO, "take photos").start_interval(interval_s, count)
        if count:
            raise validation.refuse("count", "pictures by distance have no count")
        assert distance_m is not None
        distance_m = _within(distance_m, "distance_m", LEAST_DISTANCE_M, LONGEST_DISTANCE_M)
        return self._ordered(number, CameraAbility.PHOTO, "take photos").start_distance(distance_m)

    def stop_photos(self, number: int) -> Future[None]:
        """See `ual.interface.Camera`."""
        return self._ordered(number, CameraAbility.PHOTO, "stop taking photos").stop_photos()

    def start_video(self, number: int) -> Future[None]:
        """See `ual.interface.Camera`."""
        return self._ordered(number, CameraAbility.VIDEO, "start a video").start_video()

    def stop_video(self, number: int) -> Future[None]:
        """See `ual.interface.Camera`."""
        return self._ordered(number, CameraAbility.VIDEO, "stop the video").stop_video()

    def set_mode(self, number: int, mode: CameraMode) -> Future[None]:
        """See `ual.interface.Camera`."""
        validation.require_type(mode, CameraMode, "mode")
        return self._ordered(number, CameraAbility.MODES, "set the camera's mode").set_mode(mode)

    def set_zoom(self, number: int, percent: float) -> Future[None]:
        """See `ual.interface.Camera`."""
        percent = _within(percent, "percent", 0.0, 100.0)
        return self._ordered(number, CameraAbility.ZOOM, "zoom").set_zoom(percent)

    def set_focus(self, number: int, percent: float | None) -> Future[None]:
        """See `ual.interface.Camera`."""
        percent = None if percent is None else _within(percent, "percent", 0.0, 100.0)
        return self._ordered(number, CameraAbility.FOCUS, "focus").set_focus(percent)

    def streams(self, number: int) -> Future[list[VideoStream]]:
        """See `ual.interface.Camera`."""
        return self._able(number, CameraAbility.STREAMS).streams()

    def image(
        self, number: int, photo: int | None, kind: ImageKind = ImageKind.COLOUR, max_age_s: float = 0.0
    ) -> Future[Image]:
        """See `ual.interface.Camera`. Callers that share a picture get the same object."""
        max_age_s = _within(max_age_s, "max_age_s", 0.0, OLDEST_PICTURE_S)
        if photo is not None:
            return self._made(number, _whole(photo, "photo", at_most=2**32 - 1), kind)
        return self._recent(number, kind, max_age_s) if max_age_s else self._made(number, None, kind)

    def _made(self, number: int, photo: int | None, kind: ImageKind) -> Future[Image]:
        validation.require_type(kind, ImageKind, "kind")
        camera = self._able(number, CameraAbility.IMAGE)
        _require_kind(camera.info, kind)
        return then(camera.image(photo, kind), self._image)

    def _recent(self, number: int, kind: ImageKind, max_age_s: float) -> Future[Image]:
        """Returns a picture that was ordered within `max_age_s`; if there is none, a new one."""
        with self._lock:
            newest = self._newest.get((number, kind))
            if newest is None or newest.is_of_no_use(max_age_s):
                newest = self._newest[number, kind] = _Ordered(time.monotonic(), self._made(number, None, kind))
        return shared(newest.image)

    def _offer(self) -> CameraDrivers:
        return driver_of(self._vehicle, CameraDrivers, "cameras")  # type: ignore[type-abstract]  # it is only looked for

    def _found(self, number: int) -> CameraDriver:
        cameras = self._offer().all()
        number = _whole(number, "camera", at_most=2**32 - 1)
        if number >= len(cameras):
            have = f"0 to {len(cameras) - 1}" if cameras else "none was found"
            raise InvalidArgumentError(f"camera: there is no camera {number}: {have}", {"field": "camera"})
        return cameras[number]

    def _able(self, number: int, ability: CameraAbility) -> CameraDriver:
        camera = self._found(number)
        if ability not in camera.info.abilities:
            can = ", ".join(sorted(each.name.lower() for each in camera.info.abilities)) or "nothing"
            text = f"camera {number} ({camera.info.name}) does not offer {ability.name.lower()} (it offers: {can})"
            raise NotSupportedError(text, {"ability": ability.name.lower()})
        return camera

    def _ordered(self, number: int, ability: CameraAbility, command: str) -> CameraDriver:
        camera = self._able(number, ability)
        if self._vehicle.is_watch_only:
            raise only_watching(command)
        return camera

    def _photo(self, taken: TakenPhoto) -> Photo:
        body, camera = self._poses(taken.viewpoint)
        geo = taken.viewpoint.position_geo
        return Photo(taken.number, taken.stamp_s, taken.is_stored, body, camera, geo, taken.file_url)

    def _image(self, found: EncodedImage) -> Image:
        body, camera = self._poses(found.viewpoint)
        return Image(
            found.data,
            found.format,
            found.width_px,
            found.height_px,
            found.stamp_s,
            found.intrinsics,
            body,
            camera,
            found.viewpoint.position_geo,
            found.kind,
        )

    def _poses(self, viewpoint: Viewpoint) -> tuple[PoseStamped | None, PoseStamped | None]:
        """Returns the poses of the body and of the camera in ``<ns>/odom``."""
        if viewpoint.body is None:
            return None, None
        body = self._vehicle.in_odom(viewpoint.body, viewpoint.boots_count)
        if body is None or viewpoint.mounting is None:
            return body, None
        return body, PoseStamped(mounted(body.pose, viewpoint.mounting), body.frame_id)


def _require_kind(info: CameraInfo, kind: ImageKind) -> None:
    if kind not in info.image_kinds:
        gives = ", ".join(sorted(each.name.lower() for each in info.image_kinds)) or "none"
        text = f"camera {info.number} ({info.name}) gives no {kind.name.lower()} (it gives: {gives})"
        raise NotSupportedError(text, {"kind": kind.name.lower()})


def _within(value: float, field: str, least: float, most: float) -> float:
    value = validation.number(value, field, at_most=float("inf"))
    if not least <= value <= most:
        raise validation.refuse(field, f"{value:g} is not from {least:g} to {most:g}")
    return value


def _whole(value: int, field: str, *, at_most: int) -> int:
    validation.require_type(value, int, field)
    if not 0 <= value <= at_most:
        raise validation.refuse(field, f"{value} is not from 0 to {at_most}")
    return value
