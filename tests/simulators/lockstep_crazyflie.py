"""The Crazyflie backend and a simulated Crazyflie on one clock: faster than real time, and slower on a busy computer.

All of the backend except its sockets is real. Its thread steps the Crazyflie instead of waiting for a link.
"""

from __future__ import annotations

from collections import deque

from typing_extensions import override

from tests.simulators.crazyflie import STEP_S, Crazyflie
from tests.simulators.pace import Pace
from tests.simulators.ports import MemoryPort
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.crazyflie.backend import CrazyflieBackend
from ual_daemon.backends.crazyflie.links import CrtpLink
from ual_daemon.backends.crazyflie.packets import CrtpPacket

SPEED = 10.0
_BEGIN_UTC_S = 1.8e9


class LockstepCrazyflie(CrazyflieBackend):
    """Flies a simulated Crazyflie that must be armed. `url` is not used."""

    def __init__(
        self,
        options: BackendOptions,
        crazyflie: Crazyflie | None = None,
        port: MemoryPort | None = None,
        speed: float = SPEED,
    ) -> None:
        self.port = MemoryPort() if port is None else port
        self.crazyflie = Crazyflie(self.port) if crazyflie is None else crazyflie
        self._speed = speed
        super().__init__(BackendOptions(options.ns, "udp://127.0.0.1:1", options.settings))
        self.clock = _Clock(self.crazyflie)

    @override
    def _make_link(self) -> CrtpLink:
        return SteppedLink(self.crazyflie, self.port, self._speed)


class SteppedLink(CrtpLink):
    """Advances the Crazyflie's time instead of waiting, at most `speed` times as fast as real time."""

    def __init__(self, crazyflie: Crazyflie, port: MemoryPort, speed: float) -> None:
        self.url = "udp://127.0.0.1:1"
        self._crazyflie = crazyflie
        self._port = port
        self._pace = Pace(STEP_S, speed)

    @override
    def open(self) -> None:
        """It is always open."""

    @override
    def close(self) -> None:
        """It is never closed."""

    @override
    def receive(self, timeout_s: float) -> list[CrtpPacket]:
        self._pace.wait()
        self._crazyflie.step()
        return _taken(self._port.sent)

    @override
    def send(self, packet: CrtpPacket) -> None:
        self._port.arriving.append(packet.encode())


class _Clock(MonotonicClock):
    """The Crazyflie's time."""

    def __init__(self, crazyflie: Crazyflie) -> None:
        self._crazyflie = crazyflie

    @override
    def now_s(self) -> float:
        return self._crazyflie.elapsed_s

    @override
    def utc_s(self) -> float:
        return _BEGIN_UTC_S + self._crazyflie.elapsed_s


def _taken(sent: deque[tuple[float, bytes]]) -> list[CrtpPacket]:
    found = (CrtpPacket.decode(sent.popleft()[1]) for _ in range(len(sent)))
    return [packet for packet in found if packet is not None]
