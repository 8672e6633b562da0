"""The parachute of a light UAV. It says what it does; the UAV does not fall below it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import LinkLostError, RejectedByAutopilotError
from ual_daemon.backends import futures
from ual_daemon.backends.offers.parachute import ParachuteAction, ParachuteDriver


class LightParachute(ParachuteDriver):
    """Acknowledges at once. It opens once, and only while it is enabled. `is_link_lost`: nothing reaches it."""

    def __init__(self, is_link_lost: Callable[[], bool]) -> None:
        self.is_released = False
        self._is_enabled = False
        self._is_link_lost = is_link_lost
        self._lock = threading.Lock()

    @override
    def order(self, action: ParachuteAction) -> Future[None]:
        if self._is_link_lost():
            return futures.failed(LinkLostError("the autopilot is not heard (simulated)"))
        with self._lock:
            if action is not ParachuteAction.RELEASE:
                self._is_enabled = action is ParachuteAction.ENABLE
            elif self._is_enabled:
                self.is_released = True
            else:
                text = "the parachute is not enabled"
                return futures.failed(RejectedByAutopilotError(f"cannot release it: {text}", {"text": text}))
        return futures.done()


def make_driver(clock: Callable[[], float], is_link_lost: Callable[[], bool]) -> LightParachute:
    """Makes that of one UAV."""
    del clock  # it takes no time
    return LightParachute(is_link_lost)
