"""Common part of the mission protocol's exchanges: patience, and another attempt where it was refused.

Messages may be lost, doubled and late, and another station may have a transfer with the autopilot. So an answer that
may pass is no end: the exchange pauses, and begins again. PX4 ends a transfer after 5 s of silence, ArduPilot after 8
s.
"""

from __future__ import annotations

from abc import abstractmethod
from concurrent.futures import Future
from typing import TypeVar

from typing_extensions import override

from ual.errors import LinkLostError, RejectedByAutopilotError, UalError, UalTimeoutError
from ual_daemon.backends.firmwares.mission_items import refusal_text
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.mavlink.protocols.mission_sender import MissionSender
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

T = TypeVar("T")

RETRY_S = 0.6
"""Seconds without an answer after which a message is sent again."""
PROGRESS_TIMEOUT_S = 15.0
"""Seconds without progress after which a transfer is given up; longer than another station's abandoned transfer
lasts.
"""
RESTART_PAUSE_S = 1.0
"""The time from a refusal that may pass to the next attempt. PX4 asks again for an item after 0.25 s, ArduPilot after
1 s. A request that comes meanwhile is answered, and the transfer goes on."""
ATTEMPTS_COUNT = 20
LONGEST_TRANSFER_S = 600.0
"""Seconds after which an exchange is given up in any case."""

ACCEPTED, CANCELLED = mavlink.MAV_MISSION_ACCEPTED, mavlink.MAV_MISSION_OPERATION_CANCELLED
OUT_OF_SEQUENCE = mavlink.MAV_MISSION_INVALID_SEQUENCE
PASSING = frozenset({mavlink.MAV_MISSION_ERROR, mavlink.MAV_MISSION_DENIED, CANCELLED, OUT_OF_SEQUENCE})
"""Results that may be of a transfer before, or of another station's."""


class MissionTaker(Exchange[T]):
    """Takes the messages about one list of items."""

    def on_count(self, message: Message, now_s: float) -> None:
        """Takes a MISSION_COUNT."""

    def on_item(self, message: Message, now_s: float) -> None:
        """Takes a MISSION_ITEM_INT."""

    def on_request(self, message: Message, now_s: float) -> None:
        """Takes a MISSION_REQUEST_INT or a MISSION_REQUEST."""

    @abstractmethod
    def on_ack(self, message: Message, now_s: float) -> None:
        """Takes a MISSION_ACK."""

    @abstractmethod
    def withdraw(self) -> None:
        """Tells the autopilot that the transfer has ended, where it is in the middle of one."""


class MissionExchange(MissionTaker[T]):
    """One transfer, or another request about a list."""

    def __init__(self, future: Future[T], line: MissionSender) -> None:
        super().__init__(future)
        self._line = line
        self._began_s: float | None = None
        self._next_s = 0.0
        self._further_s = 0.0
        """Time of its last progress."""
        self._attempts_count = 0
        self._is_paused = False
        self._last_result: int | None = None
        """The last refusal that may pass."""

    @override
    def tick(self, now_s: float) -> None:
        if self._began_s is None:
            self._began_s = self._further_s = now_s
        elif now_s < self._next_s:
            return
        if now_s - self._further_s >= PROGRESS_TIMEOUT_S or now_s - self._began_s >= LONGEST_TRANSFER_S:
            self._give_up(now_s)
            return
        if self._is_paused:
            self._is_paused = False
            self._attempts_count += 1
        if self._attempts_count >= ATTEMPTS_COUNT:
            self._give_up(now_s)
            return
        self._transmit(now_s)

    @abstractmethod
    def _send(self) -> None:
        """Sends what is awaited an answer to, the first time or again."""

    @abstractmethod
    def _restart(self) -> None:
        """Forgets what has come in this attempt."""

    def _transmit(self, now_s: float) -> None:
        self._next_s = now_s + RETRY_S
        self._send()

    def _pause(self, result: int, now_s: float) -> None:
        """Begins again after a while, unless it goes on meanwhile."""
        self._last_result = result
        if not self._is_paused:
            self._is_paused = True
            self._next_s = now_s + self._pause_s
            self._restart()

    @property
    def _pause_s(self) -> float:
        """Seconds until the next attempt."""
        return RESTART_PAUSE_S

    @property
    def _is_answered(self) -> bool:
        """Whether the autopilot takes part. Else PX4 tells the ground station of an end that it does not expect."""
        return True

    def _give_up(self, now_s: float) -> None:
        if self._is_answered:
            self.withdraw()
        self.fail(self._unanswered(now_s))

    def _unanswered(self, now_s: float) -> UalError:
        """Returns what it means that it got no further."""
        what = self._line.kind.text
        if not self._line.is_up(now_s):
            return LinkLostError(f"{what}: nothing comes from the autopilot", {"list": what})
        if self._last_result is None:
            return UalTimeoutError(
                f"{what}: the autopilot does not answer. The link loses too much, or another station transfers "
                "something with it; try again",
                {"list": what},
            )
        return self._refused(self._last_result, "; another station may transfer something with it: try again")

    def _refused(self, result: int, note: str = "", seq: int | None = None) -> UalError:
        what, where = self._line.kind.text, "" if seq is None else f", item {seq}"
        metadata = {"list": what, "result": str(result), **({} if seq is None else {"item": str(seq)})}
        return RejectedByAutopilotError(f"{what}{where}: the autopilot answers {refusal_text(result)}{note}", metadata)
