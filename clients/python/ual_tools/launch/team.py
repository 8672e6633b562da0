"""Description of a team: its programs, the conditions that each of them waits for, and the consequences of an end."""

from __future__ import annotations

import signal
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path


class Restart(Enum):
    """Conditions for a new start of a program that has ended."""

    ALWAYS = "always"
    ON_FAILURE = "on-failure"
    NO = "no"


class AtEnd(Enum):
    """Behaviour of the team's UAVs when the team ends."""

    LAND = "land"
    HOLD = "hold"


class ReadyCondition(Enum):
    """Sign that a program is ready."""

    STARTED = "started"
    PORT = "port"
    FILE = "file"
    LOG = "log"
    EXIT = "exit"
    SERVING = "serving"


@dataclass(frozen=True, slots=True)
class Ready:
    """Condition of a program's readiness: `value` is the port, the file or the pattern of the line."""

    condition: ReadyCondition = ReadyCondition.STARTED
    value: str = ""


@dataclass(frozen=True, slots=True)
class Program:
    """One program of a team. It is started once all of `needs` are ready."""

    name: str
    argv: tuple[str, ...]
    cwd: Path
    env: Mapping[str, str] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    ready: Ready = Ready()
    ready_limit_s: float | None = None
    """None: without a limit."""
    restart: Restart = Restart.NO
    is_ending_team: bool = False
    """Whether the team ends when it has ended and is not started again."""
    is_ended_first: bool = False
    """Whether it is ended before the UAVs land: it may command them."""
    stop_signal: signal.Signals = signal.SIGTERM
    stop_limit_s: float = 10.0
    log_file: Path | None = None
    image: str | None = None
    ns: str = ""
    """The namespace, if it is a daemon."""

    @property
    def is_daemon(self) -> bool:
        """Whether it is the daemon of a UAV."""
        return bool(self.ns)


@dataclass(frozen=True, slots=True)
class Team:
    """Some programs, in an order in which each stands behind those that it needs."""

    name: str
    file: Path
    programs: Sequence[Program]
    at_end: AtEnd = AtEnd.LAND
    land_limit_s: float = 120.0

    @property
    def daemons(self) -> list[Program]:
        """The daemons of its UAVs."""
        return [each for each in self.programs if each.is_daemon]
