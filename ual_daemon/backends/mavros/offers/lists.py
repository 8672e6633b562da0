"""The lists that the autopilot keeps, through MAVROS' plugins waypoint, geofence and rallypoint.

A plugin transfers a whole list, and answers once that has ended. What it has read it publishes, on a topic without a
time. So a read-back is what comes after the plugin was asked, and stands for a while after its answer: what it has sent
is published, too (mission_protocol_base.cpp, both versions).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import LinkLostError, RejectedByAutopilotError, UalError, UalTimeoutError
from ual_daemon.backends.chain import caught, done, then_wait
from ual_daemon.backends.firmwares.item_lists import (
    WRITES_COUNT,
    ItemLists,
    kept_otherwise,
    not_current,
    not_read_back,
)
from ual_daemon.backends.firmwares.mission_items import Difference, MissionItem, MissionList, MissionType
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.missions import MissionTopics, ReceivedList, waypoint_of
from ual_daemon.backends.mavros.offers.services import BUSY_RETRY_S, Services
from ual_daemon.backends.mavros.session import MavrosSession
from ual_daemon.backends.offers.parameters import Refusal, UndecidedError
from ual_daemon.backends.rosbridge import Message

TRANSFER_S = 35.0
"""MAVROS gives up after 30 s."""
READS_COUNT = 3
TOPIC_DELAY_S = 0.5
"""Seconds after the answer for which the published list has to stand."""
TOPIC_CHECKS_COUNT = 10
"""Looks at the topic before a list counts as missing."""
CHOOSE_S = 6.0
"""MAVROS asks four times, a second apart."""
SHOWN_S, SHOWN_COUNT = 0.3, 8
"""Seconds between two looks at the current item, and their count. PX4 tells it once a second at least."""
CHOICES_COUNT = 3
_PLUGINS = {MissionType.MISSION: "mission", MissionType.FENCE: "geofence", MissionType.RALLY: "rallypoint"}
_CHOOSE = "choose an item of its mission"


class MavrosLists(ItemLists):
    """The lists of one backend."""

    def __init__(self, services: Services) -> None:
        self._services = services

    @override
    def download(self, kind: MissionType) -> Future[MissionList]:
        return self._services.give(_reading(kind), lambda: self._read(kind, READS_COUNT))

    @override
    def replace(
        self, kind: MissionType, items: Sequence[MissionItem], refusal: Refusal, differs: Difference
    ) -> Future[MissionList]:
        write = _Replacement(self, self._services, kind, tuple(items), refusal, differs)
        return self._services.give(f"change its {kind.text}", write.begin)

    def choose(self, seq: int, shown_by: frozenset[int], refusal: Refusal) -> Future[None]:
        """Makes the item of a number the current one; it has once one of some numbers is reported."""
        return self._services.give(_CHOOSE, lambda: self._choose(seq, shown_by, refusal, CHOICES_COUNT))

    # --- Reading ------------------------------------------------------------------------------------------------------

    def read_now(self, kind: MissionType) -> Future[MissionList]:
        """As `download`, in a job that has its turn."""
        return self._read(kind, READS_COUNT)

    def _read(self, kind: MissionType, reads_count: int) -> Future[MissionList]:
        before_count = self._received(kind).messages_count
        pulled = self._services.call_free(f"{_PLUGINS[kind]}/pull", {}, TRANSFER_S, _reading(kind))
        return then_wait(pulled, lambda answer: self._pulled(kind, answer, before_count, reads_count - 1))

    def _pulled(self, kind: MissionType, answer: Message, before_count: int, reads_count: int) -> Future[MissionList]:
        if answer["success"]:
            return self._settled(kind, int(answer["wp_received"]), before_count, TOPIC_CHECKS_COUNT)
        if reads_count <= 0:
            text = f"cannot {_reading(kind)}: MAVROS got {answer['wp_received']} items, and no further: try again"
            raise UalTimeoutError(text, {"list": kind.text})
        return then_wait(self._services.pause(BUSY_RETRY_S), lambda _: self._read(kind, reads_count))

    def _settled(self, kind: MissionType, count: int, before_count: int, checks_count: int) -> Future[MissionList]:
        """Waits for what was read."""

        def check(_: None) -> Future[MissionList]:
            received = self._received(kind)
            if received.messages_count > before_count and len(received.items) == count:
                return done(MissionList(received.items))
            if checks_count <= 1:
                text = f"cannot {_reading(kind)}: MAVROS has not published the {count} items that it has read"
                raise UalTimeoutError(text, {"list": kind.text})
            return self._settled(kind, count, before_count, checks_count - 1)

        return then_wait(self._services.pause(TOPIC_DELAY_S), check)

    # --- The current item ---------------------------------------------------------------------------------------------

    def _choose(self, seq: int, shown_by: frozenset[int], refusal: Refusal, choices_count: int) -> Future[None]:
        if isinstance(refusal(), UndecidedError):
            pause = self._services.pause(SHOWN_S)
            return then_wait(pause, lambda _: self._choose(seq, shown_by, refusal, choices_count))
        before_count = self._received(MissionType.MISSION).messages_count
        session_of(self._services).on_own_order()
        chosen = self._services.call_free(topics.SET_CURRENT, {"wp_seq": seq}, CHOOSE_S, _CHOOSE, refusal=refusal)

        def again() -> Future[None]:
            if choices_count <= 1:
                raise not_current()
            return self._choose(seq, shown_by, refusal, choices_count - 1)

        def shown(_: Message) -> Future[None]:
            session_of(self._services).on_own_order()  # it may have asked for seconds
            return self._shown(shown_by, before_count, SHOWN_COUNT, again)

        return then_wait(chosen, shown)

    def _shown(
        self, shown_by: frozenset[int], before_count: int, checks_count: int, otherwise: Callable[[], Future[None]]
    ) -> Future[None]:
        """Waits until the current item is one of some. MAVROS' answer says only that one was reported."""
        received = self._topics().heard
        is_new = self._received(MissionType.MISSION).messages_count > before_count
        if received is not None and is_new and received.seq in shown_by:
            return done(None)
        if checks_count <= 0:
            return otherwise()
        pause = self._services.pause(SHOWN_S)
        return then_wait(pause, lambda _: self._shown(shown_by, before_count, checks_count - 1, otherwise))

    def _received(self, kind: MissionType) -> ReceivedList:
        return self._topics().lists[kind]

    def _topics(self) -> MissionTopics:
        return session_of(self._services).telemetry.missions


