"""ArduCopter: flown in GUIDED mode with setpoints in its local NED frame. Measured on 4.6.3
(docs/backends/mavlink.md).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual.types import Capability, Limits
from ual_daemon.backends.mavlink.autopilots.dialect import NO_PARAMETERS, Dialect, Reality, version_text
from ual_daemon.backends.mavlink.autopilots.setpoint_encoding import local_target
from ual_daemon.backends.mavlink.session.commands import Command, arm_or_disarm, set_interval, shows_landed, shows_mode
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import (
    Control,
    Estimator,
    Freshness,
    LandedState,
    Mode,
    PositionSetpoint,
    Setpoint,
    Snapshot,
)
from ual_daemon.geodesy import FlatProjection, Projection

_MODES = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    5: "LOITER",
    6: "RTL",
    7: "CIRCLE",
    9: "LAND",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    17: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    21: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    27: "AUTO_RTL",
    28: "TURTLE",
}
_GUIDED, _LAND, _BRAKE = 4, 9, 17
_UNARMABLE = frozenset(
    {
        "LAND",  # where it stands after a landing of ours
        "BRAKE",  # where the end of the daemon leaves it
        "AUTOROTATE",
        "AUTOTUNE",
        "AVOID_ADSB",
        "CIRCLE",
        "FLIP",
        "FOLLOW",
        "RTL",
        "SMART_RTL",
        "SYSTEMID",
    }
)
"""Modes in which ArduCopter always refuses to be armed (`allows_arming` in its mode.h)."""
_CONTROL = {_GUIDED: Control.REFERENCES, _LAND: Control.LAND}

_SIMULATION_PARAMETER = "SIM_SPEEDUP"
"""A parameter that only a simulator has, or an ArduPilot that simulates on its own board (which tells a board)."""

_NEAR_HOME_M = 1.0
"""As high above home, or as deep below, as its estimate of height wanders; see `_above_home_m`."""
ACCELERATION_SHARE = 0.5
"""How much of ArduPilot's own acceleration limits our references may ask for. It follows them within the same limits:
with nothing left to catch up by it overshoots, by 0.7 m at a goal and by 1.5 m where it is stopped on the way. At the
goal of an 18.7 m diagonal 0.6 of them overshoot by 0.31 m, 0.5 by 0.27 m (benchmarks/tracker.md)."""

LONGEST_LEAD_S = 0.5
"""Where its jerk limit is low for its acceleration, the velocity leads by no more: that is how much faster it is when
setpoints end, for a second of the acceleration."""


class ArduCopter(Dialect):
    """ArduPilot multirotors, 4.6."""

    name = "ArduPilot"
    capabilities = frozenset(Capability)
    tells_landed_state = True
    unarmable_modes = _UNARMABLE
    # What is asked for below comes at 10 Hz and more. Its own heartbeat, until it is asked, at 1 Hz.
    freshness = Freshness(link_s=1.2, pose_s=1.5, mode_s=4.0, landed_s=2.0, estimator_s=2.0)
    flies_takeoff_on_setpoints = False  # a setpoint on the way up cancels the take-off, silently
    estimator_message = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
    wanted_messages = (mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,)
    parameters = (
        "WPNAV_SPEED",
        "WPNAV_SPEED_UP",
        "WPNAV_SPEED_DN",
        "WPNAV_ACCEL",
        "WPNAV_ACCEL_Z",
        "PSC_JERK_XY",
        "PSC_JERK_Z",
        "ATC_SLEW_YAW",
        _SIMULATION_PARAMETER,
    )

    def mode(self, custom_mode: int) -> Mode:
        return Mode(_MODES.get(custom_mode, f"MODE{custom_mode}"), _CONTROL.get(custom_mode, Control.OTHER))

    def estimator(self, flags: int) -> Estimator:
        if flags & mavlink.EKF_CONST_POS_MODE:
            return Estimator(False, "it assumes that it stands still (no GPS or other position yet)")
        return super().estimator(flags)

    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        return FlatProjection(latitude_deg, longitude_deg, altitude_amsl_m)

    def streams(self, pose_rate_hz: float) -> list[Command]:
        return [
            set_interval(mavlink.MAVLINK_MSG_ID_HEARTBEAT, 10.0),
            set_interval(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 10.0),
            # Pushed when it arms as well, but not to a link on which nobody asked for anything yet. Before the pose: on
            # a bad link each takes its time, and a UAV that is ready must be able to take off.
            set_interval(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, 1.0),
            set_interval(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1.0),
            set_interval(mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 10.0),
            set_interval(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, pose_rate_hz),
            set_interval(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, pose_rate_hz),
            set_interval(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
            set_interval(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 2.0),
            set_interval(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 2.0),
        ]

    def version(self, message: Message) -> str:
        return version_text(message.flight_sw_version)

    def reality(self, version: Message | None, parameters: Mapping[str, float], system_id: int) -> Reality:
        if version is None:
            return Reality(None, "it has not told its version and its board")
        if version.board_version or version.vendor_id or version.product_id:  # also where it simulates by itself
            return Reality(
                False,
                f"it runs on a flight controller (board {version.board_version >> 16}, "
                f"USB {version.vendor_id:04x}:{version.product_id:04x})",
            )
        if _SIMULATION_PARAMETER not in parameters:
            return Reality(None, f"it has not told {_SIMULATION_PARAMETER}, which only simulators have")
        return Reality(True)

    def limits(self, parameters: Mapping[str, float]) -> Limits:
        """Its parameters are in cm and hundredths of degrees."""
        default = Limits()

        def read(name: str, otherwise: float, share: float = 1.0) -> float:
            value = parameters.get(name, 0.0) / 100.0
            return value * share if value > 0.0 else otherwise

        return Limits(
            horizontal_speed_m_s=read("WPNAV_SPEED", default.horizontal_speed_m_s),
            climb_speed_m_s=read("WPNAV_SPEED_UP", default.climb_speed_m_s),
            descent_speed_m_s=read("WPNAV_SPEED_DN", default.descent_speed_m_s),
            horizontal_acceleration_m_s2=read("WPNAV_ACCEL", default.horizontal_acceleration_m_s2, ACCELERATION_SHARE),
            vertical_acceleration_m_s2=read("WPNAV_ACCEL_Z", default.vertical_acceleration_m_s2, ACCELERATION_SHARE),
            yaw_rate_rad_s=math.radians(read("ATC_SLEW_YAW", math.degrees(default.yaw_rate_rad_s))),
        )

    def setpoint(
        self, setpoint: Setpoint, system_id: int, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        # Without the acceleration: when setpoints end (a killed daemon), ArduPilot goes on with the last one, and would
        # gain speed for GUID_TIMEOUT; the last velocity only keeps it.
        if isinstance(setpoint, PositionSetpoint):
            setpoint = replace(setpoint, velocity=velocity_lead(setpoint, parameters))
        return local_target(setpoint, system_id, time_ms, with_acceleration=False)

    def arm(self, snapshot: Snapshot) -> Command:
        arm = arm_or_disarm(is_arming=True)
        mode = "" if snapshot.mode is None else snapshot.mode.value.name
        # GUIDED, as the take-off that follows needs it: unlike in LOITER, the throttle stick's place does not matter.
        if self.can_be_armed_in(mode):
            return arm
        return replace(_set_mode(_GUIDED, f"leave {mode}, to be armed"), then=arm)

    def disarm(self) -> Command:
        return arm_or_disarm(is_arming=False)

    def take_off(self, height_m: float, snapshot: Snapshot) -> Command:
        # It wants a height above home. Home is where it was armed, by an estimate of height that wanders since.
        standing_m = _above_home_m(snapshot)
        if standing_m is None:
            raise WrongStateError("take_off: ArduPilot has not told yet where its home is")
        climb = Command(
            mavlink.MAV_CMD_NAV_TAKEOFF,
            (0.0,) * 6 + (standing_m + height_m,),
            "take off",
            group="mode",
            shows=shows_landed(LandedState.TAKING_OFF, LandedState.IN_AIR),
        )
        return replace(_set_mode(_GUIDED, "take off"), then=climb)

    def land(self) -> Command:
        return Command(mavlink.MAV_CMD_NAV_LAND, (), "land", group="mode", shows=shows_mode(_MODES[_LAND]))

    def take_control(self) -> Command:
        return _set_mode(_GUIDED, "take control")

    def hold(self) -> Command:
        # LOITER would hold as well, but by the throttle stick: at its bottom, or without a transmitter, it descends.
        return _set_mode(_BRAKE, "hold")


def _above_home_m(snapshot: Snapshot) -> float | None:
    """How high it is above home; None where that is not known surely enough to climb by it.

    On a bad link its own word for it comes sooner than where home and origin are, but may be from before it was armed,
    when home moved to where it stands. So that counts only where it makes little difference, which is flown at the end
    of the climb: else a climb from a home down in the valley would go as much too high.
    """
    pose, origin, home_m = snapshot.pose, snapshot.projection, snapshot.home_altitude_amsl_m
    if pose is not None and origin is not None and home_m is not None:
        return origin.altitude_amsl_m + pose.value.position.z - home_m
    told_m = None if snapshot.position_geo is None else snapshot.position_geo.altitude_home_m
    return None if told_m is None or abs(told_m) > _NEAR_HOME_M else told_m


def _set_mode(number: int, what: str) -> Command:
    params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), float(number))
    return Command(mavlink.MAV_CMD_DO_SET_MODE, params, what, group="mode", shows=shows_mode(_MODES[number]))


def velocity_lead(setpoint: PositionSetpoint, parameters: Mapping[str, float]) -> Vector3:
    """The velocity that makes ArduPilot accelerate as the reference does, in m/s: v + a * tau.

    Its input shaping (AP_Math/control.cpp, `shape_vel_accel`) accelerates by a_in + (v_in - v) * jerk / accel, with
    its own limits of both. So a velocity that is a * accel / jerk higher does what a_in = a does, until setpoints end.
    Never faster than its own speed limits, unless the reference is; and the reference itself while the limits are not
    known.
    """
    v, a = setpoint.velocity, setpoint.acceleration
    horizontal_s = _shaping_s(parameters, "WPNAV_ACCEL", "PSC_JERK_XY")
    vertical_s = _shaping_s(parameters, "WPNAV_ACCEL_Z", "PSC_JERK_Z")
    led = Vector3(v.x + a.x * horizontal_s, v.y + a.y * horizontal_s, v.z + a.z * vertical_s)
    speed_m_s = max(v.horizontal_norm(), parameters.get("WPNAV_SPEED", 0.0) / 100.0)
    share = min(1.0, speed_m_s / max(led.horizontal_norm(), 1e-9))
    up_m_s = max(v.z, parameters.get("WPNAV_SPEED_UP", 0.0) / 100.0)
    down_m_s = min(v.z, -parameters.get("WPNAV_SPEED_DN", 0.0) / 100.0)
    return Vector3(led.x * share, led.y * share, min(max(led.z, down_m_s), up_m_s))


def _shaping_s(parameters: Mapping[str, float], acceleration: str, jerk: str) -> float:
    """Its acceleration limit (cm/s^2) over its jerk limit (m/s^3), in seconds; 0 where they are not known."""
    jerk_m_s3 = parameters.get(jerk, 0.0)
    return min(parameters.get(acceleration, 0.0) / 100.0 / jerk_m_s3, LONGEST_LEAD_S) if jerk_m_s3 > 0.0 else 0.0
