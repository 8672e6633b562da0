"""What calls cost, in processor time of the thread that calls, over a plain send by pymavlink."""

from __future__ import annotations

import socket
import statistics
import time
from collections.abc import Callable
from functools import partial

from pymavlink.dialects.v20 import common as mavlink
from typing_extensions import Self

_VELOCITY_ONLY = 0b010111000111
_BURSTS, _GROUPS, _COUNT = 30, 8, 5
_PAUSE_S = 0.01
"""Between two bursts, so that there is something new to be known: a position, a mode."""


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


def over_pymavlink(call: Callable[[int], object], rest: Callable[[], object] = lambda: None) -> float:
    """Returns how many times a plain send by pymavlink a call costs. The call gets a number. `rest` follows each burst:
    what was called last may fly on until the next one, which a busy computer begins late.

    The speed of a processor changes by a third from one tenth of a second to the next. So both are measured in turn,
    and the median of the ratios of neighbours counts. Of the groups of a burst the least counts: other threads broke in
    on the others.
    """
    with Sink() as sink:
        plain = _plain_send(sink)
        ratios = []
        for burst in range(_BURSTS):
            time.sleep(_PAUSE_S)
            cost_s = _least_s(call, burst * _GROUPS * _COUNT)
            rest()
            ratios.append(cost_s / _least_s(plain, 0))
    return statistics.median(ratios)


def _least_s(call: Callable[[int], object], first: int) -> float:
    return min(map(partial(_group_s, call), range(first, first + _GROUPS * _COUNT, _COUNT)))


def _group_s(call: Callable[[int], object], first: int) -> float:
    began_ns = time.thread_time_ns()
    for number in range(first, first + _COUNT):
        call(number)
    return (time.thread_time_ns() - began_ns) / _COUNT / 1e9


def _plain_send(sink: Sink) -> Callable[[int], None]:
    """Returns what packs a velocity and sends it as a datagram, without UAL."""
    packing = mavlink.MAVLink(None, srcSystem=245, srcComponent=190)

    def send(number: int) -> None:
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, _VELOCITY_ONLY, 0, 0, 0, number, 0, 0, 0, 0, 0, 0, 0
        )
        sink.send(message.pack(packing))
        packing.seq = (packing.seq + 1) % 256

    return send
