"""The example of a third party's backend and its device on one clock; link and pilot do as tests want."""

from __future__ import annotations

import sys
from collections import deque
from pathlib import Path

from typing_extensions import override

from tests.simulators.pace import Pace
from ual_daemon.backends.base import BackendOptions, Clock

sys.path.append(str(Path(__file__).parents[2] / "examples" / "third_party_backend"))

from ual_hover.autopilot import PERIOD_S, Answer, Autopilot, Packet, Target
from ual_hover.backend import HoverBackend


class Device(Autopilot):
    """The device at the other end of a link."""

    def __init__(self, speed: float) -> None:
        super().__init__()
        self.pace = Pace(PERIOD_S, speed)
        self.elapsed_s = 0.0
        self.is_silent = False
        self.ignores = False
        self.refusal = ""
        self.targets_s: list[float] = []
        self.commands: list[tuple[float, str]] = []
        self._waiting: deque[Packet | Answer] = deque()

    def advance(self) -> None:
        """Flies on by a step; what it says waits until it is received."""
        self.elapsed_s += PERIOD_S
        packet = self.step()
        if not self.is_silent:
            self._waiting.append(packet)

    @override
    def receive(self, timeout_s: float) -> Packet | Answer | None:
        if not self._waiting and timeout_s > 0.0:
            self.pace.wait()
            self.advance()
        return self._waiting.popleft() if self._waiting else None

    @override
    def command(self, name: str) -> None:
        self.commands.append((self.elapsed_s, name))
        if self.ignores:
            return
        answer = Answer(name, self.refusal or self.execute(name))
        if not self.is_silent:
            self._waiting.append(answer)

    def pilot_switches(self, name: str) -> None:
        """The pilot's own command."""
        assert self.execute(name) == "ok"

    @override
    def follow(self, target: Target) -> None:
        self.targets_s.append(self.elapsed_s)
        super().follow(target)


class _Clock(Clock):
    """The device's time."""

    def __init__(self, device: Device) -> None:
        self._device = device

    @override
    def now_s(self) -> float:
        return self._device.elapsed_s


class LockstepHover(HoverBackend):
    """Flies a stepped device."""

    def __init__(self, options: BackendOptions, speed: float) -> None:
        self.device = Device(speed)
        super().__init__(options, self.device, _Clock(self.device))
