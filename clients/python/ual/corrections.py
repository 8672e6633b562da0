"""Corrections for the satellite receiver of a UAV (RTK). `ual.Uav.corrections` passes them on to its autopilot."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ual._wrong_type import require
from ual.contract.corrections import CorrectionsStatus

__all__ = ["MOST_BYTES", "CorrectionsStatus", "cut"]

MOST_BYTES = 4096
"""Most bytes of RTCM 3 in one element of a stream. The clients cut what is longer."""


def cut(rtcm: Iterable[bytes]) -> Iterator[bytes]:
    """Yields a stream in pieces that one element can have. Raises `InvalidArgumentError` for what is no bytes."""
    for each in rtcm:
        yield from cut_one(each)


def cut_one(data: bytes) -> Iterator[bytes]:
    """The same for one of its pieces."""
    if not isinstance(data, (bytearray, memoryview)):
        require(data, bytes, "rtcm")
    for at in range(0, len(data), MOST_BYTES):
        yield bytes(data[at : at + MOST_BYTES])
