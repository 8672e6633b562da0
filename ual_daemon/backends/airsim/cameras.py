"""The cameras of a vehicle of the simulator: pictures, and those by time and by distance, which the daemon counts."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.cameras import (
    CameraAbility,
    CameraInfo,
    CameraIntrinsics,
    CameraStatus,
    ImageKind,
)
from ual.errors import InvalidArgumentError, LinkLostError
from ual.geometry import Pose
from ual_daemon.backends import futures
from ual_daemon.backends.airsim.camera_settings import NamedCamera
from ual_daemon.backends.airsim.fetching import Fetched, PictureFetcher
from ual_daemon.backends.airsim.pictures import intrinsics_of
from ual_daemon.backends.airsim.trail import Trail
from ual_daemon.backends.chain import done, then
from ual_daemon.backends.engine.distance_trigger import DistanceTrigger
from ual_daemon.backends.engine.due_photos import DuePhotos
from ual_daemon.backends.engine.photo_log import PhotoLog
from ual_daemon.backends.offers.cameras import CameraDriver, CameraDrivers, EncodedImage, TakenPhoto, Viewpoint
from ual_daemon.geodesy import Projection

MOST_KEPT_BYTES = 128 << 20
"""Of the pictures that were taken: the oldest are given up."""
_ABILITIES = frozenset({CameraAbility.PHOTO, CameraAbility.IMAGE})

_log = logging.getLogger(__name__)


class LocalFrameOrigin(NamedTuple):
    """Position of the vehicle's local frame on Earth, and the boot of the simulator."""

    boots_count: int
    projection: Projection | None


