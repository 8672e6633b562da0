"""Makes the file of a picture. Needs Pillow."""

from __future__ import annotations

import io

import PIL.Image

from ual.cameras import Image, ImageFormat
from ual.errors import InvalidArgumentError
from ual.geotag import _exif, _segments

_QUALITY = 95


def make(image: Image, camera: str) -> bytes:
    """See `ual.geotag.to_jpeg`."""
    if image.format not in (ImageFormat.PNG, ImageFormat.JPEG):
        raise InvalidArgumentError(f"image: {image!r} has no colours", {"field": "image"})
    try:
        picture = PIL.Image.open(io.BytesIO(image.data))
        data = image.data if image.format is ImageFormat.JPEG else _encoded(picture)
    except (OSError, SyntaxError) as error:
        raise InvalidArgumentError(f"image: {image!r} cannot be read: {error}", {"field": "image"}) from None
    exif = picture.getexif()
    _exif.write(image, camera, exif)
    return _segments.with_metadata(data, exif.tobytes(), _exif.xmp(image))


def _encoded(picture: PIL.Image.Image) -> bytes:
    written = io.BytesIO()
    picture.convert("RGB").save(written, "JPEG", quality=_QUALITY)
    return written.getvalue()
