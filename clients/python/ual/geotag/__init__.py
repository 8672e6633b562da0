"""Pictures as JPEG files that say where they were taken, for programs that make maps of them.

Needs the extra `geotag`. The manual is ``docs/how-to/cameras.md``.
"""

from __future__ import annotations

from ual.cameras import Image
from ual.shared import extras

__all__ = ["to_jpeg"]


def to_jpeg(image: Image, camera: str = "", extra: str = "ual-client[geotag]") -> bytes:
    """Returns a picture as a JPEG file, with its place, time, direction and focal length.

    The pixels of one that is JPEG already stay as they are, and so do its own tags that say nothing of these.

    Args:
        image: A picture of colours.
        camera: The name of the camera (`CameraInfo.name`), by which programs tell cameras apart.
        extra: What to install where Pillow is missing.

    Raises:
        InvalidArgumentError: It is not one of colours, or cannot be read.
        NotSupportedError: Pillow is not installed.

    """
    with extras.needs("a picture with its place", extra):
        from ual.geotag import _jpeg
    return _jpeg.make(image, camera)
