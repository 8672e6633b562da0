"""Finds out what MAVROS is connected to, and keeps the session with it. Belongs to the link's thread."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from ual.shared.ages import without_seconds
from ual_daemon import logs
from ual_daemon.backends.engine.agreement import Agreement
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.commands import Answer
from ual_daemon.backends.mavros.session import FRESHNESS, MavrosSession
from ual_daemon.backends.mavros.settings import MavrosSettings
from ual_daemon.backends.mavros.topics import TOPICS
from ual_daemon.backends.mavros.vehicle import VehicleDescription, read_vehicle
from ual_daemon.backends.rosbridge import Graph, Message, RosbridgeLink
from ual_daemon.backends.rosbridge.calls import ServiceError
from ual_daemon.backends.values import Snapshot, VehicleInfo

_log = logging.getLogger(__name__)

ASK_S, ASK_AGAIN_S = 1.0, 10.0
"""Seconds between two questions to MAVROS for its autopilot: while it is not fully known, and later, since it may
change.
"""
_CALL_S = 3.0
_TOPIC_SILENCE_S = 5.0
"""Seconds of silence after which a topic is subscribed to again."""

OnMessage = Callable[[MavrosSession, str, Message, float], None]


class MavrosDiscovery:
    """`on_message` gets the messages of the session's autopilot; `why_not` says human-readably why none is flown.

    It is what the backend's loop drives.
    """

    def __init__(
        self,
        link: RosbridgeLink,
        settings: MavrosSettings,
        sent: SetpointMonitor,
        on_message: OnMessage,
        utc_s: Callable[[], float],
    ) -> None:
        self.session: MavrosSession | None = None
        self.watch = LinkWatch(str(link.url), FRESHNESS.link_s)
        self.info = VehicleInfo()
        """Vehicle info while there is no session."""
        self._link = link
        self._settings = settings
        self._sent = sent
        self._on_message = on_message
        self._utc_s = utc_s
        self._trouble = "MAVROS was not asked yet"
        self._logged: set[str] = set()
        """Lines that were logged since the last fault-free moment."""
        self._kind: Agreement[tuple[int, ...]] | None = None
        """Its system, its firmware and its type. MAVROS tells those of the newest heartbeat."""
        self._question: Future[Message] | None = None
        self._ask_s = -math.inf
        self._graph: Graph | None = None
        self._subscribed: set[str] = set()
        self._connections_count = 0

    @property
    def why_not(self) -> str:
        """Why no autopilot can be flown, human-readable; empty if one can."""
        if self._link.why_not:
            return self._link.why_not
        if self._trouble:
            return self._trouble
        session = self.session
        if session is not None and session.telemetry.counts[topics.STATE] and not session.telemetry.is_connected:
            return _UNHEARD
        required = [name for name, topic in TOPICS.items() if topic.is_required]
        faults = [each for each in self._link.faults() if each.endswith(tuple(required))]
        return faults[0] if faults else ""

    @property
    def is_urgent(self) -> bool:
        """Whether the effect of a command is awaited."""
        return self.session is not None and self.session.runner.is_any_pending

    def discard(self, now_s: float, pause_s: float) -> None:
        """Discards what may have changed in a pause of this computer."""
        if self.session is not None:
            self.session.restart(now_s)

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        """Returns the newest data, and why none can be flown."""
        snapshot = Snapshot(now_s) if self.session is None else self.session.snapshot(now_s)
        snapshot = snapshot._replace(updated_s=updated_s, scheduling_gap=scheduling_gap)
        why = self.why_not
        return snapshot.with_trouble(why) if why else snapshot

    def tick(self, now_s: float) -> None:
        """Does what is due; to be called often."""
        link, session = self._link, self.session
        self.watch.tick(now_s)  # also while the bridge is gone
        if link.connections_count != self._connections_count:
            self._connections_count, self._question, self._ask_s = link.connections_count, None, -math.inf
            if session is not None:
                session.restart(now_s)
        if not link.is_up or link.graph is None:
            return
        if session is not None:
            if link.graph is not self._graph:
                self._graph = link.graph
                self._subscribe(session)
            session.tick(now_s, link.graph.ros)  # first: it withdraws what waits and must not leave any more
        self._ask(now_s)

    def call(self, service: str, arguments: Message, take: Callable[[Answer], None], limit_s: float) -> Future[Message]:
        """Calls a service of MAVROS; `take` gets its values, or why there are none. Cancelling the future that it
        returns withdraws the call, if it has not left.
        """

        def ended(future: Future[Message]) -> None:
            if future.cancelled():
                return
            error = future.exception()
            if isinstance(error, ServiceError):
                self._say(str(error))
                take(error)
            else:
                take(future.result())

        name = f"{self._settings.node}/{service}"
        answer = self._link.call_service(name, arguments, limit_s)
        answer.add_done_callback(ended)
        return answer

    def _ask(self, now_s: float) -> None:
        question = self._question
        if question is not None and question.done():
            self._question = None
            self._learn(question, now_s)
        elif question is None and now_s >= self._ask_s:
            is_sure = self._kind is not None and not self._kind.is_open
            is_known = self.session is not None and self.session.description.has_version and not self._trouble
            self._ask_s = now_s + (ASK_AGAIN_S if is_known and is_sure else ASK_S)
            name = f"{self._settings.node}/{topics.VEHICLE_INFO}"
            arguments = {"sysid": 0, "compid": 0, "get_all": False}  # 0: those of its autopilot
            self._question = self._link.call_service(name, arguments, _CALL_S)

    def _learn(self, question: Future[Message], now_s: float) -> None:
        try:
            found = read_vehicle(question.result())
        except ServiceError as error:
            self._set_trouble(f"MAVROS does not answer: {error}")
            return
        except (KeyError, TypeError, ValueError) as error:
            self._set_trouble(f"{topics.VEHICLE_INFO} answers in another way than MAVROS: {error!r}")
            return
        if found is None:
            self._set_trouble(_UNHEARD)
        elif self._is_sure(found, now_s):
            self._meet(found)

    def _is_sure(self, found: VehicleDescription, now_s: float) -> bool:
        """Returns whether what MAVROS says counts: another kind than before does once answers agree, and on the
        ground.
        """
        session, kind = self.session, found[:3]
        if self._kind is None:
            self._kind = Agreement(kind)
        is_flying = session is not None and session.telemetry.flight.is_flying(now_s)
        self._kind.note(kind, now_s, is_flying=is_flying)
        if session is not None:
            session.doubt = f"MAVROS says that it is {found.text}" if self._kind.pending else ""
        return self._kind.value == kind

    def _holds_up_calls(self) -> bool:
        return self._question is not None or self._link.holds_up_calls

    def _meet(self, found: VehicleDescription) -> None:
        autopilot, session = found.autopilot, self.session
        if autopilot is None:
            self.session = None
            self.info = VehicleInfo(limitation=f"UAL flies PX4 and ArduPilot multirotors, not {found.text}")
            self._set_trouble(self.info.limitation)
            return
        self._set_trouble("")
        if session is not None and session.description[:3] == found[:3]:
            session.description = found if found.has_version else session.description
            return
        session = self.session = MavrosSession(
            found, autopilot, self._settings, self._sent, self.call, self.watch, self._utc_s, self._holds_up_calls
        )
        logs.event(_log, logging.INFO, "autopilot_connected", autopilot=autopilot.name, system_id=found.system_id)
        for name in self._subscribed:
            self._link.unsubscribe(name)
        self._subscribed.clear()
        self._subscribe(session)

    def _subscribe(self, session: MavrosSession) -> None:
        """Subscribes to what is there, and to what must be. What MAVROS latches comes again with each subscription."""
        graph = self._link.graph
        for topic, how in TOPICS.items():
            name = f"{self._settings.node}/{topic}"
            is_there = graph is not None and self._link.url.resolve(name) in graph.topics
            if name in self._subscribed or not (is_there or how.is_required):
                continue
            self._subscribed.add(name)
            take = partial(self._on_message, session, topic)
            silence_s = _TOPIC_SILENCE_S if how.is_required else math.inf
            self._link.subscribe(name, how.kind, take, how.throttle_ms, how.queue_length, silence_s)

    def _set_trouble(self, why: str) -> None:
        if self._trouble and not why:
            self._logged.clear()
        self._trouble = why
        if why:
            self._say(why)

    def _say(self, why: str) -> None:
        """Logs a trouble, once until all is well again: several services fail in turn while MAVROS is gone."""
        timeless = without_seconds(why)
        if timeless not in self._logged and len(self._logged) < _MOST_LOGGED_TEXTS:
            self._logged.add(timeless)
            logs.event(_log, logging.WARNING, "mavros_trouble", why=why)


_MOST_LOGGED_TEXTS = 100
_UNHEARD = "MAVROS hears no autopilot: is its fcu_url right, and its target system (tgt_system) that of the autopilot?"
