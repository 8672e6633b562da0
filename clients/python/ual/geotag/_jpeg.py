"""Makes the file of a picture. Needs Pillow."""

from __future__ import annotations

import io

import PIL.Image

from ual.cameras import Image, ImageFormat
from ual.errors import InvalidArgumentError
from ual.geotag import _exif, _segments

_QUALITY_PERCENT = 95


def make(image: Image, camera: str) -> bytes:
    """See `ual.geotag.to_jpeg`."""
    if image.format not in (ImageFormat.PNG, ImageFormat.JPEG):
        raise InvalidArgumentError(f"image: {image!r} has no colours", {"field": "image"})
    try:
        picture = PIL.Image.open(io.BytesIO(image.data))
        data = image.data if image.format is ImageFormat.JPEG else _encoded(picture)
    except (OSError, SyntaxError, ValueError, PIL.Image.DecompressionBombError) as error:
        raise InvalidArgumentError(f"image: {image!r} cannot be read: {error}", {"field": "image"}) from None
    return _segments.with_metadata(data, _written(image, camera, picture), _exif.xmp(image))


def _written(image: Image, camera: str, picture: PIL.Image.Image) -> bytes:
    """Returns the tags of a picture, with its own. Those that cannot be read, or written again, are left out."""
    try:
        exif = picture.getexif()
        _exif.write(image, camera, exif)
        return exif.tobytes()
    except Exception:  # noqa: BLE001  Pillow raises half a dozen kinds of errors at tags that a camera wrote wrongly
        exif = PIL.Image.Exif()
        _exif.write(image, camera, exif)
        return exif.tobytes()


def _encoded(picture: PIL.Image.Image) -> bytes:
    written = io.BytesIO()
    picture.convert("RGB").save(written, "JPEG", quality=_QUALITY_PERCENT)
    return written.getvalue()
