"""The segments at the begin of a JPEG file, in which it says what it is: ITU-T T.81, annex B."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from ual.errors import InvalidArgumentError

_START = b"\xff\xd8"
_APP0, _APP1, _LAST_APP = 0xE0, 0xE1, 0xEF
EXIF, XMP = b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/\0"
_SEGMENT_BYTES = 0xFFFF - 2


def with_metadata(jpeg: bytes, exif: bytes, xmp: bytes) -> bytes:
    """Returns the file with these EXIF tags in place of its own, and with this XMP, unless it has some already.

    `exif` begins with `EXIF`. Without any `xmp` there is nothing of it to be written.
    """
    rest, kept = _split(jpeg)
    own_xmp = any(each[4:].startswith(XMP) for each in kept)
    first = [each for each in kept if each[1] == _APP0]
    others = [each for each in kept if each[1] != _APP0 and not each[4:].startswith(EXIF)]
    added = [_segment(exif), *([_segment(XMP + xmp)] if xmp and not own_xmp else [])]
    return b"".join((_START, *first, *added, *others, rest))


def _split(jpeg: bytes) -> tuple[bytes, list[bytes]]:
    """Returns what follows the segments of applications, and these."""
    if not jpeg.startswith(_START):
        raise InvalidArgumentError("the picture is no JPEG file", {"field": "image"})
    segments = list(_segments(jpeg))
    return jpeg[len(_START) + sum(map(len, segments)) :], segments


def _segments(jpeg: bytes) -> Iterator[bytes]:
    at = len(_START)
    while at + 4 <= len(jpeg):
        marker, kind, size = struct.unpack_from(">BBH", jpeg, at)
        if marker != 0xFF or not _APP0 <= kind <= _LAST_APP:
            return
        yield jpeg[at : at + 2 + size]
        at += 2 + size


def _segment(content: bytes) -> bytes:
    if len(content) > _SEGMENT_BYTES:
        raise InvalidArgumentError(
            f"image: it says {len(content)} bytes of itself, and at most {_SEGMENT_BYTES} fit in"
        )
    return struct.pack(">BBH", 0xFF, _APP1, len(content) + 2) + content
