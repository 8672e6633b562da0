"""Progress of the autopilot's mission, and its current item.

https://mavlink.io/en/services/mission.html#current-mission-item. MISSION_SET_CURRENT is used, not the command
DO_SET_MISSION_CURRENT: PX4 1.17 does not have that one (navigator_main.cpp, Commander.cpp), and ArduPilot has both.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace

from typing_extensions import override

from ual.errors import LinkLostError, TaskAbortedError
from ual.missions.plan import MissionStage
from ual_daemon.backends import futures
from ual_daemon.backends.firmwares.item_lists import not_current
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.offers.parameters import Refusal, UndecidedError

RETRY_S = 0.5
TRIES_COUNT = 10


@dataclass(frozen=True, slots=True)
class MissionNews:
    """The newest of what was received of the mission: MISSION_CURRENT, and the number and time of MISSION_ITEM_REACHED.

    `total` is the number of its items, `texts_count` how many texts said that it was changed.
    """

    state: int
    seq: int
    time_s: float
    mission_id: int
    reached: int | None = None
    reached_s: float = -math.inf
    total: int = 0
    texts_count: int = 0

    @property
    def changes(self) -> tuple[int, int]:
        """Signs of a change of the mission, in addition to its checksum."""
        return self.total, self.texts_count


class SetCurrent(Exchange[None]):
    """Makes an item the current one. Ends once MISSION_CURRENT has one of the numbers that show it.

    PX4 takes the message only, without an answer; ArduPilot takes both, and announces the item at once.
    """

    def __init__(
        self,
        future: Future[None],
        transmit: Callable[[float], object],
        shown_by: frozenset[int],
        refusal: Refusal,
        is_up: Callable[[float], bool],
    ) -> None:
        super().__init__(future)
        self._transmit = transmit
        self._shown_by = shown_by
        self._refusal = refusal
        self._is_up = is_up
        self._tries_count = 0
        self._next_s = 0.0

    @override
    def tick(self, now_s: float) -> None:
        if self._tries_count and now_s < self._next_s:
            return
        error = self._refusal()
        if isinstance(error, UndecidedError):
            return
        if error is not None:
            self.fail(error)
        elif self._tries_count >= TRIES_COUNT:
            self._give_up(now_s)
        else:
            self._tries_count += 1
            self._next_s = now_s + RETRY_S
            self._transmit(now_s)

    def on_current(self, seq: int) -> None:
        """Takes the number of the current item."""
        if self._tries_count and seq in self._shown_by:
            self._end(None)

    def _give_up(self, now_s: float) -> None:
        if self._is_up(now_s):
            self.fail(not_current())
        else:
            self.fail(LinkLostError("nothing comes from the autopilot: it is not known which item is its current one"))


class MissionProgressProtocol(Protocol):
    """Belongs to the thread that receives, but for `heard`, which any thread may read."""

    def __init__(self, send: Callable[[Message], object], is_up: Callable[[float], bool]) -> None:
        self.is_waiting = False
        self._send = send
        self._is_up = is_up
        self._target: MessageSource | None = None
        self._setting: SetCurrent | None = None
        self._change_texts: tuple[str, ...] = ()
        self.heard: MissionNews | None = None
        self.on_order: Callable[[float], object] = lambda _: None
        """Called with the time of each order that makes an item the current one."""
        self.on_report: Callable[[float, bool], object] = lambda _, __: None
        """Called with the time of each report of the mission, and whether that is complete."""

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self._on_current,
            mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED: self._on_reached,
            mavlink.MAVLINK_MSG_ID_STATUSTEXT: lambda message, _: self._on_text(message),
        }

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        self.drop("another autopilot was found")
        self._target, self._change_texts = target, dialect.mission_change_texts

    @override
    def drop(self, why: str) -> None:
        self.heard = None
        if self._setting is not None:
            self._setting.fail(LinkLostError(f"no item was made the current one: {why}"))
            self._setting = None

    @override
    def tick(self, now_s: float) -> None:
        if self._setting is not None and not self._setting.is_over:
            self._setting.tick(now_s)
        if self._setting is not None and self._setting.is_over:
            self._setting = None
        self.is_waiting = self._setting is not None

    def set_current(self, seq: int, shown_by: frozenset[int], refusal: Refusal, future: Future[None]) -> None:
        """Makes an item the current one. Replaces one that was requested before."""
        target = self._target
        if target is None:
            futures.fail(future, LinkLostError("no autopilot was found"))
            return
        if self._setting is not None:
            text = "jump_to_item: replaced, as another item was asked for"
            self._setting.fail(TaskAbortedError(text, {"by": "jump_to_item"}))

        def transmit(now_s: float) -> None:
            self.on_order(now_s)
            self._send(mavlink.MAVLink_mission_set_current_message(*target, seq))

        self._setting = SetCurrent(future, transmit, shown_by, refusal, self._is_up)
        self.is_waiting = True

    def _on_current(self, message: Message, now_s: float) -> None:
        state, mission_id = getattr(message, "mission_state", 0), getattr(message, "mission_id", 0)
        last, total = self.heard, getattr(message, "total", 0)
        texts_count = 0 if last is None else last.texts_count
        news = MissionNews(state, message.seq, now_s, mission_id, total=total, texts_count=texts_count)
        if last is not None and (last.mission_id, last.total) == (mission_id, total):
            news = replace(news, reached=last.reached, reached_s=last.reached_s)  # else it is of another mission
        self.heard = news
        self.on_report(now_s, state == MissionStage.COMPLETE.value)
        if self._setting is not None:
            self._setting.on_current(message.seq)

    def _on_reached(self, message: Message, now_s: float) -> None:
        last = self.heard
        if last is not None:
            self.heard = replace(last, reached=message.seq, reached_s=now_s)

    def _on_text(self, message: Message) -> None:
        last = self.heard
        if last is not None and self._change_texts and message.text.startswith(self._change_texts):
            self.heard = replace(last, texts_count=last.texts_count + 1)
