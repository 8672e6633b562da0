"""ArduCopter over MAVLink: flown in GUIDED mode with setpoints in its local NED frame. Measured with 4.6.3
(docs/reference/backends/mavlink.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from typing_extensions import override

from ual.gimbals import GimbalAbility
from ual_daemon.backends.engine.command import FLYING, shows_landed
from ual_daemon.backends.firmwares import ardupilot
from ual_daemon.backends.firmwares.autopilot import NO_PARAMETERS
from ual_daemon.backends.firmwares.gimbal_codec import ArduPilotGimbal
from ual_daemon.backends.mavlink.dialects.command_long import (
    LongCommand,
    arm_or_disarm,
    command_of,
    land_in,
    pose_streams,
    set_message_interval,
    set_mode,
    slow_streams,
    target_stream,
)
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.external_pose import encode_vision_position_estimate
from ual_daemon.backends.mavlink.dialects.parameter_codec import Cast
from ual_daemon.backends.mavlink.dialects.position_target import encode_position_target
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import ExternalPose, Freshness, LandedState, PositionSetpoint, Setpoint, Snapshot

_AUTO, _GUIDED, _BRAKE = 3, 4, 17
OUTPUTS_HZ = 4.0
"""Two reports in turn tell that the motors stand; see `MotorOutputs`."""


class ArduCopter(ardupilot.ArduCopter, Dialect):
    """ArduPilot multirotors, 4.6, over MAVLink."""

    # The streams requested below come at 10 Hz and more; the heartbeat, until it is requested, at 1 Hz.
    freshness = Freshness(link_s=1.2, pose_s=1.5, mode_s=4.0, landed_s=2.0, estimator_s=2.0)
    # ModeAuto::run compares the next three items; the second comes on the link of the upload only.
    mission_change_texts = ("Auto mission changed", "Flight plan received")
    estimator_message = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
    takes_plain_velocities = True
    optional_messages = frozenset({mavlink.MAVLINK_MSG_ID_BATTERY_STATUS})  # without a monitor there are none
    wanted_messages = (mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,)
    parameter_codec = Cast()
    packed_parameters = "@PARAM/param.pck"
    takes_ftp_session = True
    # A quarter as often until 1 s after the last answer (GCS_MAVLINK::get_reschedule_interval_ms), and less evenly.
    rates_beside_files = 6.0
    keeps_items = True
    tells_baseline = True
    gimbal_kind_parameter = "MNT{}_TYPE"
    gimbal_references = ArduPilotGimbal.references
    lacking_gimbal_abilities = frozenset({GimbalAbility.BODY})  # its gimbals are level, whatever was ordered

    @override
    def streams(self, pose_rate_hz: float) -> list[LongCommand]:
        return [
            set_message_interval(mavlink.MAVLINK_MSG_ID_HEARTBEAT, 10.0),
            set_message_interval(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 10.0),
            # Also pushed when it arms, but not to a link on which nothing was requested yet. Before the pose: on a bad
            # link each request takes its time, and a UAV that is ready must be able to take off.
            set_message_interval(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, 1.0),
            set_message_interval(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 1.0),
            set_message_interval(mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 10.0),
            *pose_streams(pose_rate_hz),
            set_message_interval(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, OUTPUTS_HZ),
            *slow_streams(),
            set_message_interval(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 2.0),
            target_stream(),
            set_message_interval(mavlink.MAVLINK_MSG_ID_RC_CHANNELS, 5.0),
        ]

    @override
    def parameter_value(self, message: Message) -> float | None:
        return float(message.param_value)  # integers too, as numbers

    @override
    def encode_setpoint(
        self, setpoint: Setpoint, target: MessageSource, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        if isinstance(setpoint, PositionSetpoint):
            setpoint = self.position_setpoint(setpoint, parameters)
        return encode_position_target(setpoint, target, time_ms, with_acceleration=self.takes_acceleration)

    @override
    def encode_external_pose(self, measured: ExternalPose) -> Message:
        return encode_vision_position_estimate(measured)

    @override
    def arm(self, snapshot: Snapshot) -> LongCommand:
        return self._arm_leaving(snapshot, arm_or_disarm(is_arming=True), self._set_mode(_GUIDED, "arm"))

    @override
    def take_off(self, height_m: float, snapshot: Snapshot, *, is_slower: bool = False) -> LongCommand:
        params = (0.0,) * 6 + (self.takeoff_altitude_m(height_m, snapshot, is_slower=is_slower),)
        climb = replace(
            command_of(mavlink.MAV_CMD_NAV_TAKEOFF, params, "take off", FLYING),
            shows=shows_landed(LandedState.TAKING_OFF, LandedState.IN_AIR),
            mode=self.setpoint_mode,
        )
        return replace(self._set_mode(_GUIDED, "take off"), then=climb)

    @override
    def land(self) -> LongCommand:
        return land_in(self.land_mode)

    @override
    def take_control(self) -> LongCommand:
        return self._set_mode(_GUIDED, "take control")

    @override
    def hold(self) -> LongCommand:
        return self._set_mode(_BRAKE, "hold")

    @override
    def fly_mission(self) -> LongCommand:
        # It enters AUTO, and does not arm. In AUTO alone it waits on the ground for a raised throttle.
        return replace(
            command_of(mavlink.MAV_CMD_MISSION_START, (), "fly the mission", FLYING), mode=self.mode(_AUTO).name
        )

    def _set_mode(self, number: int, what: str) -> LongCommand:
        return set_mode(self.mode(number).name, number, what=what)
