"""PX4 over MAVLink: setpoints in its local NED frame. Measured with 1.17 (docs/reference/backends/mavlink.md)."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import replace

from typing_extensions import override

from ual_daemon.backends.firmwares import px4, px4_events
from ual_daemon.backends.firmwares.autopilot import NO_PARAMETERS
from ual_daemon.backends.firmwares.gimbal_codec import Px4Gimbal
from ual_daemon.backends.firmwares.px4_events import Event
from ual_daemon.backends.mavlink.dialects.command_long import (
    CommandLong,
    LongCommand,
    arm_or_disarm,
    land_in,
    pose_streams,
    set_message_interval,
    set_mode,
    target_stream,
)
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.external_pose import encode_odometry
from ual_daemon.backends.mavlink.dialects.parameter_codec import ByteWise
from ual_daemon.backends.mavlink.dialects.position_target import encode_position_target
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import ExternalPose, Setpoint, Snapshot

_CANCELLED = 6
"""Of MAV_RESULT; pymavlink has no name for it."""
_AUTO, _OFFBOARD, _SUB_LOITER, _SUB_MISSION = 4, 6, 3, 4


class Px4(px4.Px4, Dialect):
    """PX4 multirotors, from 1.13, over MAVLink."""

    names_intended_mode = True
    tells_gimbal_manager = True
    takes_plain_velocities = True
    gimbal_kind_parameter = "MNT_DO_STAB"
    gimbal_references = Px4Gimbal.references
    # Sent on each change and else twice a second, whatever rate was requested (20 Hz); without a request every 2 s.
    sparse_messages = frozenset({mavlink.MAVLINK_MSG_ID_CURRENT_MODE})
    # Without a transmitter there are no channels, and in a pilot's STABILIZED no target.
    optional_messages = frozenset(
        {mavlink.MAVLINK_MSG_ID_RC_CHANNELS, mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED}
    )
    wanted_messages = (
        mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
        mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
    )
    changing_messages = frozenset({mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN})
    # While its gripper moves; a repetition gets it where the first answer was lost.
    busy_answers = frozenset({(mavlink.MAV_CMD_DO_GRIPPER, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)})
    # Of the order before, ahead of the answer to the one that replaces it.
    replaced_answers = frozenset({(mavlink.MAV_CMD_DO_GRIPPER, _CANCELLED)})
    parameter_codec = ByteWise()
    has_descriptions = True
    keeps_items = True

    @override
    def streams(self, pose_rate_hz: float) -> list[LongCommand]:
        return [
            set_message_interval(mavlink.MAVLINK_MSG_ID_CURRENT_MODE, 20.0),
            set_message_interval(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 20.0),
            set_message_interval(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 10.0),
            *pose_streams(pose_rate_hz),
            target_stream(),
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
    def event(self, message: Message, mode: str) -> Event:
        boot_s, arguments = message.event_time_boot_ms / 1000.0, bytes(message.arguments)
        return px4_events.read(message.id, boot_s, message.log_levels, arguments, mode)

    @override
    def encode_setpoint(
        self, setpoint: Setpoint, target: MessageSource, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        return encode_position_target(setpoint, target, time_ms)

    @override
    def encode_external_pose(self, measured: ExternalPose) -> Message:
        return encode_odometry(measured)

    @override
    def arm(self, snapshot: Snapshot) -> LongCommand:
        # PX4 reports the results of its checks when they change; after a refusal it is asked to report them again.
        check = CommandLong(mavlink.MAV_CMD_RUN_PREARM_CHECKS)
        arm = replace(arm_or_disarm(is_arming=True), explain=check)
        return self._arm_leaving(snapshot, arm, self.hold())

    @override
    def take_off(self, height_m: float, snapshot: Snapshot, *, is_slower: bool = False) -> LongCommand:
        return self._enter_offboard("take off")

    @override
    def land(self) -> LongCommand:
        # Acknowledged once, unlike DO_SET_MODE, and never refused: without a position PX4 descends where it is.
        params = (0.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
        return land_in(self.land_mode, params)

    @override
    def take_control(self) -> LongCommand:
        return self._enter_offboard("take control")

    @override
    def hold(self) -> LongCommand:
        return self._set_mode(_AUTO, _SUB_LOITER, "hold")

    @override
    def fly_mission(self) -> LongCommand:
        # Not by MISSION_START, which also arms (Commander.cpp).
        return self._set_mode(_AUTO, _SUB_MISSION, "fly the mission")

    def _enter_offboard(self, what: str) -> LongCommand:
        return replace(self._set_mode(_OFFBOARD, 0, what), setpoints_before_s=self.setpoints_before_mode_s)

    def _set_mode(self, main: int, sub: int, what: str) -> LongCommand:
        command = set_mode(self.mode(main << 16 | sub << 24).name, main, sub, what=what)
        # The first acknowledgement only says that the message was read; the second is the commander's.
        return replace(command, accepts_count=2)
