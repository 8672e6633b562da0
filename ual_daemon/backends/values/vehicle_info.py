"""Description of a backend's vehicle: its setpoints, its response, and its behaviour without setpoints."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum, Flag, auto
from typing import NamedTuple

from ual.types import Capability, Limits


@dataclass(frozen=True, slots=True)
class Freshness:
    """Ages of values, in seconds, from which they are ignored. Depends on how often the autopilot sends it."""

    link_s: float = 1.5
    pose_s: float = 1.0
    mode_s: float = 3.0
    landed_s: float = 2.0
    estimator_s: float = 4.0


class Takes(Flag):
    """Setpoints that an autopilot takes. UAL sends no others."""

    POSITION = auto()
    """Positions and headings."""
    FEED_FORWARD = auto()
    """With a position: its velocity, acceleration and yaw rate, which the autopilot really flies."""
    VELOCITY = auto()
    """Velocities and yaw rates. Without feed-forward, UAL flies paths with them; without positions, it holds, too."""
    ALL = POSITION | FEED_FORWARD | VELOCITY


class SetpointLoss(Enum):
    """Behaviour of the vehicle when setpoints stop in the mode that takes them; the value is human-readable."""

    HOLDS = "holds its position"
    """By itself, or by a failsafe that ends in a safe mode (PX4, ArduPilot, the light simulation)."""
    COASTS = "goes on with the last setpoint"
    """A velocity that was sent last is flown on and on (AirSim, until its duration ends)."""
    FALLS = "stops its motors"
    """It comes down (Crazyflie). It is held from the first update on, also by a daemon that was not commanded in this
    flight; any other one is left to its pilot or program."""


class VelocityGains(NamedTuple):
    """Gains with which UAL flies to a position with velocities alone.

    The velocity that is sent is that of the trajectory, plus `response_s` times its acceleration, plus `position_per_s`
    times the distance from it; the yaw rate likewise, without acceleration. `response_s` is the time in which the
    vehicle follows a step of the velocity (to 63 %): 0 where that is not known.
    """

    position_per_s: float = 0.8
    """PX4's own is 0.95 (MPC_XY_P), ArduPilot's 1 (PSC_POSXY_P)."""
    yaw_per_s: float = 1.5
    response_s: float = 0.0


class VelocityResponse(NamedTuple):
    """Response of the vehicle to a step of a commanded velocity along one axis; see `ual_daemon.tracker.drift`.

    It hears what is commanded through a low pass of `delay_s` (the link). It then accelerates by what is missing of
    the velocity over `time_s`, within its limits of acceleration and jerk. Its acceleration follows that through a low
    pass of `rise_s`, where this is known apart (a multirotor tilts). `holds_place` says that the autopilot itself
    integrates the velocity to a place and holds that: an error of its estimated velocity does not carry it away.
    """

    time_s: float = 0.5
    acceleration_m_s2: float = 9.81
    """Horizontally, that of a tilt of 45 degrees."""
    jerk_m_s3: float = 1000.0
    delay_s: float = 0.2
    holds_place: bool = False
    rise_s: float = 0.0


class VelocityResponses(NamedTuple):
    """Responses of the vehicle to velocities along its axes."""

    horizontal: VelocityResponse = VelocityResponse()
    vertical: VelocityResponse = VelocityResponse()


@dataclass(frozen=True, slots=True)
class VehicleInfo:
    """Description of a backend's vehicle. Values may become known only once it is connected.

    Attributes:
        autopilot: The name of the autopilot.
        autopilot_version: Its version.
        is_simulation: Whether the vehicle is simulated.
        capabilities: What it can do.
        limits: The autopilot's own limits.
        flies_takeoff_on_setpoints: After `Backend.take_off` the daemon's setpoints fly the climb (PX4 OFFBOARD, the
            light simulation). Otherwise the autopilot climbs by itself, and gets no setpoints until it is up.
        flies_landing_on_setpoints: UAL lands it by velocities, and then stops its motors (`Backend.disarm_landed`): it
            has no landing of its own that UAL may use. It takes velocities, holds by itself without them, and tells its
            mode at least four times a second.
        takes: The setpoints that are sent; no others are.
        velocity_gains: Used where `takes` has no feed-forward.
        velocity_responses: Used while velocities are commanded.
        setpoint_rate_hz: How often UAL sends a setpoint by itself. Those of a caller's stream are passed on as they
            come.
        setpoint_loss: What the vehicle does when setpoints stop.
        has_safety_pilot: Whether a person can take over from UAL at any time (a transmitter, a simulated pilot). Where
            nobody can, UAL aborts take-offs and landings, too.
        identity: Which vehicle it is, so that what was saved for it is not used for another (`Backend.outlived`); empty
            while that is not known.
        limitation: Why it has fewer capabilities than others, human-readable. It ends the reason of the state.
        note: What is unusual about it (limits that are assumed, a link that carries little). It does so, too.
        cruise_speed_m_s: The horizontal speed at which the autopilot itself flies to a goal, where nobody requests
            another one.
        acceleration_share: The part of the autopilot's acceleration limits that `limits` have. References on the way
            use no more, a stop uses all.
        clearance_m: How far its body, and the air under it, need the ground to be where it does not land.
        drops_positions_beyond_fence: The autopilot ignores positions beyond its own fence, silently, also those that
            lead back inside. It follows velocities there (ArduPilot).
        keeps_target_of_a_kind: The autopilot leads its own target to the setpoints within its limits, from wherever it
            is, and begins at the present pose only with a setpoint of another kind (ArduPilot).
        applies_fence: Whether the autopilot applies a fence of its own; None where that is not known, or where UAL
            cannot upload one.
    """

    autopilot: str = ""
    autopilot_version: str = ""
    is_simulation: bool = False
    capabilities: frozenset[Capability] = frozenset()
    limits: Limits = field(default_factory=Limits)
    flies_takeoff_on_setpoints: bool = True
    flies_landing_on_setpoints: bool = False
    takes: Takes = Takes.ALL
    velocity_gains: VelocityGains = field(default_factory=VelocityGains)
    velocity_responses: VelocityResponses = field(default_factory=VelocityResponses)
    setpoint_rate_hz: float = 50.0
    setpoint_loss: SetpointLoss = SetpointLoss.HOLDS
    has_safety_pilot: bool = True
    identity: str = ""
    limitation: str = ""
    note: str = ""
    cruise_speed_m_s: float = math.inf
    acceleration_share: float = 1.0
    clearance_m: float = 0.5
    drops_positions_beyond_fence: bool = False
    keeps_target_of_a_kind: bool = False
    applies_fence: bool | None = None
