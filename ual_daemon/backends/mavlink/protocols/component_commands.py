"""Commands to the components of a vehicle that are no autopilot, such as a parachute: those that send heartbeats."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError, TaskAbortedError
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.dialects.command_long import AGAIN, CommandLong
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.camera_exchanges import CameraOrder, CameraSender
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

MESSAGE_IDS = frozenset({mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_COMMAND_ACK})
LOST_COMPONENT_S = 5.0
"""Seconds of silence after which a component counts as not there. Its heartbeat comes each second."""
LATE_ANSWER_S = 0.7
"""Seconds for which a command waits after one that was sent more often than answered, whose late answers may come."""


class ComponentCommands(Protocol):
    """Belongs to the thread that receives. One command of an id is in progress with a component: a newer one replaces
    it.

    `send` sends a message.
    """

    def __init__(self, send: Callable[[Message], object]) -> None:
        self.is_waiting = False
        self._send = send
        self._target: MessageSource | None = None
        self._heard_s: dict[int, float] = {}
        self._orders: dict[tuple[int, int], _ComponentOrder] = {}
        self._queries: list[tuple[int, Future[bool]]] = []
        self._quiet_until_s: dict[tuple[int, int], float] = {}

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {}

    def ask(self, component_id: int, future: Future[bool]) -> None:
        """Ends a future with whether messages of a component arrive."""
        self._queries.append((component_id, future))
        self.is_waiting = True

    def order(self, component_id: int, command: CommandLong, what: str, future: Future[None]) -> None:
        """Sends a command until it is acknowledged. `what` is human-readable.

        The future ends as that of a command to the autopilot. A `UalTimeoutError` says that it may have been obeyed.
        """
        if self._target is None:
            futures.fail(future, LinkLostError(f"cannot {what}: no vehicle is heard"))
            return
        key = (component_id, command.id)
        if (before := self._orders.get(key)) is not None:
            before.fail(TaskAbortedError(f"{before.what} was replaced", {"by": what}))
        source = MessageSource(self._target.system_id, component_id)
        self._orders[key] = _ComponentOrder(source, command, what, future, self._send, self._quiet_until_s)
        self.is_waiting = True

    def on_component(self, source: MessageSource, message: Message, now_s: float) -> None:
        """Takes a heartbeat or an acknowledgement of a component of the vehicle."""
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self._heard_s[source.component_id] = now_s
        elif (order := self._orders.get((source.component_id, message.command))) is not None:
            order.on_ack(message.command, message.result, now_s)

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        if self._target is not None and self._target.system_id != target.system_id:
            self.drop("another autopilot was found")
            self._heard_s.clear()
        self._target = target

    @override
    def drop(self, why: str) -> None:
        for order in self._orders.values():
            order.fail(LinkLostError(f"it is not known whether the order to {order.what} was obeyed: {why}"))

    @override
    def tick(self, now_s: float) -> None:
        queries, self._queries = self._queries, []
        for component_id, future in queries:
            futures.finish(future, now_s - self._heard_s.get(component_id, -math.inf) <= LOST_COMPONENT_S)
        for key, order in tuple(self._orders.items()):
            order.tick(now_s)
            if order.is_over:
                del self._orders[key]
        self.is_waiting = bool(self._orders or self._queries)


class _ComponentOrder(CameraOrder):
    """A command on its way. `quiet_until_s` is shared with those that follow it."""

    repeat = AGAIN

    def __init__(
        self,
        source: MessageSource,
        command: CommandLong,
        what: str,
        future: Future[None],
        send: Callable[[Message], object],
        quiet_until_s: dict[tuple[int, int], float],
    ) -> None:
        line = CameraSender(
            lambda _, __, count: send(command.encode(source, count)), f"component {source.component_id}"
        )
        super().__init__(future, line, command.id, command.params)
        self.what = what
        self._quiet_until_s = quiet_until_s
        self._key = (source.component_id, command.id)

    @override
    def tick(self, now_s: float) -> None:
        is_quiet = not self.was_sent and now_s < self._quiet_until_s.get(self._key, -math.inf)
        if not (self.is_over or is_quiet):
            super().tick(now_s)

    @override
    def _send(self, now_s: float) -> None:
        super()._send(now_s)
        self._quiet_until_s[self._key] = now_s + LATE_ANSWER_S

    @override
    def on_ack(self, command_id: int, result: int, now_s: float) -> None:
        if self.was_sent and not self.was_repeated and result != mavlink.MAV_RESULT_IN_PROGRESS:
            self._quiet_until_s.pop(self._key, None)  # no other answer can come
        if self.was_sent and result == mavlink.MAV_RESULT_UNSUPPORTED:
            self.fail(NotSupportedError(f"{self._line.name} does not know how to {self.what}"))
        super().on_ack(command_id, result, now_s)

    @property
    @override
    def _words(self) -> str:
        return f"the order to {self.what}"
