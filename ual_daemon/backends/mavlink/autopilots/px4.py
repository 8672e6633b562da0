"""PX4: flown in OFFBOARD mode with setpoints in its local NED frame. Measured on 1.17 (docs/backends/mavlink.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from ual.types import Capability, Limits
from ual_daemon.backends.mavlink.autopilots import px4_events
from ual_daemon.backends.mavlink.autopilots.dialect import NO_PARAMETERS, Dialect, Reality, version_text
from ual_daemon.backends.mavlink.autopilots.px4_events import Event
from ual_daemon.backends.mavlink.autopilots.setpoint_encoding import local_target
from ual_daemon.backends.mavlink.session.commands import Command, arm_or_disarm, set_interval, shows_mode
from ual_daemon.backends.mavlink.wire.frames import Frame
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import Control, Mode, Setpoint, Snapshot
from ual_daemon.geodesy import Projection, SphereProjection

_MAIN = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    4: "AUTO",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    10: "TERMINATION",
    11: "ALTITUDE_CRUISE",
}
_SUB_POSCTL = {1: "ORBIT", 2: "SLOW"}
_SUB_AUTO = {
    1: "READY",
    2: "TAKEOFF",
    3: "LOITER",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    8: "FOLLOW_TARGET",
    9: "PRECLAND",
    10: "VTOL_TAKEOFF",
} | {10 + number: f"EXTERNAL{number}" for number in range(1, 9)}
_SUB = {"POSCTL": _SUB_POSCTL, "AUTO": _SUB_AUTO}
_CONTROL = {
    "OFFBOARD": Control.REFERENCES,
    "AUTO.TAKEOFF": Control.TAKE_OFF,
    "AUTO.VTOL_TAKEOFF": Control.TAKE_OFF,
    "AUTO.LAND": Control.LAND,
    "AUTO.PRECLAND": Control.LAND,
}
_AUTO, _OFFBOARD, _SUB_LOITER = 4, 6, 3
_UNARMABLE = frozenset(
    {
        "OFFBOARD",  # without a stream of setpoints; where it goes by itself after a landing of ours
        "AUTO.RTL",
        "AUTO.LAND",
        "AUTO.PRECLAND",
        "AUTO.FOLLOW_TARGET",
        "POSCTL.ORBIT",
    }
)
"""Modes in which PX4 refuses to be armed (its mode_requirements.cpp: mode_req_prevent_arming, offboard signal)."""

OFFBOARD_NEEDS_SETPOINTS_S = 0.4
"""How long setpoints must have come before PX4 takes OFFBOARD: without a stream it refuses the mode, or the arming."""

_SIMULATION_UID = int.from_bytes(b"ONIDLATI", "little")
"""What PX4's simulator gives as the first vehicle's unique id (its board says ``SIMULATIONID0000``); the ids of the
next ones are higher by their system id."""

ACCELERATION_SHARE = 0.6
"""How much of PX4's own acceleration limits our references may ask for: with all of them it overshoots by more than
0.4 m, whatever it is told ahead (benchmarks/tracker.md)."""


class Px4(Dialect):
    """PX4 multirotors, from 1.13."""

    name = "PX4"
    capabilities = frozenset(Capability)
    tells_landed_state = True
    takes_feed_forward = True
    unarmable_modes = _UNARMABLE
    # On each change, but else only twice a second, however often it was asked for (20 Hz); unasked every two seconds.
    sparse_messages = frozenset({mavlink.MAVLINK_MSG_ID_CURRENT_MODE})
    wanted_messages = (
        mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
    )
    changing_messages = frozenset({mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN})
    parameters = (
        "MPC_XY_VEL_MAX",
        "MPC_Z_VEL_MAX_UP",
        "MPC_Z_VEL_MAX_DN",
        "MPC_ACC_HOR",
        "MPC_ACC_UP_MAX",
        "MPC_ACC_DOWN_MAX",
        "MPC_YAWRAUTO_MAX",
    )

    def mode(self, custom_mode: int) -> Mode:
        main_number, sub_number = custom_mode >> 16 & 0xFF, custom_mode >> 24
        name = _MAIN.get(main_number, f"MODE{main_number}")
        if sub_number:
            name = f"{name}.{_SUB.get(name, {}).get(sub_number, sub_number)}"
        return Mode(name, _CONTROL.get(name, Control.OTHER))

    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        return SphereProjection(latitude_deg, longitude_deg, altitude_amsl_m)

    def streams(self, pose_rate_hz: float) -> list[Command]:
        return [
            set_interval(mavlink.MAVLINK_MSG_ID_CURRENT_MODE, 20.0),
            set_interval(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 20.0),
            set_interval(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 10.0),
            set_interval(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, pose_rate_hz),
            set_interval(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, pose_rate_hz),
        ]

    def version(self, message: Message) -> str:
        return version_text(message.flight_sw_version)

    def reality(self, version: Message | None, parameters: Mapping[str, float], system_id: int) -> Reality:
        if version is None:
            return Reality(None, "it has not told its version and its id")
        if version.uid != _SIMULATION_UID + system_id - 1:
            return Reality(False, f"its unique id is {version.uid:#018x}, a flight controller's")
        return Reality(True)

    def event(self, frame: Frame, mode: str) -> Event:
        return px4_events.read(frame, mode)

    def limits(self, parameters: Mapping[str, float]) -> Limits:
        default = Limits()

        def read(name: str, otherwise: float, share: float = 1.0) -> float:
            value = parameters.get(name, 0.0)
            return value * share if value > 0.0 else otherwise

        accelerations = [parameters[name] for name in ("MPC_ACC_UP_MAX", "MPC_ACC_DOWN_MAX") if name in parameters]
        return Limits(
            horizontal_speed_m_s=read("MPC_XY_VEL_MAX", default.horizontal_speed_m_s),
            climb_speed_m_s=read("MPC_Z_VEL_MAX_UP", default.climb_speed_m_s),
            descent_speed_m_s=read("MPC_Z_VEL_MAX_DN", default.descent_speed_m_s),
            horizontal_acceleration_m_s2=read("MPC_ACC_HOR", default.horizontal_acceleration_m_s2, ACCELERATION_SHARE),
            vertical_acceleration_m_s2=min(
                (value * ACCELERATION_SHARE for value in accelerations if value > 0.0),
                default=default.vertical_acceleration_m_s2,
            ),
            yaw_rate_rad_s=math.radians(read("MPC_YAWRAUTO_MAX", math.degrees(default.yaw_rate_rad_s))),
        )

    def setpoint(
        self, setpoint: Setpoint, system_id: int, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        return local_target(setpoint, system_id, time_ms)

    def arm(self, snapshot: Snapshot) -> Command:
        # It reports what its checks found when that changes; after a refusal it is asked to report it again.
        arm = replace(arm_or_disarm(is_arming=True), explain=Command(mavlink.MAV_CMD_RUN_PREARM_CHECKS, (), "check"))
        mode = "" if snapshot.mode is None else snapshot.mode.value.name
        if self.can_be_armed_in(mode):
            return arm
        return replace(self._set_mode(_AUTO, _SUB_LOITER, f"leave {mode}, to be armed"), then=arm)

    def disarm(self) -> Command:
        return arm_or_disarm(is_arming=False)

    def take_off(self, height_m: float, snapshot: Snapshot) -> Command:
        return self._set_mode(_OFFBOARD, 0, "take off", needs_setpoints_s=OFFBOARD_NEEDS_SETPOINTS_S)

    def land(self) -> Command:
        # Answered once, unlike DO_SET_MODE, and never refused: without a position PX4 descends where it is.
        params = (0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
        return Command(mavlink.MAV_CMD_NAV_LAND, params, "land", group="mode", shows=shows_mode("AUTO.LAND"))

    def take_control(self) -> Command:
        return self._set_mode(_OFFBOARD, 0, "take control", needs_setpoints_s=OFFBOARD_NEEDS_SETPOINTS_S)

    def hold(self) -> Command:
        return self._set_mode(_AUTO, _SUB_LOITER, "hold")

    def _set_mode(self, main: int, sub: int, what: str, *, needs_setpoints_s: float = 0.0) -> Command:
        params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), float(main), float(sub))
        # The first answer only says that the message was read; the second is the commander's.
        return Command(
            mavlink.MAV_CMD_DO_SET_MODE,
            params,
            what,
            group="mode",
            acks_count=2,
            needs_setpoints_s=needs_setpoints_s,
            shows=shows_mode(self.mode(main << 16 | sub << 24).name),
        )
