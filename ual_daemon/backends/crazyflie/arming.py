"""Arming and disarming: repeated until the supervisor shows the effect, or refuses."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import RejectedByAutopilotError
from ual_daemon.backends import futures
from ual_daemon.backends.crazyflie import packets
from ual_daemon.backends.crazyflie.packets import PLATFORM, RESPONSE, SET_ARMED, SUPERVISOR, Packet
from ual_daemon.backends.crazyflie.supervisor import Supervisor
from ual_daemon.backends.crazyflie.telemetry import Telemetry

REPEAT_S = 0.1
PATIENCE_S = 4.5
"""It is repeated for so long, although the firmware refuses: after a landing it does so for 3 s."""


class Arming:
    """The one command to arm or disarm that is under way, if any. Belongs to the thread that receives.

    Disarming waits until the supervisor does not say "flying" any more, which it does for 2 s after the motors have
    stopped: disarmed before, it would be locked.
    """

    def __init__(self, send: Callable[[Packet], None], telemetry: Telemetry) -> None:
        self._send = send
        self._telemetry = telemetry
        self._wanted: tuple[bool, Future[None]] | None = None
        self._due_s = self._ends_s = -math.inf
        self._is_refused = False

    def begin(self, future: Future[None], now_s: float, *, is_armed: bool) -> None:
        """Begins a command, which replaces the one before; `future` ends with its effect."""
        self._wanted, self._due_s, self._ends_s = (is_armed, future), now_s, now_s + PATIENCE_S
        self._is_refused = False

    def step(self, now_s: float, protocol: int) -> None:
        """Sends what is due, and ends the command once its effect shows."""
        if self._wanted is None:
            return
        is_armed, future = self._wanted
        if future.cancelled():
            self._wanted = None
        elif bool(self._telemetry.supervisor & Supervisor.ARMED) is is_armed:
            self._end(None)
        elif now_s > self._ends_s:
            self._give_up()
        elif now_s >= self._due_s and (is_armed or not self._telemetry.supervisor & Supervisor.FLYING):
            self._due_s = now_s + REPEAT_S
            self._send(packets.arm(protocol, is_armed=is_armed))

    def take(self, packet: Packet) -> None:
        """Takes an answer of the firmware."""
        is_answer = packet.port in (PLATFORM, SUPERVISOR) and len(packet.data) > 1
        if not is_answer or packet.data[0] & ~RESPONSE != SET_ARMED or self._wanted is None:
            return
        if packet.port == PLATFORM and packet.channel != 0:
            return
        self._is_refused = not packet.data[1]

    def _give_up(self) -> None:
        """Ends a command that shows no effect. One without any answer stays open: the layers above judge."""
        if self._is_refused:
            said = self._telemetry.words or "its supervisor does not allow it"
            self._end(RejectedByAutopilotError(f"the firmware refused: {said}", {"text": said}))
        self._wanted = None

    def _end(self, error: RejectedByAutopilotError | None) -> None:
        assert self._wanted is not None
        _, future = self._wanted
        self._wanted = None
        futures.end(future, error)
