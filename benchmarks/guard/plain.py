"""The least that a setpoint costs in Python: packed by pymavlink, and sent."""

from __future__ import annotations

import socket
from collections.abc import Callable

from pymavlink.dialects.v20 import common as mavlink

_VELOCITY_ONLY = 0b010111000111


def plain_send() -> Callable[[int], None]:
    """Returns the function that packs a velocity and sends it as a datagram, without UAL."""
    sink, out = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    sink.bind(("127.0.0.1", 0))
    address = sink.getsockname()
    packing = mavlink.MAVLink(None, srcSystem=245, srcComponent=190)

    def send(number: int) -> None:
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, _VELOCITY_ONLY, 0, 0, 0, number, 0, 0, 0, 0, 0, 0, 0
        )
        out.sendto(message.pack(packing), address)
        packing.seq = (packing.seq + 1) % 256
        assert sink

    return send
