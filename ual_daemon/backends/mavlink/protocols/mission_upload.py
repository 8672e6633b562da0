"""Uploads a list of items by the mission protocol, or removes all.

The autopilot requests each item, and again where a message was lost. ArduPilot asks by the message with floats. Each
request is answered by the item that it names. An upload whose last acknowledgement is lost may be complete.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import RejectedByAutopilotError, UalError
from ual_daemon.backends.firmwares.mission_items import MissionItem
from ual_daemon.backends.mavlink.protocols.mission_exchange import (
    ACCEPTED,
    CANCELLED,
    OUT_OF_SEQUENCE,
    PASSING,
    MissionExchange,
)
from ual_daemon.backends.mavlink.protocols.mission_sender import MissionSender
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.offers.missions import UNCHANGED
from ual_daemon.backends.offers.parameters import Refusal

NO_SPACE = mavlink.MAV_MISSION_NO_SPACE
FULL_COUNT = 5
"""Consecutive refusals for lack of room, one each `RESTART_PAUSE_S`, that count as a boot's. ArduPilot boots in 2 s."""


class MissionChange(MissionExchange[int]):
    """Changes the list. Asks `refusal` before each message. Ends with the result that came, 0 where it was accepted.

    Any other result may be of a message that was repeated, so that the list has to be read back.
    """

    def __init__(self, future: Future[int], line: MissionSender, refusal: Refusal) -> None:
        super().__init__(future, line)
        self._refusal = refusal
        self._is_begun = False
        """Whether anything was sent."""

    @override
    def withdraw(self) -> None:
        if self._is_begun:
            self._line.acknowledge(CANCELLED)

    @override
    def _send(self) -> None:
        error = self._refusal()
        if error is None:
            self._is_begun = True
            self._send_change()
            return
        self.withdraw()
        self.fail(self._stopped(error) if self._is_begun else error)

    def _stopped(self, error: UalError) -> UalError:
        text = f"{error.message}; the {self._line.kind.text} was not sent to the end: read what the autopilot has now"
        return type(error)(text, error.metadata)

    @override
    def _refused(self, result: int, note: str = "", seq: int | None = None) -> UalError:
        error = super()._refused(result, note, seq)
        return error if self._is_taken else type(error)(error.message, {**error.metadata, UNCHANGED: "1"})

    @property
    def _is_taken(self) -> bool:
        """Whether the autopilot has begun to take it, so that it may have changed what it has."""
        return False

    @abstractmethod
    def _send_change(self) -> None:
        """Sends what changes it, the first time or again."""


class MissionClear(MissionChange):
    """Removes all items."""

    @override
    def on_ack(self, message: Message, now_s: float) -> None:
        if not self._is_begun:
            return
        if message.type == ACCEPTED:
            self._end(ACCEPTED)
        elif message.type in PASSING:
            self._pause(message.type, now_s)
        else:
            self.fail(self._refused(message.type))

    @override
    def withdraw(self) -> None:
        """There is nothing to end: it is one message."""

    @override
    def _send_change(self) -> None:
        self._line.clear()

    @override
    def _restart(self) -> None:
        """There is nothing to forget."""


class MissionUpload(MissionChange):
    """Uploads items, at least one."""

    def __init__(
        self, future: Future[int], line: MissionSender, items: Sequence[MissionItem], refusal: Refusal
    ) -> None:
        super().__init__(future, line, refusal)
        self._items = items
        self._at: int | None = None
        """The item that was requested last; None before the first."""
        self._most = -1
        """The last item of the list that was requested in this attempt."""
        self._furthest: int | None = None
        """The last item that was requested in any attempt; None before the first."""
        self._full_count = 0
        """Consecutive answers to the number of items that there is no room for them."""

    @override
    def on_request(self, message: Message, now_s: float) -> None:
        if not self._is_begun or message.seq >= len(self._items):
            return
        if message.seq > self._most:
            self._most, self._further_s = message.seq, now_s
        self._furthest = max(message.seq, self._most if self._furthest is None else self._furthest)
        self._at, self._is_paused, self._full_count = message.seq, False, 0
        self._transmit(now_s)

    @override
    def on_ack(self, message: Message, now_s: float) -> None:
        result = message.type
        if not self._is_begun or result == OUT_OF_SEQUENCE:  # an item came twice
            return
        if self._is_complete and (result == ACCEPTED or result in PASSING):
            self._end(result)
        elif result in PASSING or (result == NO_SPACE and self._may_boot()):
            self._pause(result, now_s)
        elif result != ACCEPTED:
            self.fail(self._rejected(result))

    def _may_boot(self) -> bool:
        """Returns whether the autopilot may have no room only because it boots: it has not opened its storage yet."""
        if self._at is not None:
            return False
        self._full_count += not self._is_paused
        return self._full_count < FULL_COUNT

    def _rejected(self, result: int) -> UalError:
        if result == NO_SPACE and self._at is None and self._furthest is not None:
            what = self._line.kind.text
            text = (
                f"{what}: the autopilot answers NO_SPACE, though it had asked for item {self._furthest} before: it has"
            )
            return RejectedByAutopilotError(
                f"{text} rebooted meanwhile; try again", {"list": what, "result": str(result)}
            )
        return self._refused(result, seq=self._at)

    @property
    @override
    def _is_taken(self) -> bool:
        return self._furthest is not None

    @property
    def _is_complete(self) -> bool:
        """Whether the last item was sent. The autopilot may have all, then."""
        return self._most == len(self._items) - 1

    @override
    def _give_up(self, now_s: float) -> None:
        if self._is_complete:
            self._end(CANCELLED)
        else:
            super()._give_up(now_s)

    @override
    def _send_change(self) -> None:
        if self._at is None:
            self._line.count(len(self._items))
        else:
            self._line.item(self._at, self._items[self._at])

    @override
    def _restart(self) -> None:
        self._at, self._most = None, -1
