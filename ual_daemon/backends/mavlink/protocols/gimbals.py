"""The gimbals of a vehicle: those that its autopilot manages, and those with a manager in a component of its own.

https://mavlink.io/en/services/gimbal_v2.html.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from typing_extensions import override

from ual.errors import LinkLostError
from ual.gimbals import GimbalAbility
from ual_daemon.backends.engine.agreement import Agreement
from ual_daemon.backends.mavlink.dialects.command_long import (
    LongCommand,
    default_interval,
    request_message,
    set_message_interval,
)
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.gimbal_link import GimbalLink, GimbalSender
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

_log = logging.getLogger(__name__)

_INFORMATION = mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION
_STATUS = mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS
_ATTITUDE = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS
MESSAGE_IDS = frozenset({_INFORMATION, _STATUS, _ATTITUDE})
"""Messages that are taken of any component of the vehicle's system, ..."""
COMPONENTS = frozenset(
    {
        mavlink.MAV_COMP_ID_GIMBAL,
        *range(mavlink.MAV_COMP_ID_GIMBAL2, mavlink.MAV_COMP_ID_GIMBAL6 + 1),
        *range(mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER4 + 1),
    }
)
"""... and of these their heartbeats, too: they are asked whether they manage one. Others are found by their status."""
FIRST_REQUEST_S = 3.0
"""Seconds after its first message at which a component is queried for its gimbals, ..."""
ASK_S, ASKS_COUNT = 2.0, 12
"""... and seconds between further questions, and their count: on a link that loses 30 % each way, one in 10,000 is not
found then.
"""
AUTOPILOT_ASKS_COUNT = 3
"""The same for the autopilot, to which each request is repeated by itself."""
LARGEST_ATTACHED_ID = 6
"""Devices up to this id are attached to their manager; the id of another one is its component."""
MOST_GIMBALS = 12
MOST_DOUBTED_GIMBALS = 32
"""Most gimbals that are remembered that have reported once, and are not sure to be there."""
QUESTION_PERIOD_S = 0.5
"""Seconds between two questions to a manager whose report is doubted."""


class GimbalServices(NamedTuple):
    """Services of the session with the autopilot that the protocol needs.

    Attributes:
        send: Sends a message.
        send_perishable: Sends one that is of no use when it is late.
        submit: Sends a request for data to the autopilot, in its turn with the other requests.
        own_ids: Returns our system and component.
        says_manager: Whether the autopilot says that it manages gimbals.
        is_flying: Whether the vehicle may be flying.
    """

    send: Callable[[Message], object]
    send_perishable: Callable[[Message], object] = lambda _message: None
    submit: Callable[[LongCommand, float], object] = lambda _command, _now_s: None
    own_ids: Callable[[], MessageSource] = lambda: MessageSource(0, 0)
    says_manager: Callable[[], bool] = lambda: False
    is_flying: Callable[[], bool] = lambda: False


class _GimbalQuestions(NamedTuple):
    """Questions to a component for its gimbals so far, and the time of the next one."""

    asks_count: int
    next_s: float


