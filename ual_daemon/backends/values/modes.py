"""Mode of the autopilot, its controller, and the cause of its entry."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


class LandedState(Enum):
    """Whether the vehicle is on the ground, as the autopilot reports it (MAV_LANDED_STATE); UNKNOWN if it does not."""

    UNKNOWN = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


class Control(Enum):
    """Controller of the vehicle in the autopilot's present mode."""

    REFERENCES = 1
    """The daemon's setpoints (PX4 OFFBOARD, ArduPilot GUIDED, ...)."""
    TAKE_OFF = 2
    """The autopilot's take-off mode."""
    LAND = 3
    """The autopilot's landing mode."""
    OTHER = 4
    """The safety pilot, or another mode of the autopilot."""


class OnArming(Enum):
    """Effect of arming an autopilot in a mode; the value is its text for users, empty where it is safe."""

    STANDS = ""
    """It stands until it is commanded, or until its sticks are moved."""
    REFUSES = "refuses"
    """It refuses to be armed."""
    MAY_FLY = "may start a flight"
    """Dependent on its parameters, or on a program that flies in this mode."""
    FLIES = "starts a flight"
    """It takes off by itself."""


class Cause(Enum):
    """Cause that took the control from UAL, or holds it; the value is the metadata `by` of errors."""

    SAFETY_PILOT = "safety pilot"
    """A mode that is flown by sticks, or a mode that the transmitter's switch selected."""
    GROUND_STATION = "ground station"
    """Another mode of the autopilot, without a failsafe or a switch: a ground station or another program."""
    AUTOPILOT = "autopilot"
    """The autopilot itself: it holds as its mission is complete, or just after an order of UAL about that."""
    BATTERY = "battery failsafe"
    RC = "rc failsafe"
    """The transmitter is lost."""
    FENCE = "fence"
    """The autopilot's own geofence."""
    GROUND_STATION_LOST = "ground station failsafe"
    """The link to the ground station is lost."""
    POSITION = "position failsafe"
    """The estimator has no good position."""
    SETPOINTS = "setpoint failsafe"
    """No setpoints came: taking control back is the remedy, so it needs no force."""
    FLIGHT_TIME = "flight time limit"
    """It has flown for as long as it may."""
    COLLISION = "collision"
    """It has hit something (a simulator tells)."""
    TERMINATION = "flight termination"
    """The autopilot keeps the motors stopped: by a flight termination, or by a kill or emergency-stop switch."""
    FAILSAFE = "failsafe"
    """A failsafe whose reason the autopilot does not say."""
    OPEN = ""
    """Not known yet: the mode has just changed, and its reason may follow within a moment."""

    @property
    def is_failsafe(self) -> bool:
        """Whether the autopilot itself took the control, to save the vehicle or those below it."""
        return self in _FAILSAFES

    @property
    def needs_force(self) -> bool:
        """Whether UAL overrides it only with force. Nothing but a disarming ends a termination."""
        return self.is_failsafe and self not in (Cause.SETPOINTS, Cause.TERMINATION)


_FAILSAFES = frozenset(
    {
        Cause.BATTERY,
        Cause.RC,
        Cause.FENCE,
        Cause.GROUND_STATION_LOST,
        Cause.POSITION,
        Cause.SETPOINTS,
        Cause.FLIGHT_TIME,
        Cause.COLLISION,
        Cause.TERMINATION,
        Cause.FAILSAFE,
    }
)


@dataclass(frozen=True, slots=True)
class Mode:
    """The autopilot's mode: its name, human-readable, and what controls the vehicle in it.

    `on_arming` is what it does when it is armed in it: no command of UAL arms it in one in which it does not stand.
    `is_autonomous` is whether the autopilot surely flies by itself in it, without sticks (hold, return): a landing may
    replace such a mode, and never one that the pilot flies. `own_text` has what the autopilot itself calls a mode that
    has no name here (an external mode of PX4, a script's of ArduPilot). It is only reported: nothing is decided by it.
    `keeps_height` is whether the autopilot bounds the descent in it, though a pilot flies.
    """

    name: str
    control: Control
    is_autonomous: bool = False
    own_text: str = field(default="", compare=False)
    on_arming: OnArming = OnArming.STANDS
    keeps_height: bool = False

    @property
    def text(self) -> str:
        """Name for users."""
        return self.own_text or self.name

    @property
    def arming_starts(self) -> str:
        """Warning that arming starts a flight, human-readable; empty where arming starts nothing."""
        if self.on_arming not in (OnArming.FLIES, OnArming.MAY_FLY):
            return ""
        return f"whoever arms it in mode {self.text} {self.on_arming.value}"