class _Replacement:
    """Has the autopilot keep other items, reads them back, and sends again what differs."""

    def __init__(
        self,
        lists: MavrosLists,
        services: Services,
        kind: MissionType,
        items: tuple[MissionItem, ...],
        refusal: Refusal,
        differs: Difference,
    ) -> None:
        self._lists = lists
        self._services = services
        self._kind = kind
        self._items = items
        self._refusal = refusal
        self._differs = differs
        self._writes_count = 0
        self._texts_count = 0

    def begin(self) -> Future[MissionList]:
        """Sends them. MAVROS clears a list that is to be empty: it cannot push one."""
        self._writes_count += 1
        self._texts_count = self._counts()
        plugin, what = _PLUGINS[self._kind], f"change its {self._kind.text}"
        doubt = f"it is not known which {self._kind.text} the autopilot has now: read it"
        push = {"start_index": 0, "waypoints": [waypoint_of(each) for each in self._items]}
        service, arguments = (f"{plugin}/push", push) if self._items else (f"{plugin}/clear", {})
        sent = self._services.call_free(service, arguments, TRANSFER_S, what, doubt, refusal=self._refusal)
        return then_wait(sent, self._sent)

    def _sent(self, answer: Message) -> Future[MissionList]:
        if answer["success"]:
            return then_wait(caught(self._lists.read_now(self._kind), self._unread), self._judge)
        if self._writes_count < WRITES_COUNT:
            return self._again()
        got = answer.get("wp_transfered")
        how_far = "" if got is None else f", MAVROS got as far as item {got} of {len(self._items)}"
        text = f"{self._kind.text}: the autopilot has not taken it{how_far}{self._status_text()}; MAVROS' log says why"
        raise RejectedByAutopilotError(f"{text}; read what the autopilot has now", {"list": self._kind.text})

    def _unread(self, error: BaseException) -> Future[MissionList]:
        raise not_read_back(error, self._kind) if isinstance(error, UalError) else error

    def _judge(self, found: MissionList) -> Future[MissionList]:
        text = self._differs(self._items, found.items)
        if not text:
            return done(found)
        if self._writes_count >= WRITES_COUNT:
            raise kept_otherwise(self._kind, text)
        return self._again()

    def _again(self) -> Future[MissionList]:
        return then_wait(self._services.pause(BUSY_RETRY_S), lambda _: self.begin())

    def _counts(self) -> int:
        return session_of(self._services).telemetry.counts[topics.STATUS_TEXT]

    def _status_text(self) -> str:
        """Returns the autopilot's texts since then."""
        has_reported = self._counts() > self._texts_count
        return f"; it said: {session_of(self._services).telemetry.status_text}" if has_reported else ""


def session_of(services: Services) -> MavrosSession:
    """Returns the session.

    Raises:
        LinkLostError: There is none any more.

    """
    session = services.access.session()
    if session is None:
        raise LinkLostError("no autopilot is heard through MAVROS any more")
    return session


def _reading(kind: MissionType) -> str:
    return f"read its {kind.text}"
