"""Additions to the reason of the state: whether UAL flies, which other program sends setpoints, and that external poses
have stopped.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import SetpointLoss, Snapshot
from ual_daemon.flight.external_silence import ExternalSilence
from ual_daemon.flight.policy.authority import Authority
from ual_daemon.flight.state import Estimate, why_it_may_lie

_log = logging.getLogger(__name__)

_NOT_COMMANDED = "; UAL has not been commanded in this flight since it was started, and sends nothing"
_UNTIL = "UAL sends nothing until it is commanded anew"


class Explanation:
    """Additions to the reasons of one UAV's states. Any thread may call, except `update`: only the update thread."""

    def __init__(self, backend: Backend, authority: Authority, is_in_control: Callable[[], bool]) -> None:
        self._backend = backend
        self._authority = authority
        self._is_in_control = is_in_control
        self._other_sender = ""
        self.external_silence = ExternalSilence()
        self.note = ""
        """Addition to the reason of FLYING_AUTO; composed at each update."""

    def explained(self, found: Estimate, snapshot: Snapshot) -> Estimate:
        """Returns the same. Where there is no position, its reason says that the poses from outside have stopped."""
        estimator = snapshot.motion.estimator
        if found.state is not State.UNINITIALIZED or estimator is None or estimator.value.is_good:
            return found
        silence = self.external_silence.text(snapshot.time_s)
        return replace(found, why=found.why + silence) if silence else found

    def taken(self, found: Estimate, snapshot: Snapshot) -> Estimate:
        """Returns the same. Its reason says what took the UAV from UAL where the mode does not tell."""
        taken = self._authority.taken
        if found.state is not State.FLYING_MANUAL or snapshot.control.held_by is not None or not taken:
            return found
        return replace(found, why=f"{found.why}; {taken}")

    def update(self, snapshot: Snapshot, trouble: str) -> None:
        """Composes the note, and logs when another program's setpoints begin and end.

        `trouble` is why the UAV does not do what it was asked last; empty where it does.
        """
        estimator, other = snapshot.motion.estimator, snapshot.control.other_sender
        if estimator is not None and estimator.value.is_good:
            self.external_silence.good_s = snapshot.time_s
        if other != self._other_sender:
            self._other_sender = other
            level = logging.WARNING if other else logging.INFO
            logs.event(_log, level, "another_sender", why=other or "no longer seen")
        note = "" if self._authority.is_ours else self._not_commanded(snapshot)
        if other or trouble:
            note = "".join((note, f"; {other}" if other else "", f"; {trouble}" if trouble else ""))
        self.note = note

    def _not_commanded(self, snapshot: Snapshot) -> str:
        armed = snapshot.control.armed
        if self._is_in_control():
            return ""
        lies = why_it_may_lie(snapshot) if armed is not None and armed.value else ""
        loss, lost = self._backend.info().setpoint_loss, self._authority.given_up or self._authority.taken
        why = (f"; {lost}: {_UNTIL}" if lost else _NOT_COMMANDED) + lies
        return f"{why}; without setpoints it {loss.value}" if loss is SetpointLoss.COASTS else why
