"""Data of GPS_RTCM_DATA that autopilots give their satellite receiver, each as its own source does it."""

from __future__ import annotations

from typing import Any

FULL = 180


class SatelliteReceiver:
    """`pieces` are what PX4 gives to it (`GPS::handleInjectDataTopic`: each piece as it comes), and `messages` what
    ArduPilot does (`AP_GPS::handle_gps_rtcm_fragment`: whole messages, put together).
    """

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        self.messages: list[bytes] = []
        self.discarded_count = 0
        self._buffer = bytearray(4 * FULL)
        self._received = 0
        self._count = 0
        self._length = 0
        self._sequence = 0

    def on_rtcm_data(self, message: Any) -> None:
        """Takes a GPS_RTCM_DATA."""
        if message.len > FULL:
            return
        data = bytes(message.data[: message.len])
        self.pieces.append(data)
        if message.flags & 1:
            self._on_fragment(message.flags, data)
        else:
            self.messages.append(data)

    def _on_fragment(self, flags: int, data: bytes) -> None:
        fragment, sequence = flags >> 1 & 3, flags >> 3 & 31
        begin = FULL * fragment
        if self._received:
            is_other, is_seen = self._sequence != sequence, bool(self._received & 1 << fragment)
            if not is_other and is_seen and self._buffer[begin : begin + len(data)] == data:
                return
            if is_other or is_seen:
                self.discarded_count += self._received.bit_count()
                self._count = self._received = 0
        self._sequence = sequence
        self._received |= 1 << fragment
        self._buffer[begin : begin + len(data)] = data
        if len(data) < FULL:
            self._count, self._length = fragment + 1, begin + len(data)
        elif self._received == 0x0F:
            self._count, self._length = 4, 4 * FULL
        if self._count and self._received == (1 << self._count) - 1:
            self.messages.append(bytes(self._buffer[: self._length]))
            self._count = self._received = 0
