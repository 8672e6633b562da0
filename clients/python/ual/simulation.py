"""Faults that a simulated UAV can be given; what ``ual/v1/simulation.proto`` says, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from ual.geometry import Vector3


class SimulationPart(Enum):
    """A part of a simulation. Each simulation offers some; see `ual.interface.Simulation`."""

    PILOT = 1
    """The safety pilot."""
    FAULTS = 2
    """Faults below the interface."""
    TIME = 3
    """Speed of time, and steps of it."""
    NOISE = 4
    """Of the estimates."""
    WIND = 5
    PLACE = 6
    """The UAV is put on the ground anew."""


class Command(Enum):
    """A command that can be refused or whose acknowledgement can be lost or late."""

    ANY = 0
    ARM = 1
    DISARM = 2
    TAKE_OFF = 3
    LAND = 4
    TAKE_CONTROL = 5


@dataclass(frozen=True, slots=True)
class LinkLost:
    """Nothing comes from the autopilot and nothing reaches it."""


@dataclass(frozen=True, slots=True)
class PositionLost:
    """The autopilot's estimator loses its position."""


@dataclass(frozen=True, slots=True)
class EstimatorJumps:
    """The position estimate jumps by `offset` (m), there and back, every `period_s`."""

    offset: Vector3 = field(default_factory=lambda: Vector3(1.0, 0.0, 0.0))
    period_s: float = 5.0


@dataclass(frozen=True, slots=True)
class MotorsWeak:
    """The motors give a part of their power, 0 to 1: accelerations and climb are scaled by it."""

    power_ratio: float = 0.5


@dataclass(frozen=True, slots=True)
class BatteryLow:
    """The battery falls to a charge."""

    remaining_percent: float = 10.0


@dataclass(frozen=True, slots=True)
class CommandRefused:
    """The autopilot refuses a command in these words."""

    command: Command = Command.ANY
    text: str = "refused by a simulated fault"


@dataclass(frozen=True, slots=True)
class AckLost:
    """The autopilot obeys, but its acknowledgement never arrives."""

    command: Command = Command.ANY


@dataclass(frozen=True, slots=True)
class AckLate:
    """The acknowledgement of a command arrives late."""

    command: Command = Command.ANY
    delay_s: float = 1.0


@dataclass(frozen=True, slots=True)
class FailsafeTriggered:
    """A failsafe of the autopilot, in the words of `ual.types.Health.failsafe`, until the fault ends.

    In the air the autopilot leaves the mode that takes references, and holds its position.
    """

    cause: str = "battery failsafe"


Fault = (
    LinkLost
    | PositionLost
    | EstimatorJumps
    | MotorsWeak
    | BatteryLow
    | CommandRefused
    | AckLost
    | AckLate
    | FailsafeTriggered
)
