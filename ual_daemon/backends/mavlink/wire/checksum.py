"""Checksums of frames, which separate frames from garbage before their content is used."""

from __future__ import annotations

from fastcrc import crc16

from ual_daemon.backends.mavlink.wire.dialect import mavlink_map

_EXTRA = {message_id: kind.crc_extra for message_id, kind in mavlink_map.items()} | {
    # Messages of PX4 that no dialect has. Without the seed such a frame looks like garbage: its bytes
    # would count as corrupt and its sequence number as lost. All but 412 and 413 are verified with recorded flights.
    8: 117,  # LINK_NODE_STATUS
    380: 232,  # TIME_ESTIMATE_TO_TARGET
    411: 106,  # CURRENT_EVENT_SEQUENCE
    412: 33,  # REQUEST_EVENT
    413: 77,  # RESPONSE_EVENT_ERROR
}

KNOWN_IDS = frozenset(_EXTRA)
"""Ids of the messages whose checksum can be verified."""
crc = crc16.mcrf4xx
_SEEDS = [bytes((each,)) for each in range(256)]
_SEED_OF = {message_id: _SEEDS[extra] for message_id, extra in _EXTRA.items()}
seed_of = _SEED_OF.get
"""Gets the byte that is added to what a message's checksum covers; None for a message that no dialect has."""


def is_valid(message_id: int, data: bytes, end: int) -> bool:
    """Returns whether the checksum at `end` of a frame matches what it covers: all before it but the first byte.

    No checksum of a message that no dialect has is valid.
    """
    seed = _SEED_OF.get(message_id)
    return seed is not None and crc(data[1:end] + seed) == data[end] | data[end + 1] << 8


def compute(covered: bytes, extra: int) -> bytes:
    """Returns the checksum of the covered bytes, with the seed of the message."""
    return crc(covered + _SEEDS[extra]).to_bytes(2, "little")


def longest_v1(message_id: int) -> int:
    """Returns the longest content of a message of MAVLink 1; 255 where it is not known."""
    kind = mavlink_map.get(message_id)
    return 255 if kind is None else kind.layout.payload.size
