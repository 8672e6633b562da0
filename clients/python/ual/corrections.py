"""Corrections for the satellite receiver of a UAV (RTK). `ual.Uav.corrections` passes them on to its autopilot."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ual._wrong_type import require

__all__ = ["MOST_BYTES", "CorrectionsStatus", "cut"]

MOST_BYTES = 4096
"""How many bytes of RTCM 3 one element of a stream may have. The clients cut what is longer."""


@dataclass(frozen=True, slots=True)
class CorrectionsStatus:
    """What has become of the corrections since the daemon began.

    Args:
        sender: What sends now, by the name that it gave; empty where nothing does.
        messages_count: Messages of RTCM 3 that have left whole.
        bytes_count: Their bytes.
        dropped_count: Messages that were dropped: the link did not carry them, or was lost.
        too_long_count: Messages that were dropped because the way to the receiver cannot carry their length.
        skipped_bytes_count: Bytes that belonged to no whole message with a right checksum.
        age_s: Since when nothing has left; None before the first message.

    """

    sender: str = ""
    messages_count: int = 0
    bytes_count: int = 0
    dropped_count: int = 0
    too_long_count: int = 0
    skipped_bytes_count: int = 0
    age_s: float | None = None


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