class AirsimCamera(CameraDriver):
    """One camera.

    Args:
        number: By which it is named.
        fetch: Has a picture of a camera fetched.
        trail: Where the vehicle was.
        place: Returns how its frame lies now.
        trouble: Returns why the simulator does not answer; empty while it does.

    """

    def __init__(
        self,
        number: int,
        settings: NamedCamera,
        fetch: Callable[[str, ImageKind], Future[Fetched]],
        trail: Trail,
        origin: Callable[[], LocalFrameOrigin],
        trouble: Callable[[], str],
    ) -> None:
        self.is_busy = False
        """Whether it takes pictures by time or distance, so that `step` is to be called."""
        self.settings: NamedCamera | None = settings
        """None while the simulator has no such camera."""
        self._known = settings
        self._number = number
        self._fetch = fetch
        self._trail = trail
        self._origin = origin
        self._trouble = trouble
        self._lock = threading.Lock()
        self._photos: PhotoLog[TakenPhoto] = PhotoLog()
        self._kept: OrderedDict[int, EncodedImage] = OrderedDict()
        self._kept_bytes = 0
        self._intrinsics: CameraIntrinsics | None = None
        self._by_time: _ByTime | None = None
        self._by_distance: tuple[float, DistanceTrigger] | None = None
        self._due = DuePhotos(self._number, self.take_photo, "the simulator still renders the one before")

    # --- Requests -----------------------------------------------------------------------------------------------------

    @property
    @override
    def info(self) -> CameraInfo:
        self._known = settings = self.settings or self._known
        scene = settings.capture(ImageKind.COLOUR)
        size = scene.width_px, scene.height_px
        intrinsics = self._intrinsics or intrinsics_of(settings, ImageKind.COLOUR, *size, scene.tangent)
        return CameraInfo(
            self._number,
            settings.name,
            _ABILITIES,
            self.settings is not None and not self._trouble(),
            "",
            *size,
            intrinsics,
            image_kinds=frozenset(ImageKind),
        )

    @override
    def status(self) -> Future[CameraStatus]:
        error = self._why_not()
        if error is not None:
            return futures.failed(error)
        by_time, by_distance = self._by_time, self._by_distance
        return done(
            CameraStatus(
                is_taking_photos=by_time is not None or by_distance is not None,
                interval_s=None if by_time is None else by_time.interval_s,
                distance_m=None if by_distance is None else by_distance[0],
                photos_count=self._photos.count,
                missed_count=self._due.missed_count,
            )
        )

    @override
    def photos(self, first: int) -> Sequence[TakenPhoto]:
        return self._photos.since(first)

    @override
    def take_photo(self) -> Future[TakenPhoto]:
        return then(self._encoded(ImageKind.COLOUR), self._keep)

    @override
    def image(self, photo: int | None, kind: ImageKind = ImageKind.COLOUR) -> Future[EncodedImage]:
        if photo is None:
            return self._encoded(kind)
        try:
            return done(self._taken(photo, kind))
        except InvalidArgumentError as error:
            return futures.failed(error)

    @override
    def start_interval(self, interval_s: float, count: int) -> Future[None]:
        return self._begin(_ByTime(interval_s, count), None)

    @override
    def start_distance(self, distance_m: float) -> Future[None]:
        return self._begin(None, (distance_m, DistanceTrigger(distance_m)))

    @override
    def stop_photos(self) -> Future[None]:
        with self._lock:  # also of a simulator that is not received
            self._set(None, None)
        return done(None)

    # --- Pictures by time and distance: the thread of the loop --------------------------------------------------------

    def step(self, time_s: float, pose: Pose) -> None:
        """Takes the picture that is due. Waits for nothing."""
        due_count = 0
        with self._lock:
            if self._by_time is not None:
                due_count = self._by_time.due_count(time_s)
                if self._by_time.is_over:
                    self._set(None, None)
            elif self._by_distance is not None:
                due_count = self._by_distance[1].due_count(pose.position)
        self._due.take(due_count)

    def end_boot(self) -> None:
        """Takes that the simulator was started again: nothing is in progress any more."""
        with self._lock:
            if self._by_time is not None or self._by_distance is not None:
                _log.warning("camera %d takes no more pictures: the simulator was started anew", self._number)
            self._set(None, None)

    # --- How it is done -----------------------------------------------------------------------------------------------

    def _begin(self, by_time: _ByTime | None, by_distance: tuple[float, DistanceTrigger] | None) -> Future[None]:
        error = self._why_not()
        if error is not None:
            return futures.failed(error)
        with self._lock:
            self._set(by_time, by_distance)
        return done(None)

    def _set(self, by_time: _ByTime | None, by_distance: tuple[float, DistanceTrigger] | None) -> None:
        self._by_time, self._by_distance = by_time, by_distance
        self.is_busy = by_time is not None or by_distance is not None

    def _why_not(self) -> LinkLostError | None:
        trouble = self._trouble() or ("" if self.settings is not None else "the simulator has it no more")
        return LinkLostError(f"camera {self._number} is not heard: {trouble}") if trouble else None

    def _encoded(self, kind: ImageKind) -> Future[EncodedImage]:
        error = self._why_not()
        if error is not None or self.settings is None:
            return futures.failed(error or LinkLostError(f"camera {self._number} is not heard"))
        settings, origin = self.settings, self._origin()
        return then(self._fetch(settings.name, kind), lambda found: self._read(settings, origin, kind, found))

    def _read(self, settings: NamedCamera, origin: LocalFrameOrigin, kind: ImageKind, found: Fetched) -> EncodedImage:
        picture = found.picture
        size = picture.width, picture.height
        intrinsics = intrinsics_of(settings, kind, *size, found.tangent)
        if kind is ImageKind.COLOUR:
            self._intrinsics = intrinsics
        viewpoint = self._viewpoint(origin, picture.stamp_s, picture.camera)
        return EncodedImage(found.data, found.format, *size, picture.stamp_s, intrinsics, viewpoint, kind)

    def _viewpoint(self, origin: LocalFrameOrigin, stamp_s: float, camera: Pose) -> Viewpoint:
        """Returns from where a picture was taken. The camera is where the simulator says; it may be on a gimbal."""
        body = self._trail.at(stamp_s)
        if body is None or not any(camera.orientation):
            return Viewpoint(boots_count=origin.boots_count)
        geo = None if origin.projection is None else origin.projection.to_geo(body.position)
        turn = body.orientation.inverse()
        in_body = Pose(turn.rotate(camera.position - body.position), turn * camera.orientation)
        return Viewpoint(body, origin.boots_count, in_body, geo)

    def _keep(self, image: EncodedImage) -> TakenPhoto:
        def make(number: int) -> TakenPhoto:
            self._kept[number] = image
            self._kept_bytes += len(image.data)
            return TakenPhoto(number, image.stamp_s, image.viewpoint)

        with self._lock:
            photo = self._photos.add(make)
            while self._kept_bytes > MOST_KEPT_BYTES and len(self._kept) > 1:
                self._kept_bytes -= len(self._kept.popitem(last=False)[1].data)
        return photo

    def _taken(self, photo: int, kind: ImageKind) -> EncodedImage:
        self._photos.get(photo)
        if kind is not ImageKind.COLOUR:
            raise InvalidArgumentError("photo: pictures that were taken are kept as colours", {"field": "photo"})
        with self._lock:
            kept = self._kept.get(photo)
        if kept is None:
            kept_mib = MOST_KEPT_BYTES >> 20
            text = f"photo: the bytes of picture {photo} are kept no more: only the newest {kept_mib} MiB are"
            raise InvalidArgumentError(text, {"field": "photo"})
        return kept


