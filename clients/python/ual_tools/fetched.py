"""Pictures that were taken, written as files with their places (``ual camera fetch``)."""

from __future__ import annotations

import re
from datetime import datetime, timezone
from pathlib import Path

from ual import geotag
from ual.cameras import Photo
from ual.errors import InvalidArgumentError
from ual.interface import Uav

_EXTRA = "ual-tools[geotag]"


class Fetching:
    """Fetches pictures of one camera into a directory, which it makes.

    Raises:
        InvalidArgumentError: There is no such camera, or the directory cannot be written.

    """

    def __init__(self, uav: Uav, number: int, directory: Path) -> None:
        self._camera = uav.cameras[number]
        self._ns = re.sub(r"[^A-Za-z0-9_-]", "_", uav.info().namespace)
        self._number = number
        self._names = {each.number: each.name for each in uav.cameras.get_all()}
        self._directory = directory

    def fetch(self, photo: Photo) -> tuple[Path, str]:
        """Writes a picture, unless it is there. Returns its file, and what was done."""
        file = self._directory / self._name(photo)
        if not photo.is_stored:
            return file, "failed, the camera says"
        if file.exists():
            return file, "is there"
        image = self._camera.image(photo.number)
        self._write(file, geotag.to_jpeg(image, self._names.get(self._number, ""), _EXTRA))
        return file, "written" if image.position_geo is not None else "written, place not known"

    def _name(self, photo: Photo) -> str:
        """Returns a name that no other picture has: numbers begin again with each daemon."""
        taken = datetime.fromtimestamp(photo.stamp_s, timezone.utc)
        stamp = f"{taken:%Y%m%dT%H%M%S}{taken.microsecond // 1000:03d}"
        return f"{self._ns}_camera_{self._number}_{stamp}_{photo.number:05d}.jpg"

    def _write(self, file: Path, data: bytes) -> None:
        unfinished = file.with_suffix(".part")
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            unfinished.write_bytes(data)
            unfinished.replace(file)
        except OSError as error:
            raise InvalidArgumentError(f"{file}: {error.strerror}", {"field": "directory"}) from None
