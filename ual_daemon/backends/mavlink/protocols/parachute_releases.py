"""Releases of an ArduPilot's parachute: acknowledged in any case, and reported by texts."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.exchange import Exchange
from ual_daemon.backends.mavlink.protocols.protocol import Handler, Protocol
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

TEXT_S = 2.0
"""Seconds after the acknowledgement within which a text comes: a real one sends it 0.06 s later."""
RELEASED = "Parachute: Released"
_REFUSED = ("Parachute: Landed", "Parachute: Too low")


class ParachuteReleases(Protocol):
    """Belongs to the thread that receives. A release ends a former one."""

    def __init__(self) -> None:
        self.is_waiting = False
        self._release: _Release | None = None

    @property
    @override
    def handlers(self) -> dict[int, Handler]:
        return {mavlink.MAVLINK_MSG_ID_STATUSTEXT: lambda message, _: self._on_text(message)}

    def begin(self, order: Callable[[], Future[None]], future: Future[None]) -> None:
        """Begins a release by an order, and ends a future by what the autopilot reports of it."""
        if self._release is not None:
            self._release.fail(TaskAbortedError("the release of its parachute was replaced", {"by": "release"}))
            self._forget_ended()
        self._release, self.is_waiting = _Release(order(), future), True

    @override
    def attach(self, target: MessageSource, dialect: Dialect) -> None:
        """Its texts say the same from any ArduPilot."""

    @override
    def drop(self, why: str) -> None:
        if self._release is not None:
            self._release.fail(LinkLostError(f"it is not known whether its parachute was released: {why}"))
            self._forget_ended()

    @override
    def tick(self, now_s: float) -> None:
        if self._release is not None:
            self._release.tick(now_s)
            self._forget_ended()

    def _on_text(self, message: Message) -> None:
        if self._release is not None:
            self._release.on_text(str(message.text).strip("\0 "))
            self._forget_ended()

    def _forget_ended(self) -> None:
        if self._release is not None and self._release.is_over:
            self._release.withdraw()
            self._release, self.is_waiting = None, False


class _Release(Exchange[None]):
    """A release on its way."""

    def __init__(self, ordered: Future[None], future: Future[None]) -> None:
        super().__init__(future)
        self._ordered = ordered
        self._until_s = math.inf

    def withdraw(self) -> None:
        """Has the order not sent again: on the ground the autopilot refuses a second release."""
        self._ordered.cancel()

    def on_text(self, text: str) -> None:
        """Takes a text of the autopilot."""
        if text == RELEASED:
            self._end(None)
        elif text in _REFUSED:
            details = {"command": "DO_PARACHUTE", "text": text}
            self.fail(
                RejectedByAutopilotError(f"the autopilot has not released its parachute; it said: {text}", details)
            )

    @override
    def tick(self, now_s: float) -> None:
        if self.is_over or not self._ordered.done() or self._ordered.cancelled():
            return
        error = self._ordered.exception()
        if error is not None:
            futures.end(self.future, error)
        elif self._until_s == math.inf:
            self._until_s = now_s + TEXT_S
        elif now_s >= self._until_s:
            text = "the autopilot has acknowledged the release of its parachute, but has not reported it"
            self.fail(UalTimeoutError(f"{text}: it may be disabled, or its text was lost"))