class _ByTime:
    """Says when pictures by time are due, by the simulator's time. The first is due at once."""

    def __init__(self, interval_s: float, count: int) -> None:
        self.interval_s = interval_s
        self._left_count = count or None
        self._begin_s: float | None = None
        self._due_before = 0

    @property
    def is_over(self) -> bool:
        return self._left_count == 0

    def due_count(self, time_s: float) -> int:
        """Returns how many were due since the last call."""
        if self._begin_s is None:
            self._begin_s = time_s
        due = int((time_s - self._begin_s) / self.interval_s + 1e-6) + 1 - self._due_before
        if self._left_count is not None:
            due = min(due, self._left_count)
            self._left_count -= max(due, 0)
        self._due_before += max(due, 0)
        return max(due, 0)


class AirsimCameras(CameraDrivers):
    """The cameras of one vehicle. One that was found keeps its number."""

    def __init__(
        self, fetcher: PictureFetcher, origin: Callable[[], LocalFrameOrigin], trouble: Callable[[], str]
    ) -> None:
        self._fetcher = fetcher
        self._origin = origin
        self._trouble = trouble
        self._trail = Trail()
        self._cameras: tuple[AirsimCamera, ...] = ()

    @override
    def all(self) -> Sequence[AirsimCamera]:
        return self._cameras

    def on_connect(self, found: Sequence[NamedCamera], has_booted: bool) -> None:
        """Takes what the simulator has, and whether it was started since the last time."""
        if has_booted:
            self._fetcher.disconnect()
            for each in self._cameras:
                each.end_boot()
        by_name = {each.name: each for each in found}
        for camera in self._cameras:
            camera.settings = by_name.pop(camera.info.name, None)
        for settings in by_name.values():
            self._cameras = (*self._cameras, self._made(settings))

    def on_report(self, time_s: float, pose: Pose) -> None:
        """Takes where the vehicle is, by the simulator's time."""
        self._trail.add(time_s, pose)
        for each in self._cameras:
            if each.is_busy:
                each.step(time_s, pose)

    def close(self) -> None:
        """Ends the thread of the pictures."""
        self._fetcher.close()

    def _made(self, settings: NamedCamera) -> AirsimCamera:
        number = len(self._cameras)
        return AirsimCamera(number, settings, self._fetcher.fetch, self._trail, self._origin, self._trouble)
