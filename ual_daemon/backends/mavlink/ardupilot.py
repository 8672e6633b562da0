"""ArduCopter: flown in GUIDED mode with setpoints in its local NED frame. Measured on 4.6.3
(docs/backends/mavlink.md).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from ual.errors import WrongStateError
from ual.types import Capability, Limits
from ual_daemon.backends.mavlink.commands import Command, arm_or_disarm, set_interval
from ual_daemon.backends.mavlink.dialect import Dialect, version_text
from ual_daemon.backends.mavlink.messages import Message, mavlink
from ual_daemon.backends.mavlink.targets import local_target
from ual_daemon.backends.values import Control, Estimator, Freshness, Mode, Setpoint, Snapshot
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
_GUIDED, _LOITER, _LAND, _BRAKE = 4, 5, 9, 17
_CONTROL = {_GUIDED: Control.REFERENCES, _LAND: Control.LAND}

MULTIROTORS = frozenset(
    {
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
        mavlink.MAV_TYPE_DODECAROTOR,
    }
)
"""The vehicles (MAV_TYPE) that this dialect flies. ArduPilot's others have the same numbers for other modes."""

_SIMULATION_PARAMETER = "SIM_SPEEDUP"
"""A parameter that only a simulator has; nothing else that it says tells one from a vehicle."""

ACCELERATION_SHARE = 0.6
"""How much of ArduPilot's own acceleration limits our references may ask for. It follows them within the same limits:
with nothing left to catch up by it overshoots, by 0.7 m at a goal and by 1.5 m where it is stopped on the way."""


class ArduCopter(Dialect):
    """ArduPilot multirotors, 4.6."""

    name = "ArduPilot"
    capabilities = frozenset(Capability)
    tells_landed_state = True
    # What is asked for below comes at 5 Hz and more. Its own heartbeat, until it is asked, at 1 Hz.
    freshness = Freshness(link_s=1.2, pose_s=1.0, mode_s=2.5, landed_s=1.0, estimator_s=1.5)
    flies_takeoff_on_setpoints = False  # a setpoint on the way up cancels the take-off, silently
    estimator_message = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
    wanted_messages = (mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,)
    parameters = (
        "WPNAV_SPEED",
        "WPNAV_SPEED_UP",
        "WPNAV_SPEED_DN",
        "WPNAV_ACCEL",
        "WPNAV_ACCEL_Z",
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
            set_interval(mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 5.0),
            set_interval(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, pose_rate_hz),
            set_interval(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, pose_rate_hz),
            set_interval(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
            set_interval(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 2.0),
            set_interval(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 2.0),
            # Pushed when it arms as well, but not to a link on which nobody asked for anything yet.
            set_interval(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, 1.0),
            set_interval(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1.0),
        ]

    def version(self, message: Message) -> str:
        return version_text(message.flight_sw_version)

    def is_simulation(self, version: Message | None, parameters: Mapping[str, float], system_id: int) -> bool:
        return _SIMULATION_PARAMETER in parameters

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

    def setpoint(self, setpoint: Setpoint, system_id: int, time_ms: int) -> Message:
        # Without the acceleration: when setpoints end (a killed daemon), ArduPilot goes on with the last one, and would
        # gain speed for GUID_TIMEOUT; the last velocity only keeps it.
        return local_target(setpoint, system_id, time_ms, with_acceleration=False)

    def arm(self, *, is_arming: bool) -> Command:
        return arm_or_disarm(is_arming=is_arming)

    def take_off(self, height_m: float, snapshot: Snapshot) -> Command:
        pose, origin, home_m = snapshot.pose, snapshot.projection, snapshot.home_altitude_amsl_m
        if pose is None or origin is None or home_m is None:
            raise WrongStateError("take_off: ArduPilot has not told where its home and its origin are")
        # It wants a height above home. Home is where it was armed, by an estimate of height that wanders since.
        above_home_m = origin.altitude_amsl_m + pose.value.position.z - home_m + height_m
        climb = Command(mavlink.MAV_CMD_NAV_TAKEOFF, (0.0,) * 6 + (above_home_m,), "take off", group="mode")
        return replace(_set_mode(_GUIDED, "take off"), then=climb)

    def land(self) -> Command:
        return Command(mavlink.MAV_CMD_NAV_LAND, (), "land", group="mode")

    def take_control(self) -> Command:
        return _set_mode(_GUIDED, "take control")

    def hold(self) -> Command:
        # LOITER would hold as well, but by the throttle stick: at its bottom, or without a transmitter, it descends.
        return _set_mode(_BRAKE, "hold")

    def after_flight(self, control: Control) -> Command | None:
        # In LAND nobody can arm it.
        return _set_mode(_LOITER, "leave LAND") if control is Control.LAND else None


def _set_mode(number: int, what: str) -> Command:
    params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), float(number))
    return Command(mavlink.MAV_CMD_DO_SET_MODE, params, what, group="mode")
