"""A mailbox for setpoints: for backends whose sending blocks, such as a call that waits for an answer, or a bridge."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from ual_daemon import logs
from ual_daemon.backends.base import Clock
from ual_daemon.backends.values import Setpoint

_log = logging.getLogger(__name__)

LONGEST_SEND_S = 0.5
"""Seconds after which a setpoint that has not left is dropped."""


class SetpointMailbox:
    """Keeps the newest setpoint, and sends it from one thread of its own. A newer one replaces one that has not left.

    So `put` never blocks its caller, and a slow autopilot skips setpoints but never gets an old one. A setpoint is old
    when a newer one replaced it, or when it had to wait for longer than `longest_s`.

    Example:
        >>> mailbox = SetpointMailbox(rpc.move, MonotonicClock(), "airsim uav_1")
        >>> mailbox.open()
        >>> mailbox.put(setpoint)  # from `Backend.send`
        >>> mailbox.drop()  # before a command that setpoints must not follow
        >>> mailbox.close()

    """

    def __init__(
        self, send: Callable[[Setpoint], None], clock: Clock, thread_name: str, longest_s: float = LONGEST_SEND_S
    ) -> None:
        """`send` sends one setpoint, and may block and raise: it is logged, and the next one is tried all the same."""
        self._send = send
        self._clock = clock
        self._longest_s = longest_s
        self._changed = threading.Condition()
        self._newest: tuple[Setpoint, float] | None = None
        self._is_closing = self._is_sending = False
        self._is_failing = False
        self._thread = threading.Thread(target=self._run, name=thread_name, daemon=True)

    def open(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def put(self, setpoint: Setpoint) -> None:
        """Replaces the setpoint that is to be sent. Any thread may call."""
        with self._changed:
            self._newest = setpoint, self._clock.now_s()
            self._changed.notify_all()

    def drop(self) -> None:
        """Drops the setpoint that has not left. One whose sending has begun may still arrive."""
        with self._changed:
            self._newest = None

    def settle(self) -> None:
        """Drops the setpoint that has not left, and blocks until one whose sending has begun has left."""
        with self._changed:
            self._newest = None
            self._changed.wait_for(lambda: not self._is_sending)

    def close(self) -> None:
        """Ends the thread once the sending that has begun has ended. May be called by the thread itself."""
        with self._changed:
            self._is_closing, self._newest = True, None
            self._changed.notify_all()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        while (waiting := self._take()) is not None:
            setpoint, put_s = waiting
            if self._clock.now_s() - put_s <= self._longest_s:
                self._try(setpoint)

    def _take(self) -> tuple[Setpoint, float] | None:
        """Blocks until there is a setpoint, and returns it with its time; None at the end."""
        with self._changed:
            self._is_sending = False
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._is_closing or self._newest is not None)
            waiting, self._newest = self._newest, None
            self._is_sending = not self._is_closing
            return None if self._is_closing else waiting

    def _try(self, setpoint: Setpoint) -> None:
        try:
            self._send(setpoint)
        except Exception as error:  # noqa: BLE001  logged; the next setpoint is tried
            if not self._is_failing:
                logs.event(_log, logging.WARNING, "setpoint_not_sent", why=str(error) or repr(error))
            self._is_failing = True
        else:
            self._is_failing = False
