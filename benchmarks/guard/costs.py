"""What calls cost, in processor time of the thread that calls."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable

from pymavlink.dialects.v20 import common as mavlink
from typing_extensions import Self

_VELOCITY_ONLY = 0b010111000111
_BURSTS, _COUNT = 30, 40
_PAUSE_S = 0.01
"""Between two bursts, so that there is something new to be known: a position, a mode."""


def least_us(call: Callable[[int], object]) -> float:
    """Returns what a call costs, µs: the least mean of several bursts. It gets a number."""
    found = float("inf")
    for burst in range(_BURSTS):
        time.sleep(_PAUSE_S)
        first = burst * _COUNT
        began_ns = time.thread_time_ns()
        for number in range(first, first + _COUNT):
            call(number)
        found = min(found, (time.thread_time_ns() - began_ns) / _COUNT / 1000.0)
    return found


class Sink:
    """A datagram socket of this computer that nobody reads, and another one to send to it."""

    def __init__(self) -> None:
        self._sink, self._out = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self._sink.bind(("127.0.0.1", 0))
        self._address = self._sink.getsockname()

    def send(self, data: bytes) -> None:
        """Sends a datagram."""
        self._out.sendto(data, self._address)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self._sink.close()
        self._out.close()


def pymavlink_us() -> float:
    """Returns what packing a velocity and sending it as a datagram costs, without UAL."""
    packing = mavlink.MAVLink(None, srcSystem=245, srcComponent=190)
    with Sink() as sink:

        def send(number: int) -> None:
            message = mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, _VELOCITY_ONLY, 0, 0, 0, number, 0, 0, 0, 0, 0, 0, 0
            )
            sink.send(message.pack(packing))
            packing.seq = (packing.seq + 1) % 256

        return least_us(send)
