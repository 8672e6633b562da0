"""Snapshots: what goes up from a backend."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

from typing_extensions import Self

from ual.geometry import Pose, Twist, Vector3
from ual.shared.immutable import immutable
from ual.types import Battery, GeoPoint, GpsFix, GpsInfo, Health
from ual_daemon.backends.values.autopilot_fence import AutopilotFence
from ual_daemon.backends.values.modes import Cause, LandedState, Mode
from ual_daemon.backends.values.sample import Sample
from ual_daemon.geodesy import Projection, is_zero

_ON_GROUND = LandedState.ON_GROUND
"""As a name of the module: Python looks up a member of an enumeration by a call, and each update would pay."""


@immutable
class Estimator:
    """Whether the autopilot trusts its position estimate, and if not, why, in the autopilot's words."""

    is_good: bool
    why: str = ""

    def is_regained_after(self, last: Sample[Estimator] | None) -> bool:
        """Returns whether the last word was that the position is not good. Then a pose from before this one is not
        good.
        """
        return self.is_good and last is not None and not last.value.is_good


class _Group:
    """The base of snapshots and their groups."""

    __slots__ = ()

    def _replace(self, **changes: Any) -> Self:  # noqa: ANN401  as the fields
        """Returns the same with other values of some fields."""
        return replace(self, **changes)  # type: ignore[type-var]  # each group is a dataclass


@immutable
class ControlState(_Group):
    """State of the control: armed, on the ground or not, its mode, and causes that keep UAL from flying.

    Attributes:
        armed: Whether it is armed.
        landed: Whether it is on the ground. None: this autopilot does not say it.
        mode: The mode.
        failsafe: The failsafe that is active, whatever the mode.
        held_by: What holds the control in the present mode, where that is not UAL. None where the backend cannot
            say: it is then taken for the safety pilot, unless `is_of_command`.
        other_sender: What shows that another program sends setpoints, too, human-readable; empty if nothing does.
        is_of_command: Whether the mode came by a command of UAL shortly before, perhaps late.
    """

    armed: Sample[bool] | None = None
    landed: Sample[LandedState] | None = None
    mode: Sample[Mode] | None = None
    failsafe: Cause | None = None
    held_by: Cause | None = None
    other_sender: str = ""
    is_of_command: bool = False

    @property
    def is_on_ground(self) -> bool:
        """Whether it surely stands on the ground."""
        return self.landed is not None and self.landed.value is _ON_GROUND

    @property
    def mode_name(self) -> str:
        """The name of the mode; empty while it is not known."""
        return "" if self.mode is None else self.mode.value.name

    @property
    def mode_text(self) -> str:
        """Name of the mode for users; empty while it is not known."""
        return "" if self.mode is None else self.mode.value.text

    @property
    def arming_starts(self) -> str:
        """Warning that arming starts a flight, human-readable; empty where arming starts nothing, and once
        armed.
        """
        if self.mode is None or self.armed is None or self.armed.value:
            return ""
        return self.mode.value.arming_starts

    @property
    def settled_mode(self) -> str:
        """The name of the mode; empty if it may be the one from before the arming, which the arming has changed.

        PX4 tells the arming by an event, and the mode that it was made to enter for it up to a second later.
        """
        mode, armed, landed = self.mode, self.armed, self.landed
        is_on_ground = landed is None or landed.value is _ON_GROUND
        if mode is None or (armed is not None and is_on_ground and mode.time_s < armed.time_s):
            return ""
        return mode.value.name


@immutable
class MotionState(_Group):
    """Position and motion of the vehicle, by the autopilot's estimate, and the quality of that.

    Attributes:
        estimator: Whether the autopilot trusts its estimate.
        pose: The pose of the body in the local frame.
        velocity: Linear along the local axes, angular in the body.
        position_geo: The position on Earth, where the autopilot sends it. Else it is computed from the pose by the
            projection.
        stamp_s: The autopilot's time of the pose as UTC since 1970.
        measured_s: The same on the autopilot's own clock (0: it does not say), of which only differences count. UTC is
            estimated, and is corrected when the delay of the link changes.
    """

    estimator: Sample[Estimator] | None = None
    pose: Sample[Pose] | None = None
    velocity: Sample[Twist] | None = None
    position_geo: GeoPoint | None = None
    stamp_s: float = 0.0
    measured_s: float = 0.0


@immutable
class EarthReference(_Group):
    """Pose of the local frame on Earth, and the position of home. It seldom changes.

    Attributes:
        projection: Between local metres and Earth. None while it may be that of an earlier local frame.
        home_geo: Where home lies, if the autopilot says so; its altitude is the next one.
        home_altitude_amsl_m: What altitudes above home are relative to.
        geoid_separation_m: The height above the ellipsoid minus the height above mean sea level, at this place.
    """

    projection: Projection | None = None
    home_geo: GeoPoint | None = None
    home_altitude_amsl_m: float | None = None
    geoid_separation_m: float | None = None

    @property
    def home(self) -> Vector3 | None:
        """The autopilot's home in the local frame; None if that is not known."""
        position, altitude_m, projection = self.home_geo, self.home_altitude_amsl_m, self.projection
        if position is None or altitude_m is None or projection is None:
            return None
        if is_zero(position.latitude_deg, position.longitude_deg):  # none was set
            return None
        return projection.to_local(position.latitude_deg, position.longitude_deg, altitude_m)


