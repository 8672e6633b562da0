"""The backend and a simulated Crazyflie in stepped time, without threads: the same run always has the same result."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

from tests.simulators.crazyflie import Crazyflie
from tests.simulators.faults import BadLink, Faults
from tests.simulators.lockstep_crazyflie import LockstepCrazyflie
from tests.simulators.ports import MemoryPort
from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.crazyflie.packets import HIGH_LEVEL
from ual_daemon.backends.crazyflie.session import CrazyflieSession
from ual_daemon.backends.values import LandedState, PositionSetpoint, Setpoint, Snapshot
from ual_daemon.flight.state import Estimate, estimate

RATE_S = 0.02
LIMITS = Limits()


class FlightTrace:
    """One Crazyflie and its backend. `faults` are those of the link, both ways."""

    def __init__(
        self,
        cache: Path,
        crazyflie: Crazyflie | None = None,
        faults: Faults | None = None,
        positioning_deck: str = "",
        is_watch_only: bool = False,
        **settings: object,
    ) -> None:
        self.memory = MemoryPort()
        self.link = BadLink(self.memory, 1, faults or Faults(), faults or Faults())
        self.crazyflie = crazyflie or Crazyflie(self.memory)
        self.crazyflie.port = self.link
        if positioning_deck:
            self.crazyflie.parameters[positioning_deck] = "B", 1, True
        self._cache = cache
        self._is_watch_only = is_watch_only
        self._settings = settings
        self.backend = self._make_backend()

    def _make_backend(self) -> LockstepCrazyflie:
        settings = {"cache_directory": str(self._cache), **self._settings}
        backend = LockstepCrazyflie(BackendOptions("uav_1", None, settings), self.crazyflie, self.memory, math.inf)
        self.updates: list[Snapshot] = []
        backend.is_watch_only = self._is_watch_only
        backend._session = backend._make_session(self.updates.append)
        backend._loop = backend._session.loop
        return backend

    def restart_daemon(self) -> None:
        """Another daemon begins, as after a kill."""
        self.memory.arriving.clear()
        self.memory.sent.clear()
        self.backend = self._make_backend()

    @property
    def session(self) -> CrazyflieSession:
        assert self.backend._session is not None
        return self.backend._session

    @property
    def now_s(self) -> float:
        return self.crazyflie.elapsed_s

    def run(self, duration_s: float) -> None:
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self._turn()

    def until(self, holds: Callable[[], bool], limit_s: float = 10.0) -> float:
        """Runs until it holds, and returns after how long."""
        begin_s = self.now_s
        while not holds():
            assert self.now_s - begin_s < limit_s, (self.estimate(), self.backend.snapshot())
            self._turn()
        return self.now_s - begin_s

    def _turn(self) -> None:
        before_s = self.now_s
        self.session.thread.turn()
        if self.now_s == before_s:  # the link is being opened
            self.crazyflie.step()

    def fly(self, setpoint: Callable[[float], Setpoint], duration_s: float) -> None:
        """Sends setpoints at 50 Hz; they get the time since the beginning."""
        begin_s = self.now_s
        due_s = begin_s
        while self.now_s < begin_s + duration_s:
            if self.now_s >= due_s:
                due_s += RATE_S
                self.backend.send(setpoint(self.now_s - begin_s))
            self._turn()

    def lose_answers(self, count: int) -> list[float]:
        """Loses the next answers of the high-level commander. Returns when each was lost, as it happens."""
        lost: list[float] = []
        send = self.crazyflie._send

        def lossy(port: int, channel: int, data: bytes) -> None:
            if port == HIGH_LEVEL and len(lost) < count:
                lost.append(self.now_s)
            else:
                send(port, channel, data)

        self.crazyflie._send = lossy  # type: ignore[method-assign]
        return lost

    def ready(self) -> None:
        """Runs until it is connected and has a state."""
        self.until(lambda: self.session.is_connected and self.backend.snapshot().motion.pose is not None)
        self.run(0.5)

    def arm(self) -> None:
        self.end(self.backend.arm())

    def take_off(self, height_m: float = 1.0) -> None:
        """Connects, arms, and flies up."""
        self.ready()
        self.arm()
        self.end(self.backend.take_off(height_m, LIMITS))
        x, y, z = self.crazyflie.current_position
        self.fly(lambda t: current_position(x, y, z + min(height_m, 0.5 * t), 0.5 if t < 2.0 * height_m else 0.0), 4.0)
        assert self.crazyflie.current_position[2] > 0.8 * height_m

    def end(self, future: Future[None]) -> None:
        """Runs until a command has ended, and raises its error."""
        self.until(future.done)
        future.result(0)

    def estimate(self) -> Estimate:
        return estimate(self.backend.snapshot(), self.backend.freshness)

    @property
    def landed(self) -> LandedState:
        landed = self.backend.snapshot().control.landed
        assert landed is not None
        return landed.value


def current_position(x: float, y: float, z: float, climb_m_s: float = 0.0, yaw_rad: float = 0.0) -> PositionSetpoint:
    return PositionSetpoint(Vector3(x, y, z), yaw_rad, Vector3(0.0, 0.0, climb_m_s))
