"""PX4: flown in OFFBOARD mode with setpoints in its local NED frame. Measured with 1.17 (docs/backends/mavlink.md)."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import replace

from typing_extensions import override

from ual.types import Capability, Limits
from ual_daemon.backends.mavlink.autopilots import px4_events
from ual_daemon.backends.mavlink.autopilots.command_long import (
    CommandLong,
    arm_or_disarm,
    pose_streams,
    set_message_interval,
    set_mode,
    shows_mode,
)
from ual_daemon.backends.mavlink.autopilots.dialect import (
    NO_PARAMETERS,
    Dialect,
    Event,
    SimulationVerdict,
    fence_limit,
    positive_parameter,
)
from ual_daemon.backends.mavlink.autopilots.external_pose import encode_odometry
from ual_daemon.backends.mavlink.autopilots.position_target import encode_position_target
from ual_daemon.backends.mavlink.wire.frames import Frame
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import NO_FENCE, Cause, Control, ExternalPose, Mode, OwnFence, Setpoint, Snapshot
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
_AUTONOMOUS = frozenset({"AUTO.LOITER", "AUTO.MISSION", "AUTO.RTL", "AUTO.FOLLOW_TARGET", "POSCTL.ORBIT"})
_AUTO, _OFFBOARD, _SUB_LOITER = 4, 6, 3
_UNARMABLE = frozenset(
    {
        "OFFBOARD",  # without a stream of setpoints; PX4 enters it by itself after we have landed it
        "AUTO.RTL",
        "AUTO.LAND",
        "AUTO.PRECLAND",
        "AUTO.FOLLOW_TARGET",
        "POSCTL.ORBIT",
    }
)
"""Modes in which PX4 refuses to be armed (its mode_requirements.cpp: mode_req_prevent_arming, offboard signal)."""

OFFBOARD_NEEDS_SETPOINTS_S = 0.4
"""How long setpoints must have come before PX4 accepts OFFBOARD: without them it refuses the mode, or the arming."""

_SHORTEST_LOSS_S = 0.2
"""A COM_OF_LOSS_T below this is not followed: each jitter of the link would be a lost link."""
_SIMULATION_UID = int.from_bytes(b"ONIDLATI", "little")
"""The unique id of the first vehicle of PX4's simulator (its board says ``SIMULATIONID0000``). The ids of the next ones
are higher by their system id."""

ACCELERATION_SHARE = 0.6
"""The part of PX4's own acceleration limits that our references may use: with all of it PX4 overshoots by more than
0.4 m, whatever the feed-forward (benchmarks/tracker.md)."""


class Px4(Dialect):
    """PX4 multirotors, from 1.13."""

    name = "PX4"
    capabilities = frozenset(Capability)
    sends_landed_state = True
    takes_feed_forward = True
    unarmable_modes = _UNARMABLE
    pilots_modes = frozenset({"MANUAL", "ALTCTL", "POSCTL", "ACRO", "STABILIZED", "POSCTL.SLOW", "ALTITUDE_CRUISE"})
    names_intended_mode = True
    # Sent on each change and else twice a second, whatever rate was requested (20 Hz); without a request every 2 s.
    sparse_messages = frozenset({mavlink.MAVLINK_MSG_ID_CURRENT_MODE})
    optional_messages = frozenset({mavlink.MAVLINK_MSG_ID_RC_CHANNELS})  # without a transmitter there are none
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
        "MPC_XY_CRUISE",
        "COM_OF_LOSS_T",
        "GF_ACTION",
        "GF_MAX_HOR_DIST",
        "GF_MAX_VER_DIST",
    )

    @override
    def mode(self, custom_mode: int) -> Mode:
        main_number, sub_number = custom_mode >> 16 & 0xFF, custom_mode >> 24
        name = _MAIN.get(main_number, f"MODE{main_number}")
        if sub_number:
            name = f"{name}.{_SUB.get(name, {}).get(sub_number, sub_number)}"
        return Mode(name, _CONTROL.get(name, Control.OTHER), is_autonomous=name in _AUTONOMOUS)

    @override
    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        return SphereProjection(latitude_deg, longitude_deg, altitude_amsl_m)

    @override
    def streams(self, pose_rate_hz: float) -> list[CommandLong]:
        return [
            set_message_interval(mavlink.MAVLINK_MSG_ID_CURRENT_MODE, 20.0),
            set_message_interval(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 20.0),
            set_message_interval(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 10.0),
            *pose_streams(pose_rate_hz),
            set_message_interval(mavlink.MAVLINK_MSG_ID_RC_CHANNELS, 5.0),
        ]

    @override
    def parameter_value(self, message: Message) -> float | None:
        if message.param_type != mavlink.MAV_PARAM_TYPE_INT32:
            return super().parameter_value(message)
        # The bytes of an integer stand in the place of the number.
        (value,) = struct.unpack("<i", struct.pack("<f", message.param_value))
        return float(value)

    @override
    def judge_simulation(
        self, version: Message | None, parameters: Mapping[str, float], system_id: int
    ) -> SimulationVerdict:
        if version is None:
            return SimulationVerdict(None, "its version and unique id are not known yet")
        if version.uid != _SIMULATION_UID + system_id - 1:
            return SimulationVerdict(False, f"its unique id is {version.uid:#018x}, a flight controller's")
        return SimulationVerdict(True)

    @override
    def event(self, frame: Frame, mode: str) -> Event:
        return px4_events.read(frame, mode)

    @override
    def is_multirotor(self, vtol_state: int, parameters: Mapping[str, float]) -> bool:
        return vtol_state == int(mavlink.MAV_VTOL_STATE_UNDEFINED)

    @override
    def failsafe_of_sensors(self, failing: int, healthy_once: int) -> Cause | None:
        # Its battery counts as unhealthy from the first warning on, and its fence never. A transmitter that was never
        # heard is none that was lost: PX4 flies without one.
        is_lost = failing & healthy_once & mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
        return Cause.RC if is_lost else None

    @override
    def limits(self, parameters: Mapping[str, float]) -> Limits:
        default, share = Limits(), ACCELERATION_SHARE
        accelerations = [parameters[name] for name in ("MPC_ACC_UP_MAX", "MPC_ACC_DOWN_MAX") if name in parameters]
        yaw_rate_deg_s = positive_parameter(parameters, "MPC_YAWRAUTO_MAX", math.degrees(default.yaw_rate_rad_s))
        return Limits(
            horizontal_speed_m_s=positive_parameter(parameters, "MPC_XY_VEL_MAX", default.horizontal_speed_m_s),
            climb_speed_m_s=positive_parameter(parameters, "MPC_Z_VEL_MAX_UP", default.climb_speed_m_s),
            descent_speed_m_s=positive_parameter(parameters, "MPC_Z_VEL_MAX_DN", default.descent_speed_m_s),
            horizontal_acceleration_m_s2=positive_parameter(
                parameters, "MPC_ACC_HOR", default.horizontal_acceleration_m_s2, share=share
            ),
            vertical_acceleration_m_s2=min(
                (value * share for value in accelerations if value > 0.0), default=default.vertical_acceleration_m_s2
            ),
            yaw_rate_rad_s=math.radians(yaw_rate_deg_s),
        )

    @override
    def acceleration_share(self, parameters: Mapping[str, float]) -> float:
        return ACCELERATION_SHARE if "MPC_ACC_HOR" in parameters else 1.0

    @override
    def cruise_speed_m_s(self, parameters: Mapping[str, float]) -> float:
        return positive_parameter(parameters, "MPC_XY_CRUISE", math.inf)

    @override
    def setpoints_lost_s(self, parameters: Mapping[str, float]) -> float:
        return max(_SHORTEST_LOSS_S, parameters.get("COM_OF_LOSS_T", math.inf))

    @override
    def own_fence(self, parameters: Mapping[str, float], *, is_enabled: bool) -> OwnFence:
        if not parameters.get("GF_ACTION"):
            return NO_FENCE
        return OwnFence(
            fence_limit(parameters, "GF_MAX_HOR_DIST"),
            fence_limit(parameters, "GF_MAX_VER_DIST"),
            unread="a fence of polygons, if it has one",
        )

    @override
    def encode_setpoint(
        self, setpoint: Setpoint, system_id: int, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        return encode_position_target(setpoint, system_id, time_ms)

    @override
    def encode_external_pose(self, measured: ExternalPose) -> Message:
        return encode_odometry(measured)

    @override
    def arm(self, snapshot: Snapshot) -> CommandLong:
        # PX4 reports the results of its checks when they change; after a refusal it is asked to report them again.
        check = CommandLong(mavlink.MAV_CMD_RUN_PREARM_CHECKS, (), "check")
        arm = replace(arm_or_disarm(is_arming=True), explain=check)
        return self._arm_leaving(snapshot, arm, self.hold())

    @override
    def take_off(self, height_m: float, snapshot: Snapshot, *, is_slower: bool = False) -> CommandLong:
        return self._enter_offboard("take off")

    @override
    def land(self) -> CommandLong:
        # Acknowledged once, unlike DO_SET_MODE, and never refused: without a position PX4 descends where it is.
        params = (0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
        return CommandLong(mavlink.MAV_CMD_NAV_LAND, params, "land", group="mode", shows=shows_mode("AUTO.LAND"))

    @override
    def take_control(self) -> CommandLong:
        return self._enter_offboard("take control")

    @override
    def hold(self) -> CommandLong:
        return self._set_mode(_AUTO, _SUB_LOITER, "hold")

    def _enter_offboard(self, what: str) -> CommandLong:
        return replace(self._set_mode(_OFFBOARD, 0, what), needs_setpoints_s=OFFBOARD_NEEDS_SETPOINTS_S)

    def _set_mode(self, main: int, sub: int, what: str) -> CommandLong:
        command = set_mode(self.mode(main << 16 | sub << 24).name, main, sub, what=what)
        # The first acknowledgement only says that the message was read; the second is the commander's.
        return replace(command, acks_count=2)
