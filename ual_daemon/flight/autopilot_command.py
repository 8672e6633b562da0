"""A command to the autopilot, judged by its effect (docs/decisions/0004)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import RejectedByAutopilotError, UalError, UalTimeoutError
from ual_daemon.backends.values import Snapshot

COMMAND_PATIENCE_S = 5.0
"""How long a command may take to show its effect. A PX4 answers within 15 ms, and shows a mode within 1 s."""


class AutopilotCommand:
    """A command to the autopilot, judged by what the vehicle then does; the acknowledgement only tells refusals."""

    def __init__(self, what: str, now_s: float) -> None:
        self.sent_s = now_s
        self.what = what
        self._ack: Future[None] | None = None
        self._is_withdrawn = False

    def send(self, sender: Callable[[], Future[None]]) -> None:
        """Sends it, unless it was withdrawn before. What the backend raises counts as its refusal."""
        if self._is_withdrawn:
            return
        try:
            self._ack = sender()
        except UalError as error:
            self._ack = Future()
            self._ack.set_exception(error)
        if self._is_withdrawn:  # meanwhile, by another thread that may not have seen the future
            self._ack.cancel()

    def withdraw(self) -> None:
        """Takes it back as far as it was not sent: it must not be sent again once nobody wants its effect any more (an
        OFFBOARD that is repeated for want of an answer would take the UAV from the safety pilot).
        """
        self._is_withdrawn = True
        if self._ack is not None:
            self._ack.cancel()

    @property
    def is_answered(self) -> bool:
        """Whether the autopilot has said yes or no."""
        return self._ack is not None and self._ack.done() and not self._ack.cancelled()

    @property
    def is_accepted(self) -> bool:
        """Whether the autopilot has said yes."""
        return self.is_answered and self._error() is None

    def _error(self) -> BaseException | None:
        return None if self._ack is None or not self.is_answered else self._ack.exception()

    def refusal(self) -> UalError | None:
        """The autopilot's no, if it has said it."""
        error = self._error()
        return error if error is None or isinstance(error, UalError) else UalError(f"{self.what}: {error}")

    def failure(self, snapshot: Snapshot) -> UalError | None:
        """Why it has failed, if it has: it was refused, or shows no effect in time."""
        refusal = self.refusal()
        if refusal is not None:
            return refusal
        if snapshot.time_s - self.sent_s <= COMMAND_PATIENCE_S:
            return None
        words = f"; it says: {snapshot.status_text}" if snapshot.status_text else ""
        if self.is_answered:
            return RejectedByAutopilotError(
                f"the autopilot accepted to {self.what}, but has not after {COMMAND_PATIENCE_S:g} s{words}"
            )
        return UalTimeoutError(f"the autopilot did not answer when told to {self.what}{words}")
