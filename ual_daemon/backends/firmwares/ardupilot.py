"""ArduCopter: flown in GUIDED mode. Measured with 4.6.3 (docs/reference/backends/mavlink.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from typing_extensions import override

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual.types import Capability, Limits
from ual_daemon.backends.firmwares.autopilot import (
    Autopilot,
    AutopilotBoard,
    HomeUnknownError,
    SimulationVerdict,
    fence_limit,
)
from ual_daemon.backends.firmwares.feed_forward import TILT_S
from ual_daemon.backends.firmwares.fence_zones import UNREAD, FoundZones
from ual_daemon.backends.firmwares.gimbal_codec import ArduPilotGimbal
from ual_daemon.backends.firmwares.gripper_codec import ArduPilotGripper
from ual_daemon.backends.firmwares.mission_codec import ArduCopterMissions
from ual_daemon.backends.firmwares.mission_items import MissionType
from ual_daemon.backends.firmwares.motor_outputs import MotorChannels
from ual_daemon.backends.firmwares.numbers import EstimatorFlag, Sensor, VtolState
from ual_daemon.backends.offers.fence import FenceSwitch
from ual_daemon.backends.values import (
    NO_FENCE,
    AutopilotFence,
    Cause,
    Control,
    Estimator,
    Mode,
    OnArming,
    PositionSetpoint,
    Snapshot,
    VelocityResponse,
    VelocityResponses,
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
_CONTROL = {"GUIDED": Control.REFERENCES, "LAND": Control.LAND}

_SIMULATION_PARAMETER = "SIM_SPEEDUP"
"""A parameter that only simulators have, and an ArduPilot that simulates on its own board (which its version names)."""
_FENCE_ALT_MAX, _FENCE_CIRCLE, _FENCE_POLYGON, _FENCE_ALT_MIN = 1, 2, 4, 8
"""The bits of FENCE_TYPE."""
_FENCE_LIMITS = (
    (_FENCE_CIRCLE, "FENCE_RADIUS"),
    (_FENCE_ALT_MAX, "FENCE_ALT_MAX"),
    (_FENCE_ALT_MIN, "FENCE_ALT_MIN"),
)
_FENCE_UNION = 2
"""The bit of FENCE_OPTIONS with which a place inside one inclusion is enough (AC_Fence.h, OPTIONS::INCLUSION_UNION);
else it must be inside all (AC_PolyFence_loader::breached)."""
_COPTER_VTOL_STATES = (VtolState.UNDEFINED, VtolState.MULTIROTOR)
_PLANE_PARAMETER = "Q_ENABLE"
"""A parameter that only ArduPlane has. Its Q_MAV_TYPE makes a quadplane call itself a quadrotor."""

_LEAST_PULSE = "MOT_PWM_MIN"
_OUTPUTS = tuple(f"SERVO{number}_FUNCTION" for number in range(1, 17))
_MOTORS = frozenset((*range(33, 41), *range(82, 86)))
"""The functions of the outputs that are motors 1 to 12 (SRV_Channel.h)."""
_USUAL_MOTORS = MotorChannels(frozenset(range(4)), 1000.0)
"""Motor channels by default, until the parameters have come: a daemon that starts in flight needs them at once."""

_SLOW_CLIMB_M = 1.5
"""Metres that it climbs by itself where a slower climb is wanted. Lower, the error of its height could leave it
standing.
"""
_NEAR_HOME_M = 1.0
"""Metres by which its estimate of height may wander around home; see `_above_home_m`."""
ACCELERATION_SHARE = 0.6
"""The part of ArduPilot's own acceleration limits that our references may use. ArduPilot follows references within the
same limits: with no reserve to catch up it overshoots, by 1.7 m where it is stopped on the way. At the goal of an
18.7 m diagonal a part of 0.6 overshoots by 0.13 m, as 0.5 does (benchmarks/tracker.md)."""

LONGEST_LEAD_S = 0.7
"""The velocity leads by no more than this, even where the jerk limit is low for the acceleration limit. When setpoints
end, the UAV is faster by the acceleration times this."""


_PILOTS_MODES = frozenset(
    {
        "STABILIZE",
        "ACRO",
        "ALT_HOLD",
        "LOITER",
        "DRIFT",
        "SPORT",
        "FLIP",
        "AUTOTUNE",
        "POSHOLD",
        "THROW",
        "FLOWHOLD",
        "ZIGZAG",
        "SYSTEMID",
        "TURTLE",
    }
)
_KEEPING_HEIGHT = frozenset({"ALT_HOLD", "LOITER", "POSHOLD", "FLOWHOLD", "ZIGZAG"})
"""Pilot's modes in which it bounds the descent (PILOT_SPEED_DN)."""
_ON_ARMING = {
    **dict.fromkeys((*_PILOTS_MODES, "GUIDED", "GUIDED_NOGPS"), OnArming.STANDS),
    **dict.fromkeys(
        (
            "LAND",  # its mode after we have landed it
            "BRAKE",  # its mode after the daemon has ended in flight
            "AUTOROTATE",
            "AUTOTUNE",
            "AUTO_RTL",
            "AVOID_ADSB",
            "CIRCLE",
            "FLIP",
            "FOLLOW",
            "RTL",
            "SMART_RTL",
            "SYSTEMID",
        ),
        OnArming.REFUSES,
    ),
    "AUTO": OnArming.MAY_FLY,  # its mode after a mission; by AUTO_OPTIONS it refuses, waits for its throttle, or flies
    "THROW": OnArming.MAY_FLY,  # once it falls
}
"""By `allows_arming` in its mode.h. In another one, of its scripts or of a later version, it may fly."""
_AUTONOMOUS = frozenset({"AUTO", "AUTO_RTL", "BRAKE", "CIRCLE", "FOLLOW", "RTL", "SMART_RTL"})
_FAILSAFE_TEXTS = (
    ("battery failsafe", Cause.BATTERY),
    ("radio failsafe", Cause.RC),
    ("fence breached", Cause.FENCE),
    ("fences breached", Cause.FENCE),  # "Max Alt, Circle fences breached"
    ("gcs failsafe", Cause.GROUND_STATION_LOST),
    ("ekf failsafe", Cause.POSITION),
    ("failsafe", Cause.FAILSAFE),
)
"""Parts of its texts, in lower case; the first that fits counts. "Battery 1 is low" comes without an action, too."""
_ENDS: Mapping[str, tuple[str, ...]] = {
    "Glitch cleared": ("GPS Glitch",),
    "EKF Failsafe Cleared": ("EKF Failsafe", "EKF variance"),
    "Dead Reckoning stopped": ("Dead Reckoning",),
    "Vibration compensation OFF": ("Vibration compensation ON",),
}
"""Texts that say that something is over, as severe as those that said that it began, and how those begin."""
_MOTOR_STOP, _INTERLOCK = "MotorEStop", "MotorInterlock"
"""The names of the switches that stop the motors at once (an RCn_OPTION of 31 or 32): high, and low."""
_SENSORS = (
    (Sensor.BATTERY, Cause.BATTERY),
    (Sensor.RC_RECEIVER, Cause.RC),
    (Sensor.GEOFENCE, Cause.FENCE),
)


