"""Checksums of frames: what tells a frame from garbage before anything in it is believed."""

from __future__ import annotations

from fastcrc import crc16
from pymavlink.dialects.v20 import all as mavlink

_EXTRA = {message_id: kind.crc_extra for message_id, kind in mavlink.mavlink_map.items()} | {
    # What PX4 sends and no dialect of pymavlink has. Without its seed a frame cannot be told from garbage, so that its
    # bytes would count as corrupt and its number as lost. All but 412 and 413 are verified with recorded flights.
    8: 117,  # LINK_NODE_STATUS
    380: 232,  # TIME_ESTIMATE_TO_TARGET
    410: 160,  # EVENT
    411: 106,  # CURRENT_EVENT_SEQUENCE
    412: 33,  # REQUEST_EVENT
    413: 77,  # RESPONSE_EVENT_ERROR
}

_SEEDS = [bytes((each,)) for each in range(256)]
_SEED_OF = {message_id: _SEEDS[extra] for message_id, extra in _EXTRA.items()}


def is_right(message_id: int, data: bytes, end: int) -> bool:
    """Whether the checksum at the `end` of what is covered in a frame (all from its second byte on) is that of it.

    A message that no dialect knows has no right checksum.
    """
    seed = _SEED_OF.get(message_id)
    return seed is not None and crc16.mcrf4xx(data[1:end] + seed) == data[end] | data[end + 1] << 8


def of(covered: bytes, extra: int) -> bytes:
    """The checksum of what it covers, with the seed of the message."""
    return crc16.mcrf4xx(covered + _SEEDS[extra]).to_bytes(2, "little")
