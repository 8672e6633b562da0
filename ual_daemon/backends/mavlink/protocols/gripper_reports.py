"""Awaited reports of an autopilot's gripper, winch, servos and relays, and texts about its gripper."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any, NamedTuple

from typing_extensions import override

from ual.errors import LinkLostError, UalError, UalTimeoutError
from ual.gripper import GripperState
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

READ_S = 2.5
"""A question that is not answered within this time is not answered. It is asked four times, once each 0.5 s."""


class _Awaited(NamedTuple):
    future: Future[Any]
    what: str
    until_s: float | None


class GripperReports(Protocol):
    """Belongs to the thread that receives; `state` is for any thread.

    A text that a silence has swallowed would leave an old state. So after one, and after each order, none is known.
    """

    def __init__(self) -> None:
        self.state = GripperState.UNKNOWN
        self.is_waiting = False
        self._texts: Mapping[str, GripperState] = {}
        self._awaited: list[_Awaited] = []
        self._unlimited: list[_Awaited] = []

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {mavlink.MAVLINK_MSG_ID_STATUSTEXT: lambda message, _: self._on_text(message)}

    def forget_state(self) -> None:
        """Forgets the reports of the gripper: an order leaves, or the link was lost."""
        self.state = GripperState.UNKNOWN

    def await_order(self, future: Future[None], what: str) -> None:
        """Has an order end with the session: no answer comes from an autopilot that has booted."""
        self._unlimited = [each for each in self._unlimited if not each.future.done()]
        self._unlimited.append(_Awaited(future, what, None))

    def await_answer(self, future: Future[Any], what: str) -> None:
        """Has a question end after `READ_S`. `what` it is about, human-readable."""
        self._awaited.append(_Awaited(future, what, None))
        self.is_waiting = True

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        self._texts = {} if dialect.gripper is None else dialect.gripper.texts
        self.forget_state()

    @override
    def drop(self, why: str) -> None:
        self.forget_state()
        for each in self._awaited:
            _fail(each, LinkLostError(f"{each.what} is not known: {why}"))
        for each in self._unlimited:
            _fail(each, LinkLostError(f"it is not known whether the autopilot obeyed the order to {each.what}: {why}"))
        self._awaited, self._unlimited, self.is_waiting = [], [], False

    @override
    def tick(self, now_s: float) -> None:
        self._awaited = [self._ticked(each, now_s) for each in self._awaited if not each.future.done()]
        self.is_waiting = bool(self._awaited)

    def _ticked(self, awaited: _Awaited, now_s: float) -> _Awaited:
        if awaited.until_s is None:
            return awaited._replace(until_s=now_s + READ_S)
        if now_s >= awaited.until_s:
            _fail(awaited, UalTimeoutError(f"{awaited.what} is not known: the autopilot has not told it"))
        return awaited

    def _on_text(self, message: Message) -> None:
        reported = self._texts.get(str(message.text).strip("\0 "))
        if reported is not None:
            self.state = reported


def _fail(awaited: _Awaited, error: UalError) -> None:
    if not awaited.future.done():
        futures.fail(awaited.future, error)
