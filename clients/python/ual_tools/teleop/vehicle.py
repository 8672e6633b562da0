"""One UAV, commanded without blocking: a thread for its setpoints, one for each command, one that keeps the link."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from ual.errors import NotSupportedError, UalError
from ual.geometry import PoseStamped, TwistStamped
from ual.interface import Lease, Uav
from ual.types import Info, Setpoint, Telemetry

TELEMETRY_HZ = 10.0
STALE_SETPOINT_S = 0.2
"""A setpoint that waited for longer (the daemon did not answer) is dropped: the stick is elsewhere by now."""
DROPPED = "sticks: a step was dropped, as the daemon was too slow for it"
_RETRY_S = 1.0
_IN_FLIGHT_S = 0.3
"""Seconds for which a command waits for the setpoint before it, which is on its way."""


@dataclass(frozen=True, slots=True)
class ScreenMessage:
    """A line for the screen, and when it was said (monotonic)."""

    text: str = ""
    time_s: float = 0.0


class TeleopVehicle:
    """One UAV. No member blocks, except `halt` and `close`, which have a time limit. May be used from any thread.

    Args:
        uav: The UAV, which nothing has been asked of yet. It is closed with this.
        name: Its name, until the daemon says it.
        takes_lease: Whether the lease is taken from another program that has it.

    """

    def __init__(
        self, uav: Uav, name: str = "", clock: Callable[[], float] = time.monotonic, *, takes_lease: bool = False
    ) -> None:
        self.info: Info | None = None
        self.telemetry: Telemetry | None = None
        self.refusal = ScreenMessage()
        """The last refusal or failure."""
        self.done = ScreenMessage()
        """Last action, or the present one."""
        self._name = name
        self._uav = uav
        self._takes_lease = takes_lease
        self._lease: Lease | None = None
        self._leasing = threading.Lock()
        self._clock = clock
        self._telemetry_s = clock()
        self._changed = threading.Condition()
        self._setpoint: tuple[Setpoint, float] | None = None
        self._in_flight = threading.Lock()
        self._is_refused = False
        self._running: dict[str, int] = {}
        self._is_closed = threading.Event()

    @property
    def name(self) -> str:
        """The namespace, once it is known."""
        return self._name if self.info is None else self.info.namespace

    def open(self) -> None:
        """Starts to listen to the UAV. Sends nothing to it."""
        for run in (self._keep_link, self._send_setpoints):
            threading.Thread(target=run, name=f"teleop {run.__name__} {self._name}", daemon=True).start()

    def age_s(self) -> float:
        """Returns how old the newest telemetry is; without any, how long it was waited for."""
        return self._clock() - self._telemetry_s

    def running(self) -> tuple[str, ...]:
        """Returns the commands that have not ended."""
        with self._changed:
            return tuple(self._running)

    def send(self, setpoint: Setpoint) -> None:
        """Sends a setpoint, in place of one that waits."""
        with self._changed:
            self._setpoint = (setpoint, self._clock())
            self._changed.notify_all()

    def was_refused(self) -> bool:
        """Returns whether a setpoint was refused since the last call."""
        with self._changed:
            was_refused, self._is_refused = self._is_refused, False
        return was_refused

    def command(self, name: str, call: Callable[[Uav], object], *, begins: str = "") -> threading.Thread:
        """Makes a call on a thread of its own, after the setpoints before it, and says how it ended.

        Args:
            name: What is shown: "land: done".
            call: Blocks until it is done. Raises `UalError`.
            begins: What is shown meanwhile.

        """
        with self._changed:
            self._setpoint = None
            self._running[name] = self._running.get(name, 0) + 1
        if begins:
            self.done = self._message(begins)
        thread = threading.Thread(target=self._run, args=(name, call), name=f"teleop {name}", daemon=True)
        thread.start()
        return thread

    def halt(self, timeout_s: float) -> bool:
        """Stops the UAV, and returns whether the daemon said in time that it does."""
        before = self.refusal
        self.command("stop", lambda uav: uav.abort()).join(timeout_s)
        return "stop" not in self.running() and self.refusal is before

    def refuse(self, text: str) -> None:
        """Shows why something was not done."""
        self.refusal = self._message(text)

    def close(self) -> None:
        """Ends the link. What runs goes on."""
        self._is_closed.set()
        with self._changed:
            self._setpoint = None
            self._changed.notify_all()
        self._uav.close()

    def _run(self, name: str, call: Callable[[Uav], object]) -> None:
        # A setpoint that is on its way must arrive before the command, or it would undo it.
        if self._in_flight.acquire(timeout=_IN_FLIGHT_S):
            self._in_flight.release()
        try:
            self._hold_lease()
            call(self._uav)
            self.done = self._message(f"{name}: done")
        except UalError as error:
            self.done = self._message(f"{name}: not done")
            self._note(name, error)
        finally:
            with self._changed:
                self._running[name] -= 1
                self._running = {each: count for each, count in self._running.items() if count}

    def _send_setpoints(self) -> None:
        while not self._is_closed.is_set():
            with self._changed:
                while self._setpoint is None and not self._is_closed.is_set():
                    self._changed.wait()
                newest = self._setpoint
            if newest is not None:
                self._send(newest)
            with self._changed:
                if self._setpoint is newest:
                    self._setpoint = None

    def _send(self, newest: tuple[Setpoint, float]) -> None:
        setpoint, given_s = newest
        with self._in_flight:
            try:
                if self._clock() - given_s <= STALE_SETPOINT_S:
                    self._hold_lease()  # may take a while
                if self._setpoint is not newest:  # a command, or a newer one, has taken its place
                    return
                if self._clock() - given_s <= STALE_SETPOINT_S:
                    self._set(setpoint)
                elif isinstance(setpoint, PoseStamped):  # a velocity comes again, a step does not
                    self._is_refused = True
                    self.refuse(DROPPED)
            except UalError as error:
                self._note("sticks", error)
                with self._changed:
                    self._is_refused = True

    def _set(self, setpoint: Setpoint) -> None:
        if isinstance(setpoint, TwistStamped):
            self._uav.set_velocity(setpoint)
        else:
            assert isinstance(setpoint, PoseStamped)
            self._uav.set_pose(setpoint)

    def _hold_lease(self) -> None:
        """Acquires the lease with the first command. A lease that another program took is not taken back."""
        with self._leasing:
            if self._lease is not None and self._lease.lost is None:
                return
            if self._lease is not None:
                self._lease.release()
            self._lease = None
            with suppress(NotSupportedError):  # a daemon that knows no leases
                self._lease = self._uav.lease("ual teleop", take=self._takes_lease)
            self._takes_lease = False  # not before: the daemon may not have answered

    def _keep_link(self) -> None:
        while not (self._is_closed.is_set() or self._is_linked()):
            self._is_closed.wait(_RETRY_S)

    def _is_linked(self) -> bool:
        try:
            self.info = self._uav.info()
            self._uav.subscribe(self._on_telemetry, TELEMETRY_HZ)
        except UalError as error:
            self._note("link", error)
            return False
        return True

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        self.telemetry, self._telemetry_s = telemetry, self._clock()

    def _note(self, name: str, error: UalError) -> None:
        if not self._is_closed.is_set():
            self.refusal = self._message(f"{name}: {error.reason}: {' '.join(error.message.split())}")

    def _message(self, text: str) -> ScreenMessage:
        return ScreenMessage(text, self._clock())
