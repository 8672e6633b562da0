"""Corrections of satellites on their way to the autopilot: GPS_RTCM_DATA, and what it tells of them.

A message is sent whole, in up to four pieces of 180 bytes. ArduPilot takes the first piece that is shorter for the last
(AP_GPS::handle_gps_rtcm_fragment). So a message that fills two or three pieces is followed by an empty one; four full
pieces are complete by themselves. PX4 gives each piece to the receiver as it comes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from typing_extensions import override

from ual_daemon.backends.firmwares.baseline import Baseline
from ual_daemon.backends.mavlink.dialects.command_long import set_message_interval
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.offers.corrections import Injected, WaitingCorrections

PIECE_BYTES = 180
MOST_PIECES = 4
LONGEST_BYTES = MOST_PIECES * PIECE_BYTES
MESSAGES_AT_ONCE = 2
MESSAGE_PACE_S = 0.02
"""Seconds between `MESSAGES_AT_ONCE` pieces that leave together and the next ones: 18 kB/s. PX4 keeps 8 pieces for its
receiver's driver, which looks each 50 ms.
"""
RECEIVER_REQUEST_S = 10.0
"""Seconds between two requests for the messages with the base line, while they do not come."""
_BASELINES = (mavlink.MAVLINK_MSG_ID_GPS_RTK, mavlink.MAVLINK_MSG_ID_GPS2_RTK)


class CorrectionsAge(NamedTuple):
    """Seconds since the last message left, to 0.1 s, and the distance from the base station; None where not known."""

    age_s: float | None = None
    baseline_m: float | None = None


NO_CORRECTIONS = CorrectionsAge()


class CorrectionsInjection(Protocol):
    """Belongs to the thread that receives; `counts` is for any. Setpoints, of any thread, never wait for it."""

    def __init__(
        self, send: Callable[[Message], object], is_up: Callable[[float], bool], has_room: Callable[[], bool]
    ) -> None:
        """`send` sends a message and returns whether it left, and `is_up` says whether the link is up at a time.
        `has_room` says whether nothing that is urgent has to wait for what is sent now.
        """
        self.is_waiting = False
        self._transmit = send
        self._is_up = is_up
        self._has_room = has_room
        self._waiting = WaitingCorrections(LONGEST_BYTES)
        self._message = b""
        self._pieces: list[tuple[int, bytes]] = []
        """Pieces of `_message` that have not left, with their flags; the next one last."""
        self._sequence = 0
        self._next_s = -math.inf
        self._target: MessageSource | None = None
        self._tells_baseline = False
        self._next_ask_s = -math.inf
        self._baseline = Baseline()

    @property
    def counts(self) -> Injected:
        """Counts of the messages by their fate."""
        return self._waiting.counts

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return dict.fromkeys(_BASELINES, self.on_baseline)

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        self._target, self._tells_baseline = target, dialect.tells_baseline
        self.drop("another autopilot was found")

    @override
    def drop(self, why: str) -> None:
        self._baseline, self._next_ask_s = Baseline(), -math.inf
        if self._pieces:
            self._pieces.clear()
            self._waiting.on_lost(why)
        self._waiting.drop(why)

    def give(self, message: bytes) -> None:
        """Sends a whole message as soon as there is room for it."""
        self._waiting.add(message)
        self.is_waiting = True

    def refuse(self, why: str) -> None:
        """Counts a message that may not be sent now."""
        self._waiting.on_lost(why)

    @override
    def tick(self, now_s: float) -> None:
        if not self._is_up(now_s):
            self.drop("the link is lost")
        elif now_s >= self._next_s and (self._pieces or self._next_message()):
            self._next_s = now_s + MESSAGE_PACE_S
            self._send(now_s)
            self._ask(now_s)

    def on_baseline(self, message: Message, now_s: float) -> None:
        """Takes a GPS_RTK or a GPS2_RTK."""
        parts_mm = message.baseline_a_mm, message.baseline_b_mm, message.baseline_c_mm
        self._baseline.on_components(*parts_mm, now_s)
        self.is_waiting = True

    def status(self, now_s: float) -> CorrectionsAge:
        """Returns what telemetry has of them."""
        left_s = self.counts.left_s
        if left_s is None and not self._baseline.has_come:
            return NO_CORRECTIONS
        return CorrectionsAge(None if left_s is None else round(now_s - left_s, 1), self._baseline.fresh_m(now_s))

    def _next_message(self) -> bool:
        message = self._waiting.take()
        if message is None:
            return False
        self._message, self._pieces = message, pieces(message, self._sequence)[::-1]
        self._sequence += 1
        return True

    def _send(self, now_s: float) -> None:
        for _ in range(MESSAGES_AT_ONCE):
            if not (self._pieces or self._next_message()) or not self._has_room():
                return
            if not self._transmit(_packed(*self._pieces[-1])):
                return  # it is tried again; meanwhile what is oldest is dropped where too much waits
            self._pieces.pop()
            if not self._pieces:
                self._waiting.on_left(self._message, now_s)

    def _ask(self, now_s: float) -> None:
        """Asks for the base line. Only where corrections are sent: without them there is none."""
        is_needed = self._tells_baseline and self._target is not None and self._baseline.fresh_m(now_s) is None
        if is_needed and self._target is not None and now_s >= self._next_ask_s and self._has_room():
            self._next_ask_s = now_s + RECEIVER_REQUEST_S
            for each in _BASELINES:
                self._transmit(set_message_interval(each, 1.0).request.encode(self._target, 0))


def pieces(message: bytes, sequence: int) -> list[tuple[int, bytes]]:
    """Returns the flags and the content of the messages that carry one of RTCM 3."""
    if len(message) <= PIECE_BYTES:
        return [(sequence % 32 << 3, message)]
    cut = [message[at : at + PIECE_BYTES] for at in range(0, len(message), PIECE_BYTES)]
    if len(cut[-1]) == PIECE_BYTES and len(cut) < MOST_PIECES:
        cut.append(b"")
    return [(1 | number << 1 | sequence % 32 << 3, each) for number, each in enumerate(cut)]


def _packed(flags: int, content: bytes) -> Message:
    return mavlink.MAVLink_gps_rtcm_data_message(flags, len(content), content.ljust(PIECE_BYTES, b"\0"))
