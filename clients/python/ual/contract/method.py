"""The facts of a method of the contract: the options of ``ual/v1/options.proto``."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from ual.access.roles import Role

QUICK_S = 10.0
"""Seconds for which a client waits for an answer that needs no manoeuvre. A daemon that takes this long is stuck."""


class Moves(Enum):
    """A kind of motion that a method starts or continues; see ``options.proto``."""

    NOTHING = 0
    FLIGHT = 1
    BESIDE = 2


class Kind(Enum):
    """Kind of a client's call. Of a team, it says which UAVs get it where one cannot be reached."""

    QUESTION = "all that can be reached are asked"
    CHANGE = "none gets it"
    COMMAND = "none gets it; sent after the setpoints that were given before it"
    STOP = "all that can be reached get it, since it ends or holds a flight; sent as a command"
    SETPOINT = "all that can be reached get it; sent in the stream of setpoints"
    EXTERNAL_POSE = "not of a team; sent in the stream of poses from outside"
    SIMULATION = "not of a team; belongs to `Uav.simulation`"


class Method(NamedTuple):
    """A method of the contract. See ``options.proto`` for what each of these means."""

    service: str
    name: str
    role: Role
    kind: Kind
    moves: Moves = Moves.NOTHING
    needs_lease: bool = False
    stale_after_s: float = math.inf
    limit_s: float = math.inf
    caller_limit_s: float | None = QUICK_S
    at_timeout: str = ""
    is_audited: bool = True
    flies_on: bool = False

    @property
    def path(self) -> str:
        """Its name on the wire."""
        return f"/ual.v1.{self.service}/{self.name}"