class SevereText(NamedTuple):
    """A text of severity 0 (emergency) to 2 (critical) of the autopilot, and when it came."""

    text: str
    severity: int
    time_s: float


@immutable
class Condition(_Group):
    """Condition of the vehicle, above all for users.

    Attributes:
        battery: The one that the flight depends on.
        gps: The receiver of satellites. None: the backend reports none.
        status_text: The newest text of the autopilot, or what the backend has to say instead.
        health: What else the autopilot says of itself. Its `failsafe` and `held_by` are filled in above.
        has_rangefinder: Whether the autopilot uses a distance sensor that looks down.
        batteries: All of them, by their ids, where the autopilot tells of each.
        severe_texts: Recent texts of the autopilot that are critical or worse.
        aids: What else than satellites its sensors tell it about its place, human-readable; empty if nothing is known.
    """

    battery: Battery | None = None
    gps: GpsInfo | None = None
    status_text: str = ""
    health: Health | None = None
    has_rangefinder: bool = False
    batteries: tuple[Battery, ...] = ()
    severe_texts: tuple[SevereText, ...] = ()
    aids: str = ""


@immutable
class LinkState(_Group):
    """Trouble of the link, and the count of the autopilot's boots. It seldom changes.

    Attributes:
        trouble: What is wrong, or what is received instead of the autopilot; empty while nothing is wrong. It ends the
            reason of the state while nothing is heard from the autopilot.
        refused: Which requests for data the autopilot has refused. It ends the reason of the state while that data is
            missing.
        conflict: Why it is not sure that the values are those of one vehicle. Nothing may be flown then.
        boots_count: Changes when the autopilot has rebooted, or is another one. Each boot begins a local frame of its
            own, whose place on Earth only a projection of that boot says. 0: it is not known which boot it is.
        boots_in_frame_count: Changes instead where the local frame is the same after the reboot, because something
            outside lays it (motion capture).
    """

    trouble: str = ""
    refused: str = ""
    conflict: str = ""
    boots_count: int = 0
    boots_in_frame_count: int = 0

    @property
    def boot(self) -> int:
        """Number of the boot, wherever its local frame begins; 0 where it is not known."""
        return self.boots_count + self.boots_in_frame_count


@immutable
class Snapshot(_Group):
    """The newest values from the autopilot, in groups; None for a value that it has not sent (yet).

    A group is immutable, too: where nothing of it has changed, it may be the same object from one snapshot to the next.

    Attributes:
        time_s: When the snapshot was taken. All times but `stamp_s` and `measured_s` are on the backend's clock.
        heard_s: When the last message came from the autopilot.
        updated_s: When the backend last looked for data, which every backend says. What came later is not in the
            values; while that is long ago no setpoint is sent.
        scheduling_gap: That the backend had no time to look for data lately, human-readable; empty if it had.
        sequence: Numbers the updates of a backend that may leave some out (`Backend.is_update_needed`), and counts
            these, too. 0: the vehicle is to count.
        control: What flies it.
        motion: Where it is and how it moves.
        earth: How the local frame lies on Earth, and where home is.
        condition: How the vehicle is.
        link: What is wrong with the link, and reboots.
        autopilot_fence: The limits that the autopilot itself keeps to; None: it has none.

    """

    time_s: float
    heard_s: float | None = None
    updated_s: float = math.inf
    scheduling_gap: str = ""
    sequence: int = 0
    control: ControlState = ControlState()
    motion: MotionState = MotionState()
    earth: EarthReference = EarthReference()
    condition: Condition = Condition()
    link: LinkState = LinkState()
    autopilot_fence: AutopilotFence | None = None

    def with_trouble(self, why: str) -> Snapshot:
        """Returns the same values, with what is wrong with the link, which people are to read at once, too."""
        return self._replace(link=self.link._replace(trouble=why), condition=self.condition._replace(status_text=why))

    def at(self, time_s: float) -> Snapshot:
        """Returns the same values at another time. Every setpoint needs this, so it names no field."""
        return Snapshot(
            time_s,
            self.heard_s,
            self.updated_s,
            self.scheduling_gap,
            self.sequence,
            self.control,
            self.motion,
            self.earth,
            self.condition,
            self.link,
            self.autopilot_fence,
        )

    def position_geo(self) -> GeoPoint | None:
        """Returns the position on Earth: as the autopilot reports it, or by its projection.

        None while the autopilot does not trust its position: ArduPilot then goes on reporting the last one. Of an
        autopilot that does not say whether it does (iNav, Betaflight), the last report is returned while its satellites
        are good.
        """
        motion, earth, gps = self.motion, self.earth, self.condition.gps
        if motion.estimator is None:
            return motion.position_geo if gps is not None and gps.fix >= GpsFix.FIX_3D else None
        if not motion.estimator.value.is_good:
            return None
        if motion.position_geo is not None:
            return motion.position_geo
        if motion.pose is None or earth.projection is None:
            return None
        point = earth.projection.to_geo(motion.pose.value.position)
        amsl_m, home_m, separation_m = point.altitude_amsl_m, earth.home_altitude_amsl_m, earth.geoid_separation_m
        assert amsl_m is not None
        return GeoPoint(
            point.latitude_deg,
            point.longitude_deg,
            amsl_m,
            None if home_m is None else amsl_m - home_m,
            None if separation_m is None else amsl_m + separation_m,
        )
