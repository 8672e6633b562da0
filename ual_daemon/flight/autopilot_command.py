"""A command to the autopilot, assessed by its effect (docs/evidence/decisions/0004)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import RejectedByAutopilotError, UalError, UalTimeoutError
from ual_daemon import traces
from ual_daemon.backends import futures
from ual_daemon.backends.command_snapshot import call_with_snapshot
from ual_daemon.backends.values import Snapshot

COMMAND_PATIENCE_S = 5.0
"""Seconds that a command may take to show its effect. A PX4 answers within 15 ms, and shows a mode within 1 s."""


class AutopilotCommand:
    """A command to the autopilot, assessed by what the vehicle then does; the acknowledgement only shows refusals.

    It is the face of one command of the backend. Whether that leaves, first or again, only the backend's engine decides
    (docs/evidence/decisions/0041): after it was withdrawn, in a silence, or over a mode that others chose, it does not.
    """

    def __init__(self, what: str) -> None:
        self.what = what
        self._ack: Future[None] | None = None
        self._is_withdrawn = False
        self._awaited_s: float | None = None
        self._said_before: str | None = None
        """The autopilot's text from before it was sent: that is not about this command."""
        self._trace = traces.current()
        """The place in a trace of the call that wants it."""

    def send(self, sender: Callable[[], Future[None]], judged: Snapshot | None = None) -> None:
        """Sends it, unless it was withdrawn before. A `UalError` that the backend raises counts as a refusal.

        `judged` is the snapshot by which it was assessed; None for the newest one. It does not overrule a later change
        of the mode.
        """
        if self._is_withdrawn:
            return
        if judged is not None:
            self._said_before = judged.condition.status_text
        end_trace = traces.begin(f"autopilot: {self.what}", self._trace)
        try:
            self._ack = sender() if judged is None else call_with_snapshot(judged, sender)
        except UalError as error:
            self._ack = futures.failed(error)
        except BaseException as error:  # a defect is the caller's to handle; what waits for an answer ends all the same
            self._ack = futures.failed(error)
            if end_trace is not None:
                end_trace(self._ack)
            raise
        if end_trace is not None:
            self._ack.add_done_callback(end_trace)
        if self._is_withdrawn:  # by another thread during `sender()`, when there was no future to cancel yet
            self._ack.cancel()

    def withdraw(self) -> None:
        """Cancels it, once its effect is not wanted any more."""
        self._is_withdrawn = True
        if self._ack is not None:
            self._ack.cancel()

    @property
    def is_sent(self) -> bool:
        """Whether it was given to the backend."""
        return self._ack is not None

    @property
    def is_answered(self) -> bool:
        """Whether the autopilot has accepted or refused it."""
        return self._ack is not None and self._ack.done() and not self._ack.cancelled()

    @property
    def is_accepted(self) -> bool:
        """Whether the autopilot has accepted it."""
        return self.is_answered and self.refusal() is None

    def waited_s(self, snapshot: Snapshot) -> float:
        """Returns for how long its effect is awaited: since the first snapshot that was looked at after it was sent.

        Between plan and command a caller may have to wait for the processor. That says nothing of the autopilot.
        """
        if self._ack is None:
            return 0.0
        if self._awaited_s is None:
            self._awaited_s = snapshot.time_s
            if self._said_before is None:
                self._said_before = snapshot.condition.status_text
        return snapshot.time_s - self._awaited_s

    def left_behind(self, lost: UalError) -> UalError:
        """Returns the error of a command whose vehicle is not seen any more before it has shown its effect."""
        if self._ack is None or self.is_answered:
            return lost
        text = f"the command to {self.what} was not answered: if it had left, it may still be executed"
        return type(lost)(f"{lost.message}; {text}", lost.metadata)

    def refusal(self) -> UalError | None:
        """Returns the autopilot's refusal; None if it has not refused."""
        error = self._ack.exception() if self._ack is not None and self.is_answered else None
        return error if error is None or isinstance(error, UalError) else UalError(f"{self.what}: {error}")

    def failure(self, snapshot: Snapshot) -> UalError | None:
        """Returns why it has failed: it was refused, or showed no effect in time. None if it has not failed."""
        refusal = self.refusal()
        if refusal is not None:
            return refusal
        if self._is_withdrawn and not self.is_sent:  # nothing will come of it
            return UalTimeoutError(f"the command to {self.what} was withdrawn before it was sent")
        if self.waited_s(snapshot) <= COMMAND_PATIENCE_S:
            return None
        said = snapshot.condition.status_text
        status = f"; it says: {said}" if said not in ("", self._said_before) else ""
        status += f"; {snapshot.link.trouble}" if snapshot.link.trouble else ""
        if self._is_withdrawn and not self.is_answered:
            return UalTimeoutError(f"the command to {self.what} was withdrawn, as the mode changed meanwhile{status}")
        if self.is_answered:
            return RejectedByAutopilotError(
                f"the autopilot accepted to {self.what}, but has not after {COMMAND_PATIENCE_S:g} s{status}"
            )
        return UalTimeoutError(f"the autopilot did not answer the command to {self.what}{status}")
