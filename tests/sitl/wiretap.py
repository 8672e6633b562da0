"""Listens between a daemon and its autopilot: what the daemon sends is counted where it leaves, whatever it says."""

from __future__ import annotations

import contextlib
import math
import random
import selectors
import socket
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import urlsplit

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec
from tests.simulators.faults import GOOD, Variant
from ual_daemon.backends.mavlink.wire.frames import FrameReader
from ual_daemon.backends.mavlink.wire.messages import Message

_ASKING = {
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_REQUEST_MESSAGE,
}
"""Commands that ask for a message, and change nothing of the vehicle."""
_ORDERS = {
    mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
    mavlink.MAVLINK_MSG_ID_COMMAND_INT,
    mavlink.MAVLINK_MSG_ID_SET_MODE,
    mavlink.MAVLINK_MSG_ID_PARAM_SET,
}
_Setpoint = mavlink.MAVLink_set_position_target_local_ned_message
_PIECE = 65536
GAP_S = 0.25
"""Longer than setpoints are apart."""
_STATION_ID = 253
"""The system that sends what is injected."""


@dataclass(frozen=True)
class ReceivedMessage:
    """A message of the daemon, and when it passed (monotonic clock)."""

    time_s: float
    message: Message
    component_id: int


class Ears(Protocol):
    """Hears what passes."""

    def hear_daemon(self, data: bytes) -> None:
        """Takes what the daemon has sent, as it left it."""

    def hear_autopilot(self, data: bytes) -> None:
        """Takes what reaches the daemon, as it reaches it."""

    def renew(self) -> None:
        """Both ends have connected anew."""


