"""Services that are called one after another: a command ends with the last one, or with the first that refuses."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple

from ual.errors import LinkLostError, RejectedByAutopilotError, UalError
from ual_daemon.backends import futures
from ual_daemon.backends.base import Clock
from ual_daemon.backends.dji.wrappers import Call
from ual_daemon.backends.rosbridge import Message, RosbridgeLink
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError

OnDone = Callable[[Call], None]
_TEXT_S = 0.3
"""How long after a refusal the wrapper's words about it may come."""


def _ignore(_: Call) -> None:
    """Nothing depends on it."""


class _Refusal(NamedTuple):
    """A refusal that waits for the wrapper's words. `connection` is the number of the connection on which it came."""

    result: Future[None]
    service: str
    words: str
    due_s: float
    connection: int


class Commands:
    """Calls the wrapper's services. Any thread may begin a command; the link's thread goes on with it."""

    def __init__(
        self,
        link: RosbridgeLink,
        clock: Clock,
        words: Callable[[], str],
        why_silent: Callable[[], str],
        tell: Callable[[str], None],
    ) -> None:
        """Args:
        link: Calls the services.
        clock: The backend's.
        words: Returns what the wrapper says beside the refusal of a service, which has no words itself.
        why_silent: Returns why the aircraft counts as not heard now, for people; empty while it is heard.
        tell: Tells people something.

        """
        self._link = link
        self._clock = clock
        self._words = words
        self._why_silent = why_silent
        self._tell = tell
        self._blocking: Future[Message] | None = None
        self._refusals: deque[_Refusal] = deque()

    @property
    def is_blocked(self) -> bool:
        """Whether the wrapper serves nothing now, because a service that blocks it has not answered."""
        return self._blocking is not None and not self._blocking.done()

    def run(self, calls: tuple[Call, ...], on_done: OnDone = _ignore) -> Future[None]:
        """Calls services in their order. `on_done` is called with each one that was executed.

        A service that does not answer leaves the future open: whether it was executed is not known. Nothing is called
        while the aircraft is not heard: it might be executed in the flight of a pilot who has taken over meanwhile.
        """
        return self._begin(calls, on_done, is_harmless=False)

    def release(self, call: Call) -> Future[None]:
        """Calls the service that gives up the control authority. Executed late, it takes nothing from anybody."""
        return self._begin((call,), _ignore, is_harmless=True)

    def _begin(self, calls: tuple[Call, ...], on_done: OnDone, *, is_harmless: bool) -> Future[None]:
        result: Future[None] = Future()
        self._next(calls, result, on_done, is_harmless=is_harmless)
        return result

    def _next(
        self, calls: tuple[Call, ...], result: Future[None], on_done: OnDone, *, is_harmless: bool = False
    ) -> None:
        if result.cancelled():
            return
        if not calls:
            futures.end(result)
            return
        call, why = calls[0], "" if is_harmless else self._why_silent()
        if why:
            futures.end(result, LinkLostError(f"{call.service} was not called: {why}"))
            return
        answer = self._link.call_service(call.service, call.arguments, call.patience_s)
        if call.blocks:
            self._blocking = answer
        answer.add_done_callback(lambda done: self._take(done, calls, result, on_done))
        result.add_done_callback(lambda ended: self._withdraw(ended, call, answer))

    def _withdraw(self, result: Future[None], call: Call, answer: Future[Message]) -> None:
        """Withdraws the call of a command that was withdrawn, if it has not left yet.

        One that blocks the wrapper is waited for, as nothing else shows when the wrapper is free again. It follows the
        answer to another one, so it does not wait, and the aircraft refuses it without the control authority.
        """
        if not result.cancelled() or answer.done():
            return
        if not call.blocks:
            answer.cancel()
        if self._why_silent():
            self._tell_open(call)

    def _tell_open(self, call: Call) -> None:
        self._tell(f"{call.service} was not answered: it may still be executed")

    def _take(self, answer: Future[Message], calls: tuple[Call, ...], result: Future[None], on_done: OnDone) -> None:
        if answer.cancelled():
            return
        error = answer.exception()
        if isinstance(error, ServiceTimeoutError):
            self._tell_open(calls[0])
            return
        if isinstance(error, ServiceError):
            self._refuse(result, calls[0], error.words)
        elif not _is_done(answer.result()):
            self._refuse(result, calls[0], _words_of(answer.result()))
        else:
            on_done(calls[0])
            self._next(calls[1:], result, on_done)

    def _refuse(self, result: Future[None], call: Call, words: str) -> None:
        due_s = self._clock.now_s() + _TEXT_S
        self._refusals.append(_Refusal(result, call.service, words, due_s, self._link.connections_count))

    def tick(self, now_s: float) -> None:
        """Ends the commands that were refused, once their words have come; to be called often on the link's thread."""
        while self._refusals and now_s >= self._refusals[0].due_s:
            refusal = self._refusals.popleft()
            futures.end(refusal.result, self._error(refusal))

    def _error(self, refusal: _Refusal) -> UalError:
        """Returns what a refusal means: without a link it is not that of the aircraft."""
        if not self._link.is_up or self._link.connections_count != refusal.connection:
            return LinkLostError(f"{refusal.service}: {self._link.why_not or refusal.words}")
        said = "; ".join(filter(None, (refusal.words, self._words()))) or "no reason was given"
        return RejectedByAutopilotError(f"{refusal.service} refused: {said}", {"text": said})


def _is_done(values: Message) -> bool:
    return bool(values.get("success", values.get("result", False)))


def _words_of(values: Message) -> str:
    """Returns why a service has refused, as far as its answer says it."""
    numbers = [f"{name} {values[name]}" for name in ("cmd_set", "cmd_id", "ack_data") if name in values]
    return str(values.get("message") or "") or (f"DJI's answer is {', '.join(numbers)}" if numbers else "")
