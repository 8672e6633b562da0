"""Writes pictures as PNG, by zlib alone: https://www.w3.org/TR/png-3/."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_SUB_FILTER_TYPE = 1
"""The filter of each row: what is written is the difference to the pixel before."""
_COMPRESSION_LEVEL, _MEMORY = 1, 9


def encode(picture: NDArray[np.uint8]) -> bytes:
    """Returns the file of rows of columns of red, green, blue.

    Noise costs most, and only Huffman's coding makes it smaller. So only runs are searched for besides: of 640 x 480
    pixels with noise it takes 8 ms, where the search for repetitions takes 15, and finds none.
    """
    height_px, width_px, _ = picture.shape
    rows = np.empty((height_px, 1 + 3 * width_px), np.uint8)
    rows[:, 0] = _SUB_FILTER_TYPE
    plain = picture.reshape(height_px, 3 * width_px)
    rows[:, 1:4] = plain[:, :3]
    np.subtract(plain[:, 3:], plain[:, :-3], out=rows[:, 4:])
    packer = zlib.compressobj(_COMPRESSION_LEVEL, zlib.DEFLATED, zlib.MAX_WBITS, _MEMORY, zlib.Z_RLE)
    data = packer.compress(rows.data) + packer.flush()
    header = struct.pack(">IIBBBBB", width_px, height_px, 8, 2, 0, 0, 0)
    return b"".join((_SIGNATURE, _chunk(b"IHDR", header), _chunk(b"IDAT", data), _chunk(b"IEND", b"")))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(data, zlib.crc32(kind)))