class _Name(NamedTuple):
    """A name of a parameter, and how many of its units make one of ours."""

    name: str
    per_unit: float = 1.0


# From 4.7 on in m, s and degrees, before in cm and hundredths of degrees; the jerks always in m/s^3.
_SPEED = (_Name("WP_SPD"), _Name("WPNAV_SPEED", 100.0))
_CLIMB_SPEED = (_Name("WP_SPD_UP"), _Name("WPNAV_SPEED_UP", 100.0))
_DESCENT_SPEED = (_Name("WP_SPD_DN"), _Name("WPNAV_SPEED_DN", 100.0))
_ACCELERATION = (_Name("WP_ACC"), _Name("WPNAV_ACCEL", 100.0))
_VERTICAL_ACCELERATION = (_Name("WP_ACC_Z"), _Name("WPNAV_ACCEL_Z", 100.0))
_YAW_RATE_DEG_S = (_Name("ATC_RATE_WPY_MAX"), _Name("ATC_SLEW_YAW", 100.0))
_JERK = (_Name("PSC_NE_JERK"), _Name("PSC_JERK_NE"), _Name("PSC_JERK_XY"))
"""From 4.7.1 on; in 4.7.0; before."""
_VERTICAL_JERK = (_Name("PSC_D_JERK"), _Name("PSC_JERK_D"), _Name("PSC_JERK_Z"))
_RENAMED = (
    _SPEED,
    _CLIMB_SPEED,
    _DESCENT_SPEED,
    _ACCELERATION,
    _VERTICAL_ACCELERATION,
    _YAW_RATE_DEG_S,
    _JERK,
    _VERTICAL_JERK,
)
_CAREFUL = Limits(
    horizontal_speed_m_s=1.6,
    climb_speed_m_s=1.2,
    descent_speed_m_s=1.2,
    horizontal_acceleration_m_s2=1.0 * ACCELERATION_SHARE,
    vertical_acceleration_m_s2=0.5 * ACCELERATION_SHARE,
    yaw_rate_rad_s=math.radians(32.5),
)
"""No higher than what any version, or any frame in its Tools/Frame_params and hwdef, ships: WPNAV_SPEED 300,
WPNAV_SPEED_UP 250, WPNAV_SPEED_DN 150, WPNAV_ACCEL 100, WPNAV_ACCEL_Z 50 (3DR Iris+), ATC_SLEW_YAW 3250 (SkyViper)."""


