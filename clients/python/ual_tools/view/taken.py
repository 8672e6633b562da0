"""Pictures of a UAV's cameras, as far as its daemon has announced them to the page."""

from __future__ import annotations

from collections import defaultdict, deque
from contextlib import suppress
from typing import NamedTuple

from ual.cameras import CameraAbility, CameraInfo, CameraIntrinsics, Image, Photo
from ual.errors import DaemonUnreachableError, NotSupportedError, UalError, UalTimeoutError
from ual.interface import Cameras
from ual.shared.new_photos import NewPhotos

MOST_PLACES = 300
"""Of one UAV: older ones are not drawn any more."""
_PHOTOS_CHECK_S = 1.0
_MOST_LATE_PHOTOS = 3


class NewestPicture(NamedTuple):
    """The picture that was taken last. `lens` is None where the camera does not know it, `image` where none came."""

    number: int
    photo: Photo
    lens: CameraIntrinsics | None
    image: Image | None


class Taken:
    """Asks once a second. One thread asks, and another one may read `photos` and `newest`."""

    def __init__(self) -> None:
        self.photos: tuple[Photo, ...] = ()
        """The last ones, of all cameras, oldest first."""
        self.newest: NewestPicture | None = None
        self._kept: deque[Photo] = deque(maxlen=MOST_PLACES)
        self._new: defaultdict[int, NewPhotos] = defaultdict(NewPhotos)
        self._requested: tuple[int, Photo] | None = None
        """The camera and the picture whose bytes were requested last."""
        self._late_count = 0
        """Times that the bytes of the picture did not come in time."""
        self._due_s = 0.0
        self._has_cameras = True

    def poll(self, cameras: Cameras, now_s: float, *, wants_image: bool) -> None:
        """Asks what was taken, and gets the last picture if it is wanted.

        What is not answered is asked again. The bytes of a picture are so where the daemon was not reached, and twice
        where they did not come in time. A camera that has refused them may not have them.
        """
        if not self._has_cameras or now_s < self._due_s:
            return
        self._due_s = now_s + _PHOTOS_CHECK_S
        try:
            found = cameras.get_all()
        except NotSupportedError:  # by this backend: so it stays
            self._has_cameras = False
        except UalError:
            return
        else:
            for info in found:
                with suppress(UalError):  # one camera that does not answer keeps none from being asked
                    self._poll_camera(info, cameras, wants_image=wants_image)

    def _poll_camera(self, info: CameraInfo, cameras: Cameras, *, wants_image: bool) -> None:
        camera = cameras[info.number]
        for photo in self._new[info.number].of(camera):
            self._kept.append(photo)
            self.newest = NewestPicture(info.number, photo, info.intrinsics, None)
            self._late_count = 0
            self.photos = tuple(self._kept)
        newest = self.newest
        if newest is None or newest.number != info.number or newest[:2] == self._requested:
            return
        if wants_image and CameraAbility.IMAGE in info.abilities:
            self._requested = newest.number, newest.photo
            try:
                image = camera.image(newest.photo.number)
            except DaemonUnreachableError:
                self._requested = None
                raise
            except UalTimeoutError:  # a busy computer, or a bad link
                self._late_count += 1
                if self._late_count < _MOST_LATE_PHOTOS:
                    self._requested = None
                raise
            self._late_count = 0
            self.newest = newest._replace(image=image, lens=image.intrinsics or newest.lens)
