"""The gimbal of a simulated autopilot, which turns at once: ArduPilot's first mount, and PX4's servos."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import all as mavlink

from ual.geometry import Quaternion
from ual_daemon.backends.mavlink.wire.messages import Message

if TYPE_CHECKING:
    from tests.simulators.autopilot import Autopilot

ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
DENIED: int = mavlink.MAV_RESULT_DENIED
FAILED: int = mavlink.MAV_RESULT_FAILED
PITCH_YAW: int = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
MOUNT_CONTROL: int = mavlink.MAV_CMD_DO_MOUNT_CONTROL
_ARDUPILOT = {
    "MNT1_TYPE": 4,
    "MNT2_TYPE": 0,
    "MNT1_PITCH_MIN": -90.0,
    "MNT1_PITCH_MAX": 20.0,
    "MNT1_YAW_MIN": -180.0,
    "MNT1_YAW_MAX": 180.0,
}
_PX4 = {
    "MNT_MODE_IN": 4,
    "MNT_MODE_OUT": 0,
    "MNT_DO_STAB": 2,
    "MNT_RANGE_ROLL": 90.0,
    "MNT_RANGE_PITCH": 180.0,
    "MNT_RANGE_YAW": 360.0,
}
_STREAM_S = 0.1


class Mount:
    """Made, it is carried. `degrees` are roll, pitch and yaw as MAVLink means them: level, and yaw from the nose."""

    commands = frozenset({PITCH_YAW, MOUNT_CONTROL})

    def __init__(self, autopilot: Autopilot) -> None:
        self.degrees = (0.0, 0.0, 0.0)
        self.rates: tuple[float, float] | None = None
        self.is_retracted = False
        self.failures = 0
        self._autopilot = autopilot
        self._is_px4 = autopilot.autopilot == mavlink.MAV_AUTOPILOT_PX4
        with autopilot.lock:
            autopilot.mount = self
            autopilot.parameters |= _PX4 if self._is_px4 else _ARDUPILOT
            autopilot.builders[mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS] = self._status
            if self._is_px4:
                autopilot.builders[mavlink.MAVLINK_MSG_ID_MOUNT_ORIENTATION] = self._orientation
                for channel in autopilot.channels:
                    channel.stream(mavlink.MAVLINK_MSG_ID_MOUNT_ORIENTATION, _STREAM_S, autopilot.elapsed_s)

    def obey(self, command: int, params: tuple[float, ...]) -> int:
        """Takes a command. Returns the result (MAV_RESULT)."""
        if self._is_px4:
            return self._mount_control(params) if command == MOUNT_CONTROL else DENIED  # nothing has its control
        if command == MOUNT_CONTROL:  # where the mount cannot pan, a copter turns itself
            self._autopilot.body.yaw_rad += math.radians(params[2])
            return ACCEPTED
        return self._pitch_yaw(params)

    def _mount_control(self, params: tuple[float, ...]) -> int:
        pitch, roll, yaw = params[:3]
        self.degrees = (roll, pitch, yaw) if params[6] == 2.0 else (0.0, 0.0, 0.0)
        return ACCEPTED

    def _pitch_yaw(self, params: tuple[float, ...]) -> int:
        pitch, yaw, pitch_rate, yaw_rate, flags = (*params[:4], int(params[4]))
        self.is_retracted, self.rates = bool(flags & mavlink.GIMBAL_MANAGER_FLAGS_RETRACT), None
        if flags & (mavlink.GIMBAL_MANAGER_FLAGS_RETRACT | mavlink.GIMBAL_MANAGER_FLAGS_NEUTRAL):
            self.degrees = (0.0, 0.0, 0.0)
        elif not math.isnan(pitch) and not math.isnan(yaw):
            is_locked = flags & mavlink.GIMBAL_MANAGER_FLAGS_YAW_LOCK
            self.degrees = (0.0, pitch, yaw - math.degrees(self._autopilot.body.yaw_rad) if is_locked else yaw)
        elif not math.isnan(pitch_rate) and not math.isnan(yaw_rate):
            self.rates = (pitch_rate, yaw_rate)
        else:
            return FAILED
        return ACCEPTED

    def _status(self) -> Message:
        q, nan = Quaternion.from_euler(*map(math.radians, self.degrees)), math.nan
        flags = mavlink.GIMBAL_DEVICE_FLAGS_ROLL_LOCK | mavlink.GIMBAL_DEVICE_FLAGS_PITCH_LOCK
        said: Any = mavlink.MAVLink_gimbal_device_attitude_status_message
        status: Message = said(0, 0, 0, flags, (q.w, q.x, q.y, q.z), nan, nan, nan, self.failures)
        return status

    def _orientation(self) -> Message:
        return mavlink.MAVLink_mount_orientation_message(self._autopilot.time_ms, *self.degrees)
