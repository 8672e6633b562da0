"""Pictures that were taken, written as files with their places (``ual camera fetch``)."""

from __future__ import annotations

import re
from datetime import datetime, timezone
from pathlib import Path

from ual import geotag
from ual.cameras import Photo
from ual.errors import (
    DaemonUnreachableError,
    InvalidArgumentError,
    PermissionDeniedError,
    UalError,
    UnauthenticatedError,
)
from ual.interface import Uav
from ual.shared import extras, whole_file

_EXTRA = "ual-tools[geotag]"
_ENDS = (DaemonUnreachableError, UnauthenticatedError, PermissionDeniedError)
"""Errors that the next picture would meet, too."""


class Fetching:
    """Fetches pictures of one camera into a directory, which it makes.

    Raises:
        InvalidArgumentError: There is no such camera, or the directory cannot be written.
        NotSupportedError: Pillow is not installed.

    """

    def __init__(self, uav: Uav, number: int, directory: Path) -> None:
        with extras.needs("a picture with its place", _EXTRA):
            import PIL.Image  # noqa: F401  before a camera is asked
        self._camera = uav.cameras[number]
        self._ns = re.sub(r"[^A-Za-z0-9_-]", "_", uav.info().namespace)
        self._number = number
        self._names = {each.number: each.name for each in uav.cameras.get_all()}
        self._directory = directory
        self.error: UalError | None = None

    def fetch(self, photo: Photo) -> tuple[Path, str]:
        """Writes a picture, unless it is there. Returns its file, and what was done.

        One that cannot be had keeps none after it from being written: `error` is why the last one was not.
        """
        file = self._directory / self._name(photo)
        if not photo.is_stored:
            return file, "failed, the camera says"
        if file.exists():
            return file, "is there"
        try:
            image = self._camera.image(photo.number)
            data = geotag.to_jpeg(image, self._names.get(self._number, ""), _EXTRA)
        except _ENDS:
            raise
        except UalError as error:
            self.error = error
            return file, f"failed: {error.message}"
        self._write(file, data)
        return file, "written" if image.position_geo is not None else "written, place not known"

    def _name(self, photo: Photo) -> str:
        """Returns a name that no other picture has: numbers begin again with each daemon."""
        taken = datetime.fromtimestamp(photo.stamp_s, timezone.utc)
        stamp = f"{taken:%Y%m%dT%H%M%S}{taken.microsecond // 1000:03d}"
        return f"{self._ns}_camera_{self._number}_{stamp}_{photo.number:05d}.jpg"

    def _write(self, file: Path, data: bytes) -> None:
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            whole_file.write(file, data)
        except OSError as error:
            raise InvalidArgumentError(f"{file}: {error.strerror}", {"field": "directory"}) from None
