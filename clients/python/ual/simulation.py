"""The world around a simulated UAV: its safety pilot, faults, wind, noise and the speed of time.

As values, from ``simulation.proto``. ``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from ual.geometry import Vector3


class SimulationPart(Enum):
    """A part of a simulation, and the methods that belong to it."""

    PILOT = 1
    """The safety pilot: PilotArm, PilotDisarm, PilotTakeOver, PilotMoveSticks, PilotGiveBack."""
    FAULTS = 2
    """Faults below the interface: BeginFault, EndFault, ListFaults."""
    TIME = 3
    """Speed of time, and steps of it: SetSpeedFactor, Step."""
    NOISE = 4
    """Noise of the estimates: SetNoise."""
    WIND = 5
    """SetWind."""
    PLACE = 6
    """The UAV is put on the ground anew: PlaceOnGround."""


class Command(Enum):
    """A command that can be refused or whose acknowledgement can be lost or late."""

    ANY = 0
    """Any of them."""
    ARM = 1
    DISARM = 2
    TAKE_OFF = 3
    LAND = 4
    TAKE_CONTROL = 5
    """Taking control, as RecoverFromManual does."""


@dataclass(frozen=True, slots=True)
class LinkLost:
    """Nothing comes from the autopilot and nothing reaches it."""


@dataclass(frozen=True, slots=True)
class PositionLost:
    """The autopilot's estimator loses its position."""


@dataclass(frozen=True, slots=True)
class EstimatorJumps:
    """The position estimate jumps by an offset (m), again and again.

    Args:
        period_s: Between two jumps (there and back); more than 0.

    """

    offset: Vector3 = field(default_factory=lambda: Vector3(1.0, 0.0, 0.0))
    period_s: float = 5.0


@dataclass(frozen=True, slots=True)
class MotorsWeak:
    """The motors give a part of their power: accelerations and climb are scaled by it.

    Args:
        power_ratio: 0 to 1.

    """

    power_ratio: float = 0.5


@dataclass(frozen=True, slots=True)
class BatteryLow:
    """The battery falls to a charge.

    Args:
        remaining_percent: 0 to 100.

    """

    remaining_percent: float = 10.0


@dataclass(frozen=True, slots=True)
class CommandRefused:
    """The autopilot refuses a command in these words."""

    command: Command = Command.ANY
    text: str = "refused by a simulated fault"


@dataclass(frozen=True, slots=True)
class AckLost:
    """The autopilot obeys a command, but its acknowledgement never arrives."""

    command: Command = Command.ANY


@dataclass(frozen=True, slots=True)
class AckLate:
    """The acknowledgement of a command arrives late.

    Args:
        delay_s: More than 0.

    """

    command: Command = Command.ANY
    delay_s: float = 1.0


@dataclass(frozen=True, slots=True)
class FailsafeTriggered:
    """A failsafe of the autopilot. In the air it leaves the mode that takes references, and holds its position.

    It stays active until the fault ends.

    Args:
        cause: In the words of `Health.failsafe`: "battery failsafe", "rc failsafe", "fence", ...

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