class ArduCopter(Autopilot):
    """ArduPilot multirotors, 4.6 and 4.7."""

    name = "ArduPilot"
    gripper = ArduPilotGripper(name)
    gimbal = ArduPilotGimbal()
    capabilities = frozenset(Capability)
    sends_landed_state = True
    setpoint_mode, hold_mode, land_mode = "GUIDED", "BRAKE", "LAND"
    # BRAKE: LOITER would hold, too, but follows the throttle stick: with it at its bottom, or without a transmitter,
    # the UAV would descend.
    arming_mode = setpoint_mode  # as the take-off that follows needs it; there the throttle stick does not matter
    on_arming, on_arming_elsewhere = _ON_ARMING, OnArming.MAY_FLY
    pilots_modes = _PILOTS_MODES
    stays_without_setpoints = True  # in GUIDED it hovers for ever
    flies_takeoff_on_setpoints = False  # a setpoint on the way up cancels the take-off, silently
    # Without the acceleration: when setpoints end (a killed daemon), ArduPilot continues with the last one, and would
    # gain speed for GUID_TIMEOUT; with the last velocity it only keeps its speed.
    takes_acceleration = False
    parameter_names = tuple(tuple(each.name for each in names) for names in _RENAMED)
    parameters = (
        *(each.name for names in _RENAMED for each in names),
        _SIMULATION_PARAMETER,
        _PLANE_PARAMETER,
        "FENCE_ENABLE",
        "FENCE_AUTOENABLE",
        "FENCE_TYPE",
        "FENCE_RADIUS",
        "FENCE_ALT_MAX",
        "FENCE_ALT_MIN",
        "FENCE_TOTAL",
        "FENCE_OPTIONS",
        _LEAST_PULSE,
        *_OUTPUTS,
    )
    optional_parameters = frozenset(
        {_SIMULATION_PARAMETER, _PLANE_PARAMETER, "FENCE_AUTOENABLE", "FENCE_OPTIONS", _LEAST_PULSE, *_OUTPUTS}
    )
    failsafe_parameters = frozenset(
        {
            "BATT_FS_CRT_ACT",
            "BATT_FS_LOW_ACT",
            "DISARM_DELAY",
            "FENCE_ACTION",
            "FENCE_MARGIN",
            "FS_CRASH_CHECK",
            "FS_DR_ENABLE",
            "FS_EKF_ACTION",
            "FS_EKF_THRESH",
            "FS_GCS_ENABLE",
            "FS_GCS_TIMEOUT",
            "FS_OPTIONS",
            "FS_THR_ENABLE",
            "FS_THR_VALUE",
            "FS_VIBE_ENABLE",
            "GUID_OPTIONS",
            "GUID_TIMEOUT",
            "MAV_GCS_SYSID",
            "MAV_SYSID",
            "RTL_ALT",
            "RTL_ALT_M",  # from 4.7 on
            "SYSID_MYGCS",
            "SYSID_THISMAV",
        }
    )
    has_zones = True
    missions = ArduCopterMissions()
    keeps_parts_of = frozenset({MissionType.MISSION, MissionType.RALLY})
    fence_switches = (FenceSwitch("FENCE_TYPE", _FENCE_POLYGON, is_bit=True), FenceSwitch("FENCE_ENABLE", 1))
    drops_positions_beyond_fence = True  # ModeGuided::set_destination_posvelaccel checks each one
    keeps_target_of_a_kind = True  # ModeGuided::pva_control_start begins anew, ModeLand::init does not
    # Two more than the corners and circles, or 0 for fewer than 3 of them (AC_PolyFence_loader::write_fence). It comes
    # after each upload, also where it stays the same (measured with 4.6.3).
    zones_parameter = "FENCE_TOTAL"
    tells_motors = True  # neither HEARTBEAT nor SYS_STATUS has the emergency stop (Copter::motors_output)

    @override
    def mode(self, custom_mode: int) -> Mode:
        return self.mode_named(_MODES.get(custom_mode, f"MODE{custom_mode}"))

    @override
    def names_mode(self, custom_mode: int) -> bool:
        return custom_mode in _MODES

    @override
    def mode_named(self, name: str) -> Mode:
        return Mode(
            name,
            _CONTROL.get(name, Control.OTHER),
            is_autonomous=name in _AUTONOMOUS,
            on_arming=_ON_ARMING.get(name, self.on_arming_elsewhere),
            keeps_height=name in _KEEPING_HEIGHT,
        )

    @override
    def cause_of_text(self, text: str) -> Cause | None:
        lower = text.lower()
        if "cleared" in lower or lower.startswith("prearm"):
            return None
        return next((cause for part, cause in _FAILSAFE_TEXTS if part in lower), None)

    @override
    def ends_of_text(self, text: str) -> tuple[str, ...]:
        return _ENDS.get(text, ())

    @override
    def motor_stop_of_text(self, text: str) -> bool | None:
        if _MOTOR_STOP in text:  # "RC7: MotorEStop HIGH"
            return text.endswith("HIGH")
        return text.endswith("LOW") if _INTERLOCK in text else None

    @override
    def motor_channels(self, parameters: Mapping[str, float]) -> MotorChannels | None:
        if _LEAST_PULSE not in parameters or not any(name in parameters for name in _OUTPUTS):
            return _USUAL_MOTORS
        least_us = parameters[_LEAST_PULSE]
        found = frozenset(index for index, name in enumerate(_OUTPUTS) if parameters.get(name) in _MOTORS)
        return MotorChannels(found, least_us) if found and least_us > 0.0 else None

    @override
    def failsafe_of_sensors(self, failing: int, healthy_once: int) -> Cause | None:
        # It enables a sensor only where it is there: a fence that is set, a receiver that was detected.
        return next((cause for bit, cause in _SENSORS if failing & bit), None)

    @override
    def estimator(self, flags: int) -> Estimator:
        if flags & EstimatorFlag.CONST_POS_MODE:
            return Estimator(False, "it assumes that it stands still (no GPS or other position yet)")
        return super().estimator(flags)

    @override
    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        return FlatProjection(latitude_deg, longitude_deg, altitude_amsl_m)

    @override
    def judge_simulation(
        self, version: AutopilotBoard | None, parameters: Mapping[str, float], system_id: int
    ) -> SimulationVerdict:
        if version is None:
            return SimulationVerdict(None, "its version and board are not known yet")
        if version.board_version or version.vendor_id or version.product_id:  # also where it simulates by itself
            return SimulationVerdict(
                False,
                f"it runs on a flight controller (board {version.board_version >> 16}, "
                f"USB {version.vendor_id:04x}:{version.product_id:04x})",
            )
        if _SIMULATION_PARAMETER not in parameters:
            return SimulationVerdict(None, f"it has not sent {_SIMULATION_PARAMETER}, which only simulators have")
        return SimulationVerdict(True)

    @override
    def is_multirotor(self, vtol_state: int, parameters: Mapping[str, float]) -> bool:
        return vtol_state in _COPTER_VTOL_STATES and _PLANE_PARAMETER not in parameters

    @override
    def limits(self, parameters: Mapping[str, float]) -> Limits:
        careful = _CAREFUL
        return Limits(
            horizontal_speed_m_s=_value(parameters, _SPEED) or careful.horizontal_speed_m_s,
            climb_speed_m_s=_value(parameters, _CLIMB_SPEED) or careful.climb_speed_m_s,
            descent_speed_m_s=_value(parameters, _DESCENT_SPEED) or careful.descent_speed_m_s,
            horizontal_acceleration_m_s2=ACCELERATION_SHARE * _value(parameters, _ACCELERATION)
            or careful.horizontal_acceleration_m_s2,
            vertical_acceleration_m_s2=ACCELERATION_SHARE * _value(parameters, _VERTICAL_ACCELERATION)
            or careful.vertical_acceleration_m_s2,
            yaw_rate_rad_s=math.radians(_value(parameters, _YAW_RATE_DEG_S)) or careful.yaw_rate_rad_s,
        )

    @override
    def velocity_responses(self, parameters: Mapping[str, float]) -> VelocityResponses:
        return VelocityResponses(
            _response(_value(parameters, _ACCELERATION), _value(parameters, _JERK)),
            _response(_value(parameters, _VERTICAL_ACCELERATION), _value(parameters, _VERTICAL_JERK)),
        )

    @override
    def acceleration_share(self, parameters: Mapping[str, float]) -> float:
        return ACCELERATION_SHARE if _value(parameters, _ACCELERATION) else 1.0

    @override
    def autopilot_fence(
        self, parameters: Mapping[str, float], *, is_enabled: bool, found: FoundZones = UNREAD
    ) -> AutopilotFence:
        if not (is_enabled or parameters.get("FENCE_ENABLE") or parameters.get("FENCE_AUTOENABLE")):
            return NO_FENCE
        kinds = int(parameters.get("FENCE_TYPE", 0.0))
        has_zones = bool(kinds & _FENCE_POLYGON)
        unread = _unread(int(parameters.get("FENCE_TOTAL", 0.0)), found) if has_zones else ""
        not_sent = [] if "FENCE_TYPE" in parameters else ["FENCE_TYPE"]
        not_sent += [name for kind, name in _FENCE_LIMITS if kinds & kind and name not in parameters]
        return AutopilotFence(
            fence_limit(parameters, "FENCE_RADIUS") if kinds & _FENCE_CIRCLE else None,
            fence_limit(parameters, "FENCE_ALT_MAX") if kinds & _FENCE_ALT_MAX else None,
            fence_limit(parameters, "FENCE_ALT_MIN", least=-math.inf) if kinds & _FENCE_ALT_MIN else None,
            "; ".join(filter(None, [unread, f"{', '.join(not_sent)}, which it has not sent" if not_sent else ""])),
            is_cut_by_unread=bool(unread),
            zones=(found.zones or ()) if has_zones else (),
            unites_inclusions=self.unites_inclusions(parameters),
        )

    @override
    def unites_inclusions(self, parameters: Mapping[str, float]) -> bool:
        return bool(int(parameters.get("FENCE_OPTIONS", 0.0)) & _FENCE_UNION)

    @override
    def position_setpoint(self, setpoint: PositionSetpoint, parameters: Mapping[str, float]) -> PositionSetpoint:
        return replace(setpoint, velocity=velocity_lead(setpoint, parameters))

    @override
    def takeoff_altitude_m(self, height_m: float, snapshot: Snapshot, *, is_slower: bool = False) -> float:
        # The height must be above home. Home is where it was armed, by an estimate of height that has wandered since.
        standing_m = _above_home_m(snapshot)
        if standing_m is None:
            raise HomeUnknownError("take_off: ArduPilot has not sent the position of its home yet")
        if snapshot.condition.has_rangefinder and standing_m > _NEAR_HOME_M:
            raise WrongStateError(
                f"take_off: ArduPilot's home is {standing_m:.1f} m below the UAV, and with its rangefinder it counts "
                f"the height from the ground: it would climb to {standing_m + height_m:.1f} m instead of {height_m:g} "
                "m; set its home to where it stands"
            )
        # Its climb takes no speed (WPNAV_SPEED_UP). UAL's setpoints fly the rest of the way, within the limits.
        return standing_m + (min(height_m, _SLOW_CLIMB_M) if is_slower else height_m)


