"""Finds the autopilot on a link, and opens the session with it. No threads, sockets or clock."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from functools import partial

from typing_extensions import override

from ual_daemon import logs
from ual_daemon.backends.engine.link_watch import LinkWatch, LinkWatchState
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavlink.dialects.command_long import LongCommand
from ual_daemon.backends.mavlink.dialects.detection import HeartbeatKind, dialect_of, kind_of, kind_text
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.links import Address, MessageTransport
from ual_daemon.backends.mavlink.protocols import cameras, component_commands, gimbals
from ual_daemon.backends.mavlink.protocols.gimbals import GimbalServices
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.mavlink.session.heartbeat_watchdog import OWN_HEARTBEAT_S, own_heartbeat
from ual_daemon.backends.mavlink.session.payload_messages import PayloadMessages
from ual_daemon.backends.mavlink.session.session import ALL_SYSTEMS_ID, MavlinkSession, Successor
from ual_daemon.backends.mavlink.session.shape import Shape
from ual_daemon.backends.mavlink.session.supervision import LinkCounts, LinkStatistics
from ual_daemon.backends.mavlink.settings import SECTION, MavlinkSettings
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame, MessageSource
from ual_daemon.backends.mavlink.wire.messages import Codec, Message, mavlink
from ual_daemon.backends.mavlink.wire.receiver import Receiver, Selector, source_text
from ual_daemon.backends.mavlink.wire.sender import Sender
from ual_daemon.backends.mavlink.wire.signing import Signer
from ual_daemon.backends.mavlink.wire.untaken import LASTING_NOTE_S

_log = logging.getLogger(__name__)

_MOST_OTHERS = 8
"""Most other autopilots, and most reasons why nothing is taken, that are named in the log."""
ODD_AUTOPILOT_WAIT_S = 1.5
"""Seconds without an autopilot of usual ids after which one with odd ids (system 0, or not component 1) is taken. A
heartbeat comes each second.
"""
SUCCESSOR_SILENCE_S = 0.8
"""Seconds of silence under its old system id after which an autopilot is followed to the one that UAL has written."""
STRAY_S = 2.5
"""Seconds after a single heartbeat and nothing more, after which another autopilot that is received replaces its
sender.
"""
_UNHEARD = (LinkWatchState.CONNECTING, LinkWatchState.LOST)
_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_CALLER_SYSTEM_ID = 245
"""Our system until the autopilot is found, whose system we then join."""


class Discovery(Selector):
    """Selects the first autopilot whose heartbeat comes, if the settings allow it, and keeps the session with it.

    Not thread-safe: belongs to the thread that receives. `receiver` and `sender` are the two ways through the link;
    `session` is None until the autopilot is found. `url` is human-readable.
    """

    def __init__(
        self,
        settings: MavlinkSettings,
        link: MessageTransport,
        url: str,
        setpoints: SetpointMonitor,
        signer: Signer | None = None,
        payload_messages: PayloadMessages | None = None,
    ) -> None:
        codec = Codec(settings.component_id, signer)
        codec.join(_CALLER_SYSTEM_ID)
        self.sender = Sender(link, codec)
        self.receiver = Receiver(link, codec, self, signer)
        self.watch = LinkWatch(url, Dialect.freshness.link_s, on_lost=self.discard_state, on_anew=self._request_anew)
        self.supervision = LinkCounts(self.watch)
        self.session: MavlinkSession | None = None
        self.protocols = Protocols(
            self.sender.send,
            self.watch.is_up,
            self._may_be_flying,
            lambda: link.has_room,
            self._speed_up,
            GimbalServices(
                self.sender.send,
                partial(self.sender.send, is_perishable=True),
                self._submit,
                self._own_ids,
                self._says_gimbal_manager,
                self._may_be_flying,
            ),
        )
        self.protocols.progress.on_order = self._on_own_order
        self.protocols.progress.on_report = self._on_mission_report
        self._settings = settings
        self._link = link
        self._setpoints = setpoints
        self._payload_messages = payload_messages or PayloadMessages()
        self._next_heartbeat_s = -math.inf
        self._url = url
        self._others: set[MessageSource] = set()
        self._logged: set[str] = set()

    def reconnected(self) -> None:
        """Starts again with a new other end of the link, which continues no frame and has received no request."""
        self.receiver.reconnected()
        self._request_anew()

    def discard_state(self) -> None:
        """Discards all that may have changed since it was received."""
        self.protocols.gripper.forget_state()
        if self.session is not None:
            self.session.discard_state()

    def _may_be_flying(self) -> bool:
        return self.session is None or self.session.telemetry.is_armed is not False

    def _speed_up(self, factor: float) -> None:
        if self.session is not None:
            self.session.speed_up(factor)

    def _on_own_order(self, now_s: float) -> None:
        if self.session is not None:
            self.session.on_own_order(now_s)

    def _on_mission_report(self, now_s: float, is_complete: bool) -> None:
        if self.session is not None:
            self.session.on_mission_report(now_s, is_complete=is_complete)

    def _submit(self, request: LongCommand, now_s: float) -> None:
        if self.session is not None:
            self.session.submit(request, now_s)

    def _own_ids(self) -> MessageSource:
        system_id = _CALLER_SYSTEM_ID if self.session is None else self.session.system_id
        return MessageSource(system_id, self._settings.component_id)

    def _says_gimbal_manager(self) -> bool:
        version = None if self.session is None else self.session.telemetry.version
        flag = mavlink.MAV_PROTOCOL_CAPABILITY_COMPONENT_IMPLEMENTS_GIMBAL_MANAGER
        return version is not None and bool(version.capabilities & flag)

    def _request_anew(self) -> None:
        if self.session is not None:
            self.session.restart_setup()

    def release(self) -> None:
        """Ends the session: the autopilot need not send what was requested, nor keep open what was opened."""
        is_in_contact = self.session is not None and self.watch.state is not LinkWatchState.LOST
        if is_in_contact:
            self.protocols.release()
        self.protocols.drop("the daemon ends")
        if self.session is not None and is_in_contact:
            self.session.release()

    def tick(self, now_s: float) -> None:
        """Does what is due; to be called often."""
        self.receiver.tick(now_s)
        self.watch.tick(now_s)
        self._tell_silence(now_s)
        self.protocols.tick(now_s)
        if self.session is not None:
            self.session.tick(now_s)
            if self.session.successor is not None:
                self._replace_session(self.session.source, self.session.successor)
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

    def why_silent(self, now_s: float) -> str:
        """Returns what is received instead of the autopilot while that is not received, or from where nothing is.

        Empty while it is received.
        """
        watch = self.watch
        if watch.state not in _UNHEARD:
            return ""
        since_s = -math.inf if watch.heard_s is None else watch.heard_s
        notes = self.receiver.untaken.text(now_s, since_s)
        return f"heard at {self._url} instead: {notes}" if notes else f"nothing comes to {self._url}"

    @override
    def is_wanted(self, source: MessageSource, heartbeat: Message) -> bool:
        return not self._why_not(source, kind_of(heartbeat))

    @override
    def is_stray(self, now_s: float) -> bool:
        session = self.session
        return session is not None and session.identity.is_stray and self.watch.is_silent(now_s, STRAY_S)

    @override
    def on_heartbeat(
        self, source: MessageSource, heartbeat: Message, address: Address | None, now_s: float
    ) -> MavlinkSession | None:
        kind, untaken = kind_of(heartbeat), self.receiver.untaken
        if self._is_odd(source):
            why = "waiting for an autopilot with usual ids"
            untaken.note(source, _heartbeat_text(source, kind, address, why), now_s)
            if untaken.lasts_s(source, now_s) < ODD_AUTOPILOT_WAIT_S:
                return None
        is_addressable = source.system_id != ALL_SYSTEMS_ID
        if is_addressable:
            self.sender.join(source.system_id)
        return self._open_session(source, kind, dialect_of(kind, is_addressable=is_addressable), address)

    @override
    def on_other_heartbeat(
        self, source: MessageSource, heartbeat: Message, address: Address | None, now_s: float
    ) -> None:
        kind = kind_of(heartbeat)
        is_vehicle = kind.is_autopilot and kind.is_vehicle
        why = self._why_not(source, kind)
        if not why and self.session is not None:
            why = f"this daemon flies {source_text(self.session.source)}, the first heard"
            if is_vehicle and not self.protocols.parameters.becomes(source.system_id):
                self._tell_other(source)
        self.receiver.untaken.note(source, _heartbeat_text(source, kind, address, why), now_s, is_minor=not is_vehicle)

    @override
    def is_successor(self, source: MessageSource, now_s: float) -> bool:
        session, heard_s = self.session, self.watch.heard_s
        if session is None or heard_s is None or self._settings.system_id is not None:
            return False
        is_ours = source.component_id == session.source.component_id and self.protocols.parameters.becomes(
            source.system_id
        )
        is_known = source in self._others  # another vehicle had this id before
        if not is_ours or is_known or now_s - heard_s < SUCCESSOR_SILENCE_S:
            return False
        logs.event(_log, logging.WARNING, "system_id_changed", old=session.system_id, new=source.system_id)
        return True

    @override
    def is_component_wanted(self, frame: MavlinkFrame) -> bool:
        if frame.message_id in component_commands.MESSAGE_IDS or frame.message_id in gimbals.MESSAGE_IDS:
            return True
        return frame.component_id in cameras.COMPONENTS and frame.message_id in cameras.MESSAGE_IDS

    @override
    def on_component(self, source: MessageSource, message: Message, now_s: float, utc_now_s: float) -> None:
        system_id = getattr(message, "target_system", 0)
        component_id = getattr(message, "target_component", 0)
        if system_id in (0, source.system_id) and component_id in (0, self._settings.component_id):
            if source.component_id in cameras.COMPONENTS:
                self.protocols.cameras.on_component(source, message, now_s, utc_now_s)
            is_of_any = message.get_msgId() in component_commands.MESSAGE_IDS
            if is_of_any:
                self.protocols.components.on_component(source, message, now_s)
            if not is_of_any or self.protocols.gimbals.is_wanted(source.component_id):
                self.protocols.gimbals.on_component(source, message, now_s)

    def _is_odd(self, source: MessageSource) -> bool:
        """Returns whether it has ids that an autopilot seldom has, and that were not chosen."""
        is_usual = source.component_id == _AUTOPILOT or self._settings.autopilot_component_id is not None
        return source.system_id == ALL_SYSTEMS_ID or not is_usual

    def _why_not(self, source: MessageSource, kind: HeartbeatKind) -> str:
        """Returns, human-readable, why the sender of a heartbeat may not be selected; empty if it may."""
        only, only_component = self._settings.system_id, self._settings.autopilot_component_id
        is_named = kind.names_firmware or source.system_id == ALL_SYSTEMS_ID
        if not kind.is_autopilot:
            return "no autopilot"
        if only not in (None, source.system_id):
            return f"{SECTION}.system_id is {only}"
        if only_component not in (None, source.component_id):
            return f"{SECTION}.autopilot_component_id is {only_component}"
        if not kind.is_vehicle and only is None:
            return "no vehicle"
        if only_component is None and source.component_id != _AUTOPILOT and not (is_named and kind.names_vehicle):
            return f"if it is the autopilot, set {SECTION}.autopilot_component_id={source.component_id}"
        return ""

    def _tell_silence(self, now_s: float) -> None:
        """Logs once each what is received instead of the autopilot."""
        watch, logged = self.watch, self._logged
        if watch.state not in _UNHEARD or len(logged) >= _MOST_OTHERS:
            return
        since_s = -math.inf if watch.heard_s is None else watch.heard_s
        notes = self.receiver.untaken.text(now_s, since_s, lasts_s=LASTING_NOTE_S)
        if notes and notes not in logged:
            logged.add(notes)
            logs.event(_log, logging.WARNING, "no_autopilot", url=self._url, heard=notes)

    def _replace_session(self, source: MessageSource, successor: Successor) -> None:
        """Reopens the session, as the vehicle is another one than its heartbeats reported, or than was there before."""
        dialect = dialect_of(successor.kind, is_addressable=source.system_id != ALL_SYSTEMS_ID)
        session = self._open_session(source, successor.heartbeats_kind, dialect, None, successor.shape)
        self.receiver.replace_handler(session)

    def _open_session(
        self,
        source: MessageSource,
        kind: HeartbeatKind,
        dialect: Dialect,
        address: Address | None,
        shape: Shape | None = None,
    ) -> MavlinkSession:
        """Opens the session with an autopilot whose heartbeats are of this kind."""
        self.session = MavlinkSession(
            source,
            kind,
            dialect,
            self._settings,
            self.sender,
            self.supervision,
            self._setpoints,
            self._payload_messages,
            self.protocols,
            shape,
        )
        self.protocols.attach(source, dialect)
        self.watch.lost_s = dialect.freshness.link_s
        where = "" if address is None else f", at {address[0]}:{address[1]}"
        _log.info("connected to %s, %s%s", dialect.name, source_text(source), where)
        return self.session

    def _tell_other(self, source: MessageSource) -> None:
        """Logs once each that there is another autopilot."""
        others, session = self._others, self.session
        if session is None or source in others or len(others) >= _MOST_OTHERS:
            return
        others.add(source)
        _log.warning(
            "more than one autopilot is heard: %s; this one flies %s, the first heard; choose with %s.system_id%s",
            " and ".join(map(source_text, sorted({session.source, *others}))),
            source_text(session.source),
            SECTION,
            f" and {SECTION}.autopilot_component_id" if source.system_id == session.system_id else "",
        )


def _heartbeat_text(source: MessageSource, kind: HeartbeatKind, address: Address | None, why: str) -> str:
    """Returns, human-readable, what sends a heartbeat, and why it is not taken."""
    where = "" if address is None else f" at {address[0]}:{address[1]}"
    return f"{kind_text(kind)} ({source_text(source)}{where}): {why}"
