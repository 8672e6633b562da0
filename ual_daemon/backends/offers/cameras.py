"""Interface of a backend's cameras; see `ual_daemon.services.cameras`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import Future
from typing import NamedTuple

from ual.cameras import CameraInfo, CameraIntrinsics, CameraMode, CameraStatus, ImageFormat, ImageKind, VideoStream
from ual.geometry import Pose
from ual.types import GeoPoint


def mounted(carrier: Pose, mounting: Pose) -> Pose:
    """Returns where something is that is mounted on a carrier."""
    position = carrier.position + carrier.orientation.rotate(mounting.position)
    return Pose(position, carrier.orientation * mounting.orientation)


class Viewpoint(NamedTuple):
    """From where a picture was taken. None is what is not known.

    Attributes:
        body: The pose of the body in the backend's local frame.
        boots_count: Of the snapshot that it is from: another boot has another local frame.
        mounting: The pose of the camera in the body, x along its view, y left, z up in its picture.
        position_geo: Of the UAV, or as the camera says.

    """

    body: Pose | None = None
    boots_count: int = 0
    mounting: Pose | None = None
    position_geo: GeoPoint | None = None


class TakenPhoto(NamedTuple):
    """A picture that was taken; see `ual.cameras.Photo`."""

    number: int
    stamp_s: float
    viewpoint: Viewpoint
    is_stored: bool = True
    file_url: str = ""


class EncodedImage(NamedTuple):
    """A picture as bytes; see `ual.cameras.Image`."""

    data: bytes
    format: ImageFormat
    width_px: int
    height_px: int
    stamp_s: float
    intrinsics: CameraIntrinsics | None
    viewpoint: Viewpoint
    kind: ImageKind = ImageKind.COLOUR


class CameraDriver(ABC):
    """One camera. From any thread; no method waits.

    Each future ends by itself, also where nothing answers: with a `LinkLostError`, or with a `UalTimeoutError`. What
    the camera refuses ends it with a `RejectedByAutopilotError`. A method is called only if `info` has its ability.
    """

    @property
    @abstractmethod
    def info(self) -> CameraInfo:
        """Identity and abilities of the camera, as far as it has reported them."""

    @abstractmethod
    def status(self) -> Future[CameraStatus]:
        """Returns its present status."""

    @abstractmethod
    def photos(self, first: int) -> Sequence[TakenPhoto]:
        """Returns the photos since the daemon was started, from a number on: the last 10,000 at most."""

    @abstractmethod
    def take_photo(self) -> Future[TakenPhoto]:
        """Takes a picture. The future ends once the camera has reported that it was taken."""

    @abstractmethod
    def start_interval(self, interval_s: float, count: int) -> Future[None]:
        """Begins to take pictures by time, in place of what was begun before; 0: without an end."""

    @abstractmethod
    def start_distance(self, distance_m: float) -> Future[None]:
        """Begins to take pictures by the distance flown, the first one at once, in place of what was begun before."""

    @abstractmethod
    def stop_photos(self) -> Future[None]:
        """Ends taking pictures by time or distance."""

    def start_video(self) -> Future[None]:
        """Begins a video."""
        raise NotImplementedError  # `info` has no such ability

    def stop_video(self) -> Future[None]:
        """Ends the video."""
        raise NotImplementedError  # `info` has no such ability

    def set_mode(self, mode: CameraMode) -> Future[None]:
        """Sets its mode."""
        raise NotImplementedError  # `info` has no such ability

    def set_zoom(self, percent: float) -> Future[None]:
        """Zooms, 0 to 100."""
        raise NotImplementedError  # `info` has no such ability

    def set_focus(self, percent: float | None) -> Future[None]:
        """Focuses, 0 to 100; None: by itself, once."""
        raise NotImplementedError  # `info` has no such ability

    def streams(self) -> Future[list[VideoStream]]:
        """Returns where its videos can be watched."""
        raise NotImplementedError  # `info` has no such ability

    def image(self, photo: int | None, kind: ImageKind = ImageKind.COLOUR) -> Future[EncodedImage]:
        """Returns a picture that was taken, or what it sees now, of a kind that is in `CameraInfo.image_kinds`.

        The future ends with an `InvalidArgumentError` where it has no picture of this number, and with a
        `ResourceExhaustedError` where too many wait.
        """
        raise NotImplementedError  # `info` has no such ability


class CameraDrivers(ABC):
    """The cameras of one UAV. From any thread."""

    @abstractmethod
    def all(self) -> Sequence[CameraDriver]:
        """All that were found: each has its number as its place. None is ever removed."""
