"""pymavlink without a library above it: packs a message, sends a datagram. The minimum for a Python program."""

from __future__ import annotations

import socket

from pymavlink.dialects.v20 import common as mavlink

from benchmarks.marks import speed_m_s
from benchmarks.peers.base import SynchronousPeer

_VELOCITY_ONLY = 0b010111000111


class Peer(SynchronousPeer):
    def __init__(self, port: int, address: str) -> None:
        super().__init__(port, address)
        self._mavlink = mavlink.MAVLink(None, srcSystem=245, srcComponent=190)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))

    def connect(self) -> None:
        _, self._vehicle = self._socket.recvfrom(2048)

    def send(self, number: int) -> None:
        message = mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, _VELOCITY_ONLY, 0, 0, 0, speed_m_s(number), 0, 0, 0, 0, 0, 0, 0
        )
        self._socket.sendto(message.pack(self._mavlink), self._vehicle)
        self._mavlink.seq = (self._mavlink.seq + 1) % 256

    def close(self) -> None:
        self._socket.close()