class Wiretap:
    """Passes everything on, both ways, and keeps what the daemon sent. A daemon that ends may be followed by another;
    on UDP several may be there at once, and all hear the autopilot.

    `url` is where the autopilot would be found without it (``udpin://`` or ``tcp://``); `self.url` is for the daemon.
    `faults` are those of the line, each way; on TCP pieces of the stream are lost or damaged, as by a modem between.
    `ears` hear instead of this, and both ways.
    """

    def __init__(self, url: str, ears: Ears | None = None) -> None:
        parts = urlsplit(url)
        assert parts.hostname is not None
        assert parts.port is not None
        self._autopilot = (parts.hostname, parts.port)
        self._codec = AutopilotCodec(0)
        self._injector = AutopilotCodec(mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._injector.join(_STATION_ID)
        self._reader = FrameReader()
        self._lock = threading.Lock()
        self._sent: list[ReceivedMessage] = []
        self._is_closing = False
        self._ears = ears
        self._injected: deque[bytes] = deque()
        self.faults = GOOD
        is_udp = parts.scheme == "udpin"
        self._near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM if is_udp else socket.SOCK_STREAM)
        self._near.bind(("127.0.0.1", 0))
        port = self._near.getsockname()[1]
        self.url = f"{'udpout' if is_udp else 'tcp'}://127.0.0.1:{port}"
        self._thread = threading.Thread(target=self._pass_datagrams if is_udp else self._pass_streams, name="wiretap")
        self._thread.start()

    def close(self) -> None:
        self._is_closing = True
        self._thread.join()
        self._near.close()

    def inject(self, message: Message) -> None:
        """Sends a message to the autopilot on the daemon's own link, as another program behind a router does."""
        self._injected.append(self._injector.encode(message))

    def setpoints(self, since_s: float, until_s: float = math.inf, *, component_id: int | None = None) -> int:
        """Returns the number of setpoints sent in between (monotonic clock), by the time that the daemon wrote into
        them; with `component_id` by this daemon only.
        """
        with self._lock:
            sent_ms = [
                heard.message.time_boot_ms
                for heard in self._sent
                if isinstance(heard.message, _Setpoint) and component_id in (None, heard.component_id)
            ]
        return sum(int(since_s * 1000.0) < each_ms <= until_s * 1000.0 for each_ms in sent_ms)

    def orders(self, since_s: float, *, component_id: int | None = None) -> list[str]:
        """Returns the orders to the autopilot since then: commands, modes and parameters, but not questions."""
        with self._lock:
            messages = [
                heard.message
                for heard in self._sent
                if heard.time_s >= since_s and component_id in (None, heard.component_id)
            ]
        return [
            str(message)
            for message in messages
            if message.get_msgId() in _ORDERS and getattr(message, "command", None) not in _ASKING
        ]

    def timeline(self, since_s: float) -> list[tuple[float, str]]:
        """Returns when each order left since then, and each end of a time of `GAP_S` without setpoints."""
        with self._lock:
            sent = [heard for heard in self._sent if heard.time_s >= since_s]
        lines: list[tuple[float, str]] = []
        last_s = since_s
        for heard in sent:
            message = heard.message
            if isinstance(message, _Setpoint):
                if heard.time_s - last_s > GAP_S:
                    lines.append((heard.time_s, f"a setpoint, after {heard.time_s - last_s:.2f} s"))
                last_s = heard.time_s
            elif message.get_msgId() in _ORDERS and getattr(message, "command", None) not in _ASKING:
                lines.append((heard.time_s, str(message)))
        return lines

    def _note(self, data: bytes) -> None:
        if self._ears is not None:
            self._ears.hear_daemon(data)
            return
        time_s = time.monotonic()
        for frame in self._reader.feed(data):
            heard = ReceivedMessage(time_s, self._codec.decode(frame), frame.component_id)
            with self._lock:
                self._sent.append(heard)

    def _note_reported(self, data: bytes) -> None:
        if self._ears is not None:
            self._ears.hear_autopilot(data)

    def _pass_datagrams(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far, selectors.DefaultSelector() as selector:
            far.bind(self._autopilot)
            selector.register(far, selectors.EVENT_READ)
            selector.register(self._near, selectors.EVENT_READ)
            autopilot = None
            daemons: set[tuple[str, int]] = set()
            down, up = Variant(random.Random(1), keeps_order=False), Variant(random.Random(2), keeps_order=False)
            while not self._is_closing:
                for key, _ in selector.select(_wait_s(down, up)):
                    data, address = key.fileobj.recvfrom(_PIECE)  # type: ignore[union-attr]
                    if key.fileobj is far:
                        autopilot = address
                        down.put(data, time.monotonic(), self.faults)
                    else:
                        daemons.add(address)
                        self._note(data)
                        up.put(data, time.monotonic(), self.faults)
                for data in down.take(time.monotonic()):
                    self._note_reported(data)
                    for daemon in daemons:
                        self._near.sendto(data, daemon)
                while self._injected and autopilot is not None:
                    far.sendto(self._injected.popleft(), autopilot)
                for data in up.take(time.monotonic()):
                    if autopilot is not None:
                        far.sendto(data, autopilot)

    def _pass_streams(self) -> None:
        self._near.listen(1)
        self._near.settimeout(0.1)
        while not self._is_closing:
            try:
                daemon, _ = self._near.accept()
            except TimeoutError:
                continue
            self._reader = FrameReader()
            if self._ears is not None:
                self._ears.renew()
            with daemon, contextlib.suppress(ConnectionError), socket.create_connection(self._autopilot) as far:
                self._pass_stream(daemon, far)

    def _pass_stream(self, daemon: socket.socket, far: socket.socket) -> None:
        """Until either end closes."""
        for end in (daemon, far):  # else a position waits for the next ones, and 20 setpoints a second leave, not 50
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        down, up = Variant(random.Random(1), keeps_order=True), Variant(random.Random(2), keeps_order=True)
        with selectors.DefaultSelector() as selector:
            selector.register(far, selectors.EVENT_READ)
            selector.register(daemon, selectors.EVENT_READ)
            while not self._is_closing:
                for key, _ in selector.select(_wait_s(down, up)):
                    data = key.fileobj.recv(_PIECE)  # type: ignore[union-attr]
                    if not data:
                        return
                    if key.fileobj is daemon:
                        self._note(data)
                    (up if key.fileobj is daemon else down).put(data, time.monotonic(), self.faults)
                for data in down.take(time.monotonic()):
                    self._note_reported(data)
                    daemon.sendall(data)
                for data in up.take(time.monotonic()):
                    far.sendall(data)
                while self._injected:
                    far.sendall(self._injected.popleft())


def _wait_s(*ways: Variant) -> float:
    """Returns the seconds to wait for more, before messages under way are looked at."""
    return 0.1 if all(way.is_empty for way in ways) else 0.002
