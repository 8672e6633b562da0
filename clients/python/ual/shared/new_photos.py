"""Tells each picture of a camera once, also where its daemon was started again meanwhile."""

from __future__ import annotations

from ual.cameras import Photo
from ual.interface import Camera


class NewPhotos:
    """Of one camera. Numbers begin again with each daemon: the last picture then is not the one that was reported."""

    def __init__(self) -> None:
        self._last: Photo | None = None

    def of(self, camera: Camera) -> list[Photo]:
        """Returns what was taken since the last call, oldest first; at first, all."""
        last = self._last
        found = camera.photos(0 if last is None else last.number)
        if last is not None:
            is_same = bool(found) and (found[0].number, found[0].stamp_s) == (last.number, last.stamp_s)
            found = found[1:] if is_same else camera.photos(0)
        self._last = found[-1] if found else last
        return found
