"""A simulated safety pilot for the firmware's simulator, which only UDP leads to."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual_daemon.backends import futures
from ual_daemon.backends.base import SafetyPilot

ARMING_LIMIT_S = 5.0


class SimulatedPilot(SafetyPilot):
    """Arms through our own link. From any thread. `is_ready` says whether it can be armed now."""

    def __init__(self, is_ready: Callable[[], bool], arm: Callable[[], Future[None]]) -> None:
        self._is_ready = is_ready
        self._arm = arm

    @override
    def may_arm(self) -> bool:
        return self._is_ready()

    @override
    def arm(self) -> None:
        futures.wait(self._arm(), ARMING_LIMIT_S, f"the Crazyflie has not armed within {ARMING_LIMIT_S:g} s")
