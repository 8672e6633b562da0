"""The shutdown: hands the UAV over to the autopilot, which then holds the position by itself."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress

from ual.errors import LinkLostError, UalError
from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import LandedState, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre
from ual_daemon.flight.state import estimate

_log = logging.getLogger(__name__)

_HOLD_PATIENCE_S = 5.0
_BLIND_PATIENCE_S = 5.0
"""Seconds for which an unknown state is awaited: after a stall of this computer it is known within a second."""


class Shutdown:
    """One handover to the autopilot. `future` ends when the UAV needs no more references from UAL, or with a
    LinkLostError when it is not known for too long whether it does.

    `is_in_control` returns whether UAL flies it: the flight of others is left alone. `on_left` is called with what is
    left to the autopilot, before it is commanded.
    """

    def __init__(
        self,
        backend: Backend,
        is_in_control: Callable[[], bool],
        on_left: Callable[[str], object] = lambda _: None,
    ) -> None:
        self.future: Future[None] = Future()
        self._backend = backend
        self._is_in_control = is_in_control
        self._on_left = on_left
        self._hold: AutopilotCommand | None = None
        self._blind_since_s: float | None = None
        self._error: UalError | None = None
        self._lock = threading.Lock()

    def step(self, snapshot: Snapshot) -> bool:
        """Sends the hold command, once, if UAL flies the UAV. Returns whether the handover is over."""
        if self._begin_hold(snapshot):
            snapshot = self._backend.snapshot()  # a simulation obeys at once, even while its time stands still
        if self._is_blind(snapshot):
            return self._has_waited(snapshot)
        self._blind_since_s = None
        if self._hold is None:
            return True
        state = self._state(snapshot)
        if state is State.FLYING_AUTO:
            failure = self._hold.failure(snapshot)
            if self._hold.waited_s(snapshot) <= _HOLD_PATIENCE_S:
                return False
            logs.event(_log, logging.ERROR, "hold_failed", why=str(failure or "its mode did not change"))
        return True

    def leaves(self, stop: Manoeuvre, snapshot: Snapshot) -> bool:
        """Returns whether the stop of a mission is not waited for any more: the autopilot holds by itself already, or
        its state stays unknown.
        """
        if stop.has_held:
            return True
        if self._state(snapshot) is State.UNINITIALIZED:
            return self._has_waited(snapshot, stop.unseen)
        self._blind_since_s = None
        return False

    def _state(self, snapshot: Snapshot) -> State:
        return estimate(snapshot, self._backend.freshness).state

    def _is_blind(self, snapshot: Snapshot) -> bool:
        """Returns whether UAL flies it, but does not know its state now: it may be in the air, and needs the hold."""
        landed = snapshot.control.landed
        is_on_ground = landed is not None and landed.value is LandedState.ON_GROUND
        is_heard = snapshot.heard_s is not None and not is_on_ground
        return is_heard and self._is_in_control() and self._state(snapshot) is State.UNINITIALIZED

    def _has_waited(self, snapshot: Snapshot, does: str = "") -> bool:
        """Returns whether the state has stayed unknown for too long. `does` is UAL's action meanwhile,
        human-readable.
        """
        if self._blind_since_s is None:
            self._blind_since_s = snapshot.time_s
        if snapshot.time_s - self._blind_since_s < _BLIND_PATIENCE_S:
            return False
        why = estimate(snapshot, self._backend.freshness).why
        self._error = LinkLostError(f"its state is not known: {why}{f'; {does}' if does else ''}")
        return True

    def _begin_hold(self, snapshot: Snapshot) -> bool:
        """Sends the hold command if that is still to do. Returns whether this call sent it."""
        if not self._is_in_control() or self._state(snapshot) is not State.FLYING_AUTO:
            return False
        with self._lock:  # the caller of the shutdown and the updates come from different threads
            if self._hold is not None:
                return False
            hold = self._hold = AutopilotCommand("hold its position")
        logs.event(_log, logging.INFO, "hold_by_autopilot", why="UAL is shutting down")
        self._on_left("hold by itself")
        hold.send(self._backend.hold, snapshot)
        return True

    def finish(self) -> None:
        """Ends the future, unless another thread has ended it, and withdraws the hold command.

        The autopilot holds, or others fly or land it: a repeated command would take control from those.
        """
        if self._hold is not None:
            self._hold.withdraw()
        with suppress(InvalidStateError):
            if self._error is None:
                self.future.set_result(None)
            else:
                self.future.set_exception(self._error)
