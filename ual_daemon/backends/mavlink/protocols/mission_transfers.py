"""The transfers of missions, fences and rally points with the autopilot, one at a time."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, NamedTuple

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError, ResourceExhaustedError
from ual_daemon.backends import futures
from ual_daemon.backends.firmwares.mission_items import Difference, MissionItem, MissionList, MissionType
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.mission_download import MOST_ITEMS, MissionDownload
from ual_daemon.backends.mavlink.protocols.mission_exchange import MissionTaker
from ual_daemon.backends.mavlink.protocols.mission_replacement import MissionReplacement
from ual_daemon.backends.mavlink.protocols.mission_sender import MissionSender
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.offers.parameters import Refusal

MOST_WAITING_TRANSFERS = 20
"""Transfers that may wait for their turn."""


class OpaqueIds(NamedTuple):
    """The autopilot's checksums of its lists, by MISSION_CURRENT; 0 where a list is empty. PX4 has them since 1.15."""

    mission: int
    fence: int
    rally: int


class MissionTransfers(Protocol):
    """Belongs to the thread that receives. `send` sends a message; `is_up` says whether the link is up at a time.

    One transfer runs at a time, in the order in which they were requested: PX4 refuses a second one, of whatever list.
    """

    def __init__(self, send: Callable[[Message], object], is_up: Callable[[float], bool]) -> None:
        self.is_waiting = False
        self._send = send
        self._is_up = is_up
        self._target: MessageSource | None = None
        self._refused_name = ""
        """The name of an autopilot with which nothing is exchanged."""
        self._waiting: deque[_TransferRequest] = deque()
        self._running: _TransferRequest | None = None
        self._changes: Counter[MissionType] = Counter()
        self.opaque_ids: OpaqueIds | None = None
        """The newest; None while the autopilot has reported none."""

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAVLINK_MSG_ID_MISSION_COUNT: self._for_list(lambda taker: taker.on_count),
            mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: self._for_list(lambda taker: taker.on_item),
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT: self._for_list(lambda taker: taker.on_request),
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST: self._for_list(lambda taker: taker.on_request),
            mavlink.MAVLINK_MSG_ID_MISSION_ACK: self._for_list(lambda taker: taker.on_ack),
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: lambda message, _: self._on_current(message),
        }

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        self.drop("another autopilot was found")
        self._target, self.opaque_ids = target, None
        self._refused_name = "" if dialect.keeps_items else dialect.name

    @override
    def release(self) -> None:
        request = self._running
        if request is not None and (not request.taker.is_over or request.taker.future.cancelled()):
            request.taker.withdraw()

    @override
    def drop(self, why: str) -> None:
        if self._running is not None:
            text = f"{self._running.kind.text}: the transfer was not finished: {why}"
            self._running.taker.fail(LinkLostError(text))
        for request in self._waiting:
            request.taker.fail(LinkLostError(f"{request.kind.text}: nothing was transferred: {why}"))
        self._waiting.clear()
        self._running, self.opaque_ids = None, None

    @override
    def tick(self, now_s: float) -> None:
        self._next()
        self.is_waiting = self._running is not None
        if self._running is not None:
            self._running.taker.tick(now_s)

    def changes_count(self, kind: MissionType) -> int:
        """Returns the number of transfers that were to change a list and have ended, well or not."""
        return self._changes[kind]

    def download(self, kind: MissionType, future: Future[MissionList], most_items: int = MOST_ITEMS) -> None:
        """Reads a list. Ends with a `ResourceExhaustedError` where it has more items than these."""
        self._add(kind, future, lambda line: MissionDownload(future, line, most_items), changes=False)

    def replace(
        self,
        kind: MissionType,
        items: Sequence[MissionItem],
        refusal: Refusal,
        future: Future[MissionList],
        differs: Difference,
    ) -> None:
        """Has the autopilot keep these items, or none, and reads them back.

        `refusal` is called before each message that leads to a change, see `AutopilotParameters.write`. `differs` says
        how what was read back differs. The future ends with what was read back, or with an error.
        """
        self._add(kind, future, lambda line: MissionReplacement(future, line, items, refusal, differs), changes=True)

    def _add(
        self,
        kind: MissionType,
        future: Future[MissionList],
        make: Callable[[MissionSender], MissionTaker[Any]],
        *,
        changes: bool,
    ) -> None:
        if self._target is None:
            futures.fail(future, LinkLostError("no autopilot was found"))
        elif self._refused_name:
            text = f"UAL does not transfer the {kind.text} of {self._refused_name}"
            futures.fail(future, NotSupportedError(text))
        elif len(self._waiting) >= MOST_WAITING_TRANSFERS:
            text = f"{MOST_WAITING_TRANSFERS} transfers with the autopilot wait already, which is the limit"
            futures.fail(future, ResourceExhaustedError(text, {"limit": str(MOST_WAITING_TRANSFERS)}))
        else:
            line = MissionSender(self._send, self._is_up, self._target, kind)
            self._waiting.append(_TransferRequest(kind, make(line), changes))
            self.is_waiting = True

    def _next(self) -> None:
        while self._running is None or self._running.taker.is_over:
            if self._running is not None:
                self._leave(self._running)
            if not self._waiting:
                self._running = None
                return
            self._running = self._waiting.popleft()

    def _leave(self, request: _TransferRequest) -> None:
        """Does what follows from the end of a transfer."""
        self._changes[request.kind] += request.changes
        if request.taker.future.cancelled():
            request.taker.withdraw()

    def _for_list(self, choose: Callable[[MissionTaker[Any]], Handler]) -> Handler:
        """Returns what gives a message to the transfer of its list."""

        def on_message(message: Message, now_s: float) -> None:
            request = self._running
            # PX4 sends what it has to tell without being asked to system 0 before a first transfer.
            is_ours = message.target_system and message.target_component
            if is_ours and request is not None and not request.taker.is_over and message.mission_type == request.kind:
                choose(request.taker)(message, now_s)

        return on_message

    def _on_current(self, message: Message) -> None:
        ids = OpaqueIds(message.mission_id, message.fence_id, message.rally_points_id)
        if any(ids) or self.opaque_ids is not None:
            self.opaque_ids = ids


class _TransferRequest(NamedTuple):
    """A transfer that was requested, and whether it changes the list."""

    kind: MissionType
    taker: MissionTaker[Any]
    changes: bool
