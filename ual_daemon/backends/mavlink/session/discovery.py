"""Finds the autopilot on a link, and opens the session with it. No threads, sockets or clock."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

from typing_extensions import override

from ual_daemon.backends.autopilots.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavlink.autopilots.detection import Kind, dialect_of, kind_of, kind_text
from ual_daemon.backends.mavlink.autopilots.dialect import Dialect
from ual_daemon.backends.mavlink.links import Address, Transport
from ual_daemon.backends.mavlink.session.heartbeat_watchdog import OWN_HEARTBEAT_S, own_heartbeat
from ual_daemon.backends.mavlink.session.payload_messages import PayloadMessages
from ual_daemon.backends.mavlink.session.session import Session, Successor
from ual_daemon.backends.mavlink.session.supervision import LinkState, LinkStatistics, Supervision
from ual_daemon.backends.mavlink.settings import SECTION, MavlinkSettings
from ual_daemon.backends.mavlink.wire.messages import Codec, Message
from ual_daemon.backends.mavlink.wire.receiver import Receiver, Selector
from ual_daemon.backends.mavlink.wire.sender import Sender
from ual_daemon.backends.mavlink.wire.signing import Signer

_log = logging.getLogger(__name__)

_MOST_OTHERS = 8
"""So many other autopilots are named in the log."""
_CALLER_SYSTEM_ID = 245
"""Our system until the autopilot is found, whose system we then join."""


class Discovery(Selector):
    """Selects the first autopilot whose heartbeat comes, if the settings allow it, and keeps the session with it.

    Not thread-safe: belongs to the thread that receives. `receiver` and `sender` are the two ways through the link;
    `session` is None until the autopilot is found. `url` is for the log.
    """

    def __init__(
        self,
        settings: MavlinkSettings,
        link: Transport,
        url: str,
        setpoints: SetpointMonitor,
        signer: Signer | None = None,
        payload_messages: PayloadMessages | None = None,
    ) -> None:
        codec = Codec(settings.component_id, signer)
        codec.join(_CALLER_SYSTEM_ID)
        self.sender = Sender(link, codec)
        self.receiver = Receiver(link, codec, self, settings.system_id, signer)
        self.supervision = Supervision(url, Dialect.freshness.link_s)
        self.session: Session | None = None
        self._settings = settings
        self._link = link
        self._setpoints = setpoints
        self._payload_messages = payload_messages or PayloadMessages()
        self._next_heartbeat_s = -math.inf
        self._other_system_ids: set[int] = set()
        self._passed_over: set[int] = set()

    def reconnected(self) -> None:
        """Starts anew with a new other end of the link, which continues no frame and has received no request."""
        self.receiver.reconnected()
        if self.session is not None:
            self.session.restart_setup()

    def discard_state(self) -> None:
        """Discards all that may have changed since it was received."""
        if self.session is not None:
            self.session.discard_state()

    def release(self) -> None:
        """Ends the session: the autopilot need not send what was requested any more."""
        if self.session is not None and self.supervision.state is not LinkState.LOST:
            self.session.release()

    def tick(self, now_s: float) -> None:
        """Does what is due; to be called often."""
        self.receiver.tick(now_s)
        self.supervision.tick(now_s)
        if self.session is not None:
            self.session.tick(now_s)
            if self.session.successor is not None:
                self._replace_session(self.session.system_id, self.session.successor)
        elif self._link.peer is not None and now_s >= self._next_heartbeat_s:
            self._next_heartbeat_s = now_s + OWN_HEARTBEAT_S
            self.sender.send(own_heartbeat())

    def link_statistics(self, now_s: float) -> LinkStatistics:
        """Returns the quality of the link. From any thread."""
        receiver, session = self.receiver, self.session
        return replace(
            self.supervision.statistics(now_s, receiver.corrupt_count, receiver.unsigned_count),
            stranger_count=receiver.stranger_count,
            impossible_count=0 if session is None else session.telemetry.plausibility.counts.total(),
        )

    @override
    def on_heartbeat(self, system_id: int, heartbeat: Message, address: Address | None) -> Session | None:
        kind = kind_of(heartbeat)
        if not kind.is_vehicle and self._settings.system_id is None:
            self._pass_over(system_id, kind)
            return None
        self.sender.join(system_id)
        return self._open_session(system_id, kind, dialect_of(kind), address)

    def _pass_over(self, system_id: int, kind: Kind) -> None:
        if system_id not in self._passed_over and len(self._passed_over) < _MOST_OTHERS:
            self._passed_over.add(system_id)
            _log.info("system %d is no vehicle, but %s: waiting for another one", system_id, kind_text(kind))

    def _replace_session(self, system_id: int, successor: Successor) -> None:
        """Opens the session anew, as the vehicle is another one than its heartbeats said, or than was there before."""
        dialect = dialect_of(successor.kind)
        self.receiver.replace_handler(self._open_session(system_id, successor.heartbeats_kind, dialect, None))

    def _open_session(self, system_id: int, kind: Kind, dialect: Dialect, address: Address | None) -> Session:
        """Opens the session with an autopilot whose heartbeats are of this kind."""
        self.session = Session(
            system_id,
            kind,
            dialect,
            self._settings,
            self.sender,
            self.supervision,
            self._setpoints,
            self._payload_messages,
        )
        self.supervision.lost_s = dialect.freshness.link_s
        where = "" if address is None else f", at {address[0]}:{address[1]}"
        _log.info("connected to %s, system %d%s", dialect.name, system_id, where)
        return self.session

    @override
    def on_other_heartbeat(self, system_id: int) -> None:
        others = self._other_system_ids
        if self.session is None or self._settings.system_id is not None or system_id in others:
            return
        if len(others) >= _MOST_OTHERS:
            return
        self._other_system_ids.add(system_id)
        _log.warning(
            "more than one autopilot is heard: systems %s; this one flies system %d, the first heard; "
            "choose with %s.system_id",
            ", ".join(map(str, sorted({self.session.system_id, *self._other_system_ids}))),
            self.session.system_id,
            SECTION,
        )
