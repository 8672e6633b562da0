"""A simulated safety pilot for a simulated PX4 or ArduCopter. It never arms anything with a flight controller."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import PermissionDeniedError
from ual_daemon.backends import futures
from ual_daemon.backends.base import SafetyPilot
from ual_daemon.backends.mavlink.session.session import Session

ARMING_LIMIT_S = 5.0


class SimulatedPilot(SafetyPilot):
    """Arms through our own link. From any thread.

    `session` returns the session with the autopilot while its link is up, `arm` is the backend's command.
    """

    def __init__(self, session: Callable[[], Session | None], arm: Callable[[], Future[None]]) -> None:
        self._session = session
        self._arm = arm

    @override
    def may_arm(self) -> bool:
        session = self._session()
        if session is None:
            return False
        verdict = session.judge_simulation()
        if verdict.is_simulated is False:
            raise PermissionDeniedError(
                f"this {session.dialect.name} (system {session.system_id}) is no simulator: {verdict.why}; "
                "its safety pilot arms it"
            )
        return bool(verdict.is_simulated) and session.is_ready_to_arm()

    @override
    def arm(self) -> None:
        if not self.may_arm():  # it may be another vehicle by now
            return
        late = f"the autopilot has not answered the arming for {ARMING_LIMIT_S:g} s"
        futures.wait(self._arm(), ARMING_LIMIT_S, late)