def _unread(total: int, found: FoundZones) -> str:
    """Returns, human-readable, what of its polygons and circles is not known, by its FENCE_TOTAL."""
    if found.why:
        return f"its polygons and circles: {found.why}"
    return f"its polygons and circles (FENCE_TOTAL {total})" if found.zones is None and total else ""


def _above_home_m(snapshot: Snapshot) -> float | None:
    """Returns its height above home; None where that is not known well enough to climb by it.

    On a bad link ArduPilot's own value comes sooner than the positions of home and origin do. But it may be from before
    the arming, which moved home to where it stands. So it counts only where it makes little difference, which is
    corrected at the end of the climb. Otherwise a climb from a home down in the valley would go that much too high.
    """
    pose, origin, home_m = snapshot.motion.pose, snapshot.earth.projection, snapshot.earth.home_altitude_amsl_m
    if pose is not None and origin is not None and home_m is not None:
        return origin.altitude_amsl_m + pose.value.position.z - home_m
    own_m = None if snapshot.motion.position_geo is None else snapshot.motion.position_geo.altitude_home_m
    return None if own_m is None or abs(own_m) > _NEAR_HOME_M else own_m


def velocity_lead(setpoint: PositionSetpoint, parameters: Mapping[str, float]) -> Vector3:
    """Returns the velocity that makes ArduPilot accelerate as the reference does, in m/s: v + a * tau.

    Its input shaping (AP_Math/control.cpp, `shape_vel_accel`) accelerates by a_in + (v_in - v) * jerk / accel, with
    its own limits of both. So a velocity that is higher by a * accel / jerk has the same effect as a_in = a, until
    setpoints end. That time, and the time that the vehicle takes to tilt, is tau. The result is never faster than
    ArduPilot's own speed limits, unless the reference is; it is the reference's velocity while the limits are not
    known.
    """
    v, a = setpoint.velocity, setpoint.acceleration
    horizontal_s = _shaping_s(_value(parameters, _ACCELERATION), _value(parameters, _JERK))
    vertical_s = _shaping_s(_value(parameters, _VERTICAL_ACCELERATION), _value(parameters, _VERTICAL_JERK))
    led = Vector3(v.x + a.x * horizontal_s, v.y + a.y * horizontal_s, v.z + a.z * vertical_s)
    speed_m_s = max(v.horizontal_norm(), _value(parameters, _SPEED))
    share = min(1.0, speed_m_s / max(led.horizontal_norm(), 1e-9))
    up_m_s = max(v.z, _value(parameters, _CLIMB_SPEED))
    down_m_s = min(v.z, -_value(parameters, _DESCENT_SPEED))
    return Vector3(led.x * share, led.y * share, min(max(led.z, down_m_s), up_m_s))


def _response(acceleration_m_s2: float, jerk_m_s3: float) -> VelocityResponse:
    """Returns how its input shaping follows a velocity along an axis; see `velocity_lead`."""
    if acceleration_m_s2 <= 0.0 or jerk_m_s3 <= 0.0:
        return VelocityResponse(holds_place=True)
    return VelocityResponse(acceleration_m_s2 / jerk_m_s3, acceleration_m_s2, jerk_m_s3, holds_place=True)


def _shaping_s(acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """Returns its acceleration limit over its jerk limit and the time to tilt, in s; 0 where they are not known."""
    if acceleration_m_s2 <= 0.0 or jerk_m_s3 <= 0.0:
        return 0.0
    return min(acceleration_m_s2 / jerk_m_s3 + TILT_S, LONGEST_LEAD_S)


def _value(parameters: Mapping[str, float], names: tuple[_Name, ...]) -> float:
    """Returns the value of a parameter in our units, by whichever name it came; 0 where it did not, or sets none."""
    return next((max(0.0, parameters[name]) / per_unit for name, per_unit in names if name in parameters), 0.0)