class GimbalProtocol(Protocol):
    """Belongs to the thread that receives; `found` is for any thread.

    A gimbal keeps its number while the daemon runs, also if nothing is received from it any more.
    """

    def __init__(self, means: GimbalServices) -> None:
        self.found: tuple[GimbalLink, ...] = ()
        self._means = means
        self._target: MessageSource | None = None
        self._dialect: Dialect | None = None
        self._questions: dict[int, _GimbalQuestions] = {}
        self._doubted: dict[tuple[MessageSource, int], Agreement[bool]] = {}
        """Gimbals that have reported once."""
        self._next_again_s = -math.inf

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        on_parameter = {mavlink.MAVLINK_MSG_ID_PARAM_VALUE: lambda message, _: self._on_parameter(message)}
        return {**dict.fromkeys(MESSAGE_IDS, self._on_autopilot), **on_parameter}

    @property
    @override
    def is_urgent(self) -> bool:
        return bool(self.found) and any(each.is_busy for each in self.found)

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        if self._target is not None and self._target != target:
            self.drop("another autopilot was found")
        self._target, self._dialect = target, dialect
        self._forget()

    @override
    def release(self) -> None:
        for each in self.found:
            each.leave()
            if each.has_asked:
                for message_id in (_ATTITUDE, _STATUS):
                    stream = default_interval(set_message_interval(message_id, 1.0))
                    self._means.send(stream.request.encode(each.manager, 0))

    @override
    def drop(self, why: str) -> None:
        for each in self.found:
            each.drop(LinkLostError(f"{each.name} was given up: {why}"))
        self._forget()

    def _forget(self) -> None:
        """Has all of them asked again: after a boot their limits, their kinds and their controllers may be others."""
        self._questions = {}
        self._doubted.clear()
        for each in self.found:
            each.forget(is_kind_known=not self._has_kind(each.manager, each.device_id))

    @override
    def tick(self, now_s: float) -> None:
        if self._target is not None:
            self._ask(self._target.component_id, now_s)
        if self._doubted or any(each.is_doubtful for each in self.found):
            self._ask_again(now_s)
        for each in self.found:
            each.tick(now_s)

    def is_wanted(self, component_id: int) -> bool:
        """Returns whether the heartbeats of a component, and its answers, are worth decoding."""
        return component_id in COMPONENTS or any(each.manager.component_id == component_id for each in self.found)

    # --- What comes ---------------------------------------------------------------------------------------------------

    def on_ack(self, component_id: int, message: Message, now_s: float) -> None:
        """Takes the answer of a component to a command."""
        for each in self.found:
            if each.manager.component_id == component_id:
                each.on_ack(message, now_s)

    def on_component(self, source: MessageSource, message: Message, now_s: float) -> None:
        """Takes a message of another component of the vehicle."""
        message_id = message.get_msgId()
        if message_id == mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
            self.on_ack(source.component_id, message, now_s)
        elif message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            if source.component_id in COMPONENTS:
                self._ask(source.component_id, now_s)
        elif message_id in MESSAGE_IDS:
            self._on_message(source, message, now_s)

    def _on_autopilot(self, message: Message, now_s: float) -> None:
        if self._target is not None:
            self._on_message(self._target, message, now_s)

    def _on_message(self, source: MessageSource, message: Message, now_s: float) -> None:
        message_id, device_id = message.get_msgId(), message.gimbal_device_id
        if message_id == _ATTITUDE:
            self._on_attitude(source, message, now_s)
        elif device_id > 0:
            link = self._found(source, device_id)
            if message_id == _INFORMATION:
                link = link or self._add_sure(source, device_id, now_s)
                if link is not None:
                    link.on_information(message, now_s, self._lacks(source), is_flying=self._means.is_flying())
            elif link is not None:
                link.on_status(message, now_s)
            else:  # it manages one that has not identified itself
                self._ask(source.component_id, now_s, is_manager=True)

    def _on_attitude(self, source: MessageSource, message: Message, now_s: float) -> None:
        for each in self.found:
            is_attached = each.device_id <= LARGEST_ATTACHED_ID
            if is_attached and each.manager == source and message.gimbal_device_id in (0, each.device_id):
                each.on_attitude(message, now_s, is_of_manager=True)
            elif not is_attached and each.device_id == source.component_id:
                each.on_attitude(message, now_s, is_of_manager=False)

    def _found(self, source: MessageSource, device_id: int) -> GimbalLink | None:
        return next((each for each in self.found if (each.manager, each.device_id) == (source, device_id)), None)

    def _add_sure(self, source: MessageSource, device_id: int, now_s: float) -> GimbalLink | None:
        """Adds one that has reported twice that it is there: it keeps its number for good."""
        key = (source, device_id)
        if key not in self._doubted and len(self._doubted) >= MOST_DOUBTED_GIMBALS:
            return None
        there = self._doubted.setdefault(key, Agreement(assumed=False, count=2, span_s=0.0))
        if not there.note(True, now_s, is_flying=False):
            self._next_again_s = -math.inf
            return None
        del self._doubted[key]
        return self._add(source, device_id)

    def _ask_again(self, now_s: float) -> None:
        """Asks those managers again whose last word is doubted, and forgets those that were received once."""
        for key, there in list(self._doubted.items()):
            there.tick(now_s, is_flying=False)
            if not there.is_open:
                del self._doubted[key]
        if now_s >= self._next_again_s:
            self._next_again_s = now_s + QUESTION_PERIOD_S
            doubted = {each.manager for each in self.found if each.is_doubtful}
            for source in sorted({source for source, _ in self._doubted} | doubted):
                self._request(source, request_message(_INFORMATION), now_s)

    def _add(self, source: MessageSource, device_id: int) -> GimbalLink:
        line = GimbalSender(
            self._means.send,
            self._means.send_perishable,
            partial(self._stream, source),
            partial(self._read_kind, device_id),
            self._means.own_ids,
        )
        link = GimbalLink(len(self.found), source, device_id, line, is_kind_known=not self._has_kind(source, device_id))
        if len(self.found) < MOST_GIMBALS:
            self.found = (*self.found, link)
            _log.info("gimbal %d was found: %s", link.number, link.name)
        return link

    def _has_kind(self, source: MessageSource, device_id: int) -> bool:
        """Returns whether a parameter of the autopilot says what the attitude of its own gimbal means."""
        is_own = source == self._target and device_id <= LARGEST_ATTACHED_ID
        return is_own and self._dialect is not None and bool(self._dialect.gimbal_kind_parameter)

    def _lacks(self, source: MessageSource) -> frozenset[GimbalAbility]:
        is_of_autopilot = source == self._target and self._dialect is not None
        return self._dialect.lacking_gimbal_abilities if is_of_autopilot and self._dialect else frozenset()

    # --- What is requested --------------------------------------------------------------------------------------------

    def _ask(self, component_id: int, now_s: float, *, is_manager: bool = False) -> None:
        """Asks a component what it manages, from time to time, until it has reported so. `is_manager`: it has shown
        that it manages one.
        """
        target = self._target
        known = [each for each in self.found if each.manager.component_id == component_id]
        if known and all(each.is_identified for each in known):
            self._questions.pop(component_id, None)
            return
        if target is None:
            return
        questions = self._questions.get(component_id)
        if questions is None:
            questions = self._questions[component_id] = _GimbalQuestions(0, now_s + FIRST_REQUEST_S)
        most_count = AUTOPILOT_ASKS_COUNT if component_id == target.component_id else ASKS_COUNT
        if now_s < questions.next_s or questions.asks_count >= most_count:
            return
        if not (is_manager or self._may_ask(component_id)):
            return
        self._questions[component_id] = _GimbalQuestions(questions.asks_count + 1, now_s + ASK_S)
        self._request(MessageSource(target.system_id, component_id), request_message(_INFORMATION), now_s)

    def _may_ask(self, component_id: int) -> bool:
        is_reported = self._dialect is not None and self._dialect.tells_gimbal_manager
        is_autopilot = self._target is not None and component_id == self._target.component_id
        return not (is_autopilot and is_reported) or self._means.says_manager()

    def _stream(self, source: MessageSource, message_id: int, rate_hz: float, now_s: float) -> None:
        self._request(source, set_message_interval(message_id, rate_hz), now_s)

    def _read_kind(self, device_id: int) -> None:
        """Asks the autopilot for the kind of one of its gimbals."""
        if self._target is not None and self._dialect is not None:
            name = self._dialect.gimbal_kind_parameter.format(device_id).encode("ascii")
            self._means.send(mavlink.MAVLink_param_request_read_message(*self._target, name, -1))

    def _on_parameter(self, message: Message) -> None:
        dialect = self._dialect
        if dialect is None or not dialect.gimbal_kind_parameter:
            return
        for each in self.found:
            is_its_kind = message.param_id == dialect.gimbal_kind_parameter.format(each.device_id)
            if is_its_kind and each.manager == self._target:
                kind = dialect.parameter_value(message)
                each.meant = None if kind is None else dialect.gimbal_references.get(kind)
                each.is_kind_known = True

    def _request(self, source: MessageSource, command: LongCommand, now_s: float) -> None:
        """Sends a request. Those to the autopilot take their turn, as answers do not say which one they are for."""
        if source == self._target:
            self._means.submit(command, now_s)
        else:
            self._means.send(command.request.encode(source, 0))
