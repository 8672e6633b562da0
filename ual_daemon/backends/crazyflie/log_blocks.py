"""Logged variables, in blocks of one packet each, and the conversion of a packet into values."""

from __future__ import annotations

import struct
from typing import NamedTuple

from ual_daemon.backends.crazyflie.packets import (
    CREATE_BLOCK,
    DELETE_BLOCK,
    LOG,
    LOG_CONTROL_CHANNEL,
    RESET_LOG,
    START_BLOCK,
    CrtpPacket,
)
from ual_daemon.backends.crazyflie.requests import CrtpRequest
from ual_daemon.backends.crazyflie.toc import LOG_FORMATS, Toc

HEADER_BYTES = 4
"""Of a packet of values: the block, and 24 bits of milliseconds."""
_PERIOD_UNIT_S = 0.01
_TYPES = {letter: number for number, letter in LOG_FORMATS.items()}
FIRST_OBSERVER_BLOCK_ID = 0xE0
"""The first block of a daemon that only watches: others number theirs from 0."""
EEXIST_ERROR = 17
"""The firmware's EEXIST."""


class Logged(NamedTuple):
    """A variable, and the type in which it is sent."""

    name: str
    format: str


MOTION = (
    Logged("stateEstimate.x", "f"),
    Logged("stateEstimate.y", "f"),
    Logged("stateEstimate.z", "f"),
    Logged("stateEstimateZ.quat", "I"),
    Logged("stateEstimateZ.vx", "h"),
    Logged("stateEstimateZ.vy", "h"),
    Logged("stateEstimateZ.vz", "h"),
    Logged("supervisor.info", "H"),
    Logged("stabilizer.thrust", "H"),
)
"""At the rate of the pose: 26 bytes, as many as fit."""
STATUS = (
    Logged("stateEstimateZ.rateRoll", "h"),
    Logged("stateEstimateZ.ratePitch", "h"),
    Logged("stateEstimateZ.rateYaw", "h"),
    Logged("kalman.varPX", "f"),
    Logged("kalman.varPY", "f"),
    Logged("kalman.varPZ", "f"),
    Logged("pm.vbat", "e"),
    Logged("pm.state", "b"),
    Logged("pm.batteryLevel", "B"),
    Logged("radio.rssi", "B"),
)
STATUS_RATE_HZ = 10.0
REQUIRED = tuple(each.name for each in MOTION[:8])
"""Without these a Crazyflie cannot be flown."""


class Block(NamedTuple):
    """One block of the firmware: its number, its period in units of 10 ms, its variables, and their layout."""

    ident: int
    period: int
    variables: tuple[Logged, ...]
    layout: struct.Struct

    def decode(self, data: bytes) -> dict[str, float] | None:
        """Returns the values in a packet by name; None if the packet is too short.

        It is longer where the answer to a part of the block was lost: the firmware has then added that part twice.
        """
        if len(data) < HEADER_BYTES + self.layout.size:
            return None
        values = self.layout.unpack_from(data, HEADER_BYTES)
        return {each.name: value for each, value in zip(self.variables, values, strict=True)}


def make_blocks(toc: Toc, pose_rate_hz: float, first_ident: int = 0) -> tuple[Block, Block]:
    """Returns the blocks for a firmware, that of the motion first; what it does not have is left out."""
    motion = _block(first_ident, toc, MOTION, pose_rate_hz)
    return motion, _block(first_ident + 1, toc, STATUS, min(STATUS_RATE_HZ, pose_rate_hz))


def _block(ident: int, toc: Toc, variables: tuple[Logged, ...], rate_hz: float) -> Block:
    present = tuple(each for each in variables if each.name in toc)
    layout = struct.Struct("<" + "".join(each.format for each in present))
    return Block(ident, max(1, round(1.0 / (rate_hz * _PERIOD_UNIT_S))), present, layout)


def ask_reset() -> CrtpRequest:
    """Returns the request to forget all blocks, also those of another client."""
    return _control(bytes((RESET_LOG,)), bytes((RESET_LOG,)))


def ask_deletion(block: Block) -> CrtpRequest:
    """Returns the request to forget one block, which need not be there."""
    return _control(bytes((DELETE_BLOCK, block.ident)), bytes((DELETE_BLOCK, block.ident)))


def ask_creation(block: Block, toc: Toc) -> tuple[CrtpRequest, ...]:
    """Returns the requests that create a block, one after the other: the first creates it, the others extend it."""
    requests = []
    for first in range(0, len(block.variables), _VARIABLES_PER_PACKET):
        part = block.variables[first : first + _VARIABLES_PER_PACKET]
        command = CREATE_BLOCK if first == 0 else CREATE_BLOCK + 1
        items = b"".join(struct.pack("<BH", _TYPES[each.format], toc[each.name].ident) for each in part)
        requests.append(_control(bytes((command, block.ident)) + items, bytes((command, block.ident))))
    return tuple(requests)


def ask_start(block: Block) -> CrtpRequest:
    """Returns the request to send a block's values periodically."""
    return _control(bytes((START_BLOCK, block.ident, block.period)), bytes((START_BLOCK, block.ident)))


def result(data: bytes) -> int:
    """Returns the firmware's error number in an answer; 0 if it did what was asked."""
    return data[2] if len(data) > 2 else 0


def block_of(data: bytes) -> int:
    """Returns the number of the block in a packet of values."""
    return data[0]


def milliseconds(data: bytes) -> int:
    """Returns the firmware's time in a packet of values; it begins again after 2^24 ms."""
    return int.from_bytes(data[1:HEADER_BYTES], "little")


_VARIABLES_PER_PACKET = 9


def _control(data: bytes, prefix: bytes) -> CrtpRequest:
    return CrtpRequest(CrtpPacket(LOG, LOG_CONTROL_CHANNEL, data), prefix)
