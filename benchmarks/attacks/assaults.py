"""The attacks by name: how each is begun, on what, and how fast."""

from __future__ import annotations

import json
import subprocess
import sys
from abc import ABC, abstractmethod
from dataclasses import dataclass

from typing_extensions import override

from benchmarks.attacks import calls, connections
from benchmarks.attacks.scenes import AttackScene, MavlinkScene
from benchmarks.children import REPOSITORY

_END_S = 30.0


class Assault(ABC):
    """One attack. `unit` says what it counts."""

    name: str
    unit = "calls"
    text = ""

    def suits(self, scene: type[AttackScene]) -> bool:
        """Returns whether it can be made there."""
        return True

    @abstractmethod
    def begin(self, scene: AttackScene) -> None:
        """Begins it."""

    @abstractmethod
    def end(self, scene: AttackScene) -> float:
        """Ends it. Returns how often it did what it does."""


@dataclass
class Nothing(Assault):
    """No attack: what the figures are without one."""

    name: str = "none"

    @override
    def begin(self, scene: AttackScene) -> None:
        return

    @override
    def end(self, scene: AttackScene) -> float:
        return 0.0


class _ProgramAssault(Assault):
    """An attack by a program that ends with its standard input, and then prints a number."""

    def _start(self, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            cwd=REPOSITORY,
        )

    @override
    def end(self, scene: AttackScene) -> float:
        try:
            answer, _ = self._process.communicate(timeout=_END_S)
            return float(json.loads(answer or "0"))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            return 0.0


class CallAttack(_ProgramAssault):
    """Calls through gRPC's client, at most so many a second."""

    def __init__(self, name: str, rate_hz: float) -> None:
        self.name = name
        self._rate_hz = rate_hz
        self.text = (calls.ATTACKS[name][0].__doc__ or "").strip()

    @override
    def suits(self, scene: type[AttackScene]) -> bool:
        return not scene.is_plain

    @override
    def begin(self, scene: AttackScene) -> None:
        self._start("benchmarks.attacks.calls", self.name, scene.address, "--rate", str(self._rate_hz))


class ConnectionAttack(_ProgramAssault):
    """Connections and frames by plain sockets, as fast as they go."""

    unit = "acts"

    def __init__(self, name: str) -> None:
        self.name = name
        self.text = (connections.ATTACKS[name].__doc__ or "").strip()

    @override
    def begin(self, scene: AttackScene) -> None:
        self._start("benchmarks.attacks.connections", self.name, "127.0.0.1", str(scene.port))


class Garbage(_ProgramAssault):
    """Garbage on the MAVLink port, from another host's address or from the autopilot's own."""

    unit = "MB"

    def __init__(self, kind: str, rate: float, *, is_own: bool) -> None:
        self._kind, self._rate, self._is_own = kind, rate, is_own
        self.name = f"{kind} {rate:g} MB/s, {'own' if is_own else 'stranger'}"

    @override
    def suits(self, scene: type[AttackScene]) -> bool:
        return scene is MavlinkScene

    @override
    def begin(self, scene: AttackScene) -> None:
        assert isinstance(scene, MavlinkScene)
        if self._is_own:
            scene.autopilot.ask("garbage", kind=self._kind, port=scene.link_port, rate=self._rate)
        else:
            self._start("benchmarks.attacks.garbage", self._kind, str(scene.link_port), "--rate", str(self._rate))

    @override
    def end(self, scene: AttackScene) -> float:
        count = float(scene.autopilot.ask("garbage_end")["count"]) if self._is_own else super().end(scene)
        return count / 1e6


_RATES_HZ = {"oversized": 20.0, "large": 20.0, "stream_churn": 200.0, "no_request": 200.0, "stream_flood": 100.0}
_RATE_HZ = 500.0
"""More would take the machine by the attacker alone: one of its calls costs it about as much as it costs a server."""


_GARBAGE = (("magics", 0.3), ("magics", 10.0), ("magics_v1", 10.0), ("random", 10.0))
"""Kinds, and MB/s. A PX4 sends 0.024."""


def assaults() -> list[Assault]:
    """Returns all attacks."""
    return [
        Nothing(),
        *(CallAttack(name, _RATES_HZ.get(name, _RATE_HZ)) for name in calls.ATTACKS),
        *(Garbage(kind, rate, is_own=is_own) for is_own in (False, True) for kind, rate in _GARBAGE),
        *(ConnectionAttack(name) for name in connections.ATTACKS),
    ]
