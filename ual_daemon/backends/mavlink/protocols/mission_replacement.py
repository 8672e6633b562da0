"""Has an autopilot keep other items, and reads them back."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from typing import Any

from typing_extensions import override

from ual.errors import UalError
from ual_daemon.backends.firmwares.item_lists import WRITES_COUNT, kept_otherwise, not_read_back
from ual_daemon.backends.firmwares.mission_items import Difference, MissionItem, MissionList, refusal_text
from ual_daemon.backends.mavlink.protocols.mission_download import MissionDownload
from ual_daemon.backends.mavlink.protocols.mission_exchange import ACCEPTED, MissionTaker
from ual_daemon.backends.mavlink.protocols.mission_sender import MissionSender
from ual_daemon.backends.mavlink.protocols.mission_upload import MissionChange, MissionClear, MissionUpload
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.offers.parameters import Refusal


class MissionReplacement(MissionTaker[MissionList]):
    """Uploads items, or removes all where there are none, and reads them back. Sends again what differs.

    Ends with what was read back. Each part is an exchange itself, with its own time.
    """

    def __init__(
        self,
        future: Future[MissionList],
        line: MissionSender,
        items: Sequence[MissionItem],
        refusal: Refusal,
        differs: Difference,
    ) -> None:
        super().__init__(future)
        self._line = line
        self._items = tuple(items)
        self._refusal = refusal
        self._differs = differs
        self._writes_count = 0
        self._result = ACCEPTED
        """Result of the last change."""
        self._part: MissionTaker[Any] = self._change()

    @override
    def tick(self, now_s: float) -> None:
        self._advance()
        if not self.is_over:
            self._part.tick(now_s)
            self._advance()

    @override
    def on_count(self, message: Message, now_s: float) -> None:
        self._part.on_count(message, now_s)

    @override
    def on_item(self, message: Message, now_s: float) -> None:
        self._part.on_item(message, now_s)

    @override
    def on_request(self, message: Message, now_s: float) -> None:
        self._part.on_request(message, now_s)

    @override
    def on_ack(self, message: Message, now_s: float) -> None:
        self._part.on_ack(message, now_s)

    @override
    def withdraw(self) -> None:
        if not self._part.is_over:
            self._part.withdraw()

    def _change(self) -> MissionChange:
        self._writes_count += 1
        if self._items:
            return MissionUpload(Future(), self._line, self._items, self._refusal)
        return MissionClear(Future(), self._line, self._refusal)

    def _advance(self) -> None:
        """Goes on to the next part where one has ended."""
        if not self._part.is_over:
            return
        error = self._part.future.exception()
        is_change = isinstance(self._part, MissionChange)
        if isinstance(error, UalError):
            self.fail(error if is_change else not_read_back(error, self._line.kind))
        elif is_change:
            self._result = self._part.future.result()
            self._part = MissionDownload(Future(), self._line)
        else:
            self._judge(self._part.future.result())

    def _judge(self, found: MissionList) -> None:
        text = self._differs(self._items, found.items)
        if not text:
            self._end(found)
        elif self._writes_count < WRITES_COUNT:
            self._part = self._change()
        else:
            why = "" if self._result == ACCEPTED else f"it answers {refusal_text(self._result)}"
            self.fail(kept_otherwise(self._line.kind, text, why))
