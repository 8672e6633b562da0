"""Services that are called one after another: a command ends with the last one, or with the first that refuses."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import RejectedByAutopilotError
from ual_daemon.backends import futures
from ual_daemon.backends.dji.wrappers import Call
from ual_daemon.backends.rosbridge import Message, RosbridgeLink
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError

OnDone = Callable[[Call], None]


def _ignore(_: Call) -> None:
    """Nothing depends on it."""


class Commands:
    """Calls the wrapper's services. Any thread may begin a command; the link's thread goes on with it."""

    def __init__(self, link: RosbridgeLink, words: Callable[[], str]) -> None:
        """`words` returns what the wrapper says beside the refusal of a service, which has no words itself."""
        self._link = link
        self._words = words
        self._blocking: Future[Message] | None = None

    @property
    def is_blocked(self) -> bool:
        """Whether the wrapper serves nothing now, because a service that blocks it has not answered."""
        return self._blocking is not None and not self._blocking.done()

    def run(self, calls: tuple[Call, ...], on_done: OnDone = _ignore) -> Future[None]:
        """Calls services in their order. `on_done` is called with each one that was executed.

        A service that does not answer leaves the future open: whether it was executed is not known.
        """
        result: Future[None] = Future()
        self._next(calls, result, on_done)
        return result

    def _next(self, calls: tuple[Call, ...], result: Future[None], on_done: OnDone) -> None:
        if result.cancelled():
            return
        if not calls:
            futures.end(result)
            return
        call = calls[0]
        answer = self._link.call_service(call.service, call.arguments, call.patience_s)
        if call.blocks:
            self._blocking = answer
        answer.add_done_callback(lambda done: self._take(done, calls, result, on_done))

    def _take(self, answer: Future[Message], calls: tuple[Call, ...], result: Future[None], on_done: OnDone) -> None:
        error = answer.exception()
        if isinstance(error, ServiceTimeoutError):
            return
        if isinstance(error, ServiceError):
            self._refuse(result, calls[0], error.words)
        elif not _is_done(answer.result()):
            self._refuse(result, calls[0], str(answer.result().get("message") or ""))
        else:
            on_done(calls[0])
            self._next(calls[1:], result, on_done)

    def _refuse(self, result: Future[None], call: Call, words: str) -> None:
        said = "; ".join(each for each in (words, self._words()) if each) or "no reason was given"
        futures.end(result, RejectedByAutopilotError(f"{call.service} refused: {said}", {"text": said}))


def _is_done(values: Message) -> bool:
    return bool(values.get("success", values.get("result", False)))
