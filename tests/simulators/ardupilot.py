"""A simulated ArduCopter. It behaves as ArduCopter 4.6.3 in its simulator was measured and recorded."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators import parameter_files
from tests.simulators.autopilot import ACCEPTED, FAILED, STEP_S, UNSUPPORTED, Autopilot, Sticks
from tests.simulators.channel import Channel
from tests.simulators.mission_flight import ACTIVE, COMPLETE, NAV_LAST, NOT_STARTED, PAUSED
from tests.simulators.mission_store import ArduPilotStore, Sender
from tests.simulators.physics import Agility, Target, Vector, clamp, plus
from tests.simulators.ports import Port
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.geodesy import FlatProjection

STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, LAND, POSHOLD, BRAKE = 0, 2, 3, 4, 5, 6, 9, 16, 17
MODES = {
    STABILIZE: "STABILIZE",
    ALT_HOLD: "ALT_HOLD",
    AUTO: "AUTO",
    GUIDED: "GUIDED",
    LOITER: "LOITER",
    RTL: "RTL",
    LAND: "LAND",
    POSHOLD: "POSHOLD",
    BRAKE: "BRAKE",
}
_BOOT_S = 1.4
"""Seconds of its boot."""
_BY_STICKS = frozenset({STABILIZE, ALT_HOLD, LOITER, POSHOLD})
_NEEDS_POSITION = frozenset({GUIDED, LOITER, RTL, POSHOLD, BRAKE})
_NOT_ARMABLE = frozenset({AUTO, RTL, LAND, BRAKE})
_AUTO_ARMABLE, _AUTO_TAKES_OFF = 1, 2
"""Bits of AUTO_OPTIONS: it is armed in AUTO, and takes off there without a raised throttle."""
_SWITCH_LIMITS = (1231, 1361, 1491, 1621, 1750)
_SWITCH_S = 0.2
_RADIO_LOST_S = 1.0

_TAKEOFF_SHOWN_S, _TAKEOFF_LIFTS_S = 1.0, 1.25
"""The time from the command until a take-off is reported, and until it leaves the ground."""
_TAKEOFF_REACHED_M = 0.1
_TAKEOFF_M_S, _TAKEOFF_M_S2, _TAKEOFF_GAIN = 1.4, 2.0, 1.45
_LANDED_S, _LANDED_DISARM_S = 1.9, 0.5
_GPS_FLAGS_S, _GPS_FAILSAFE_S = 3.0, 4.0
"""The time from the loss of GPS until the estimator's flags show it, and until the failsafe. Not measured."""
_GOOD_FLAGS = 831
_NO_POSITION_FLAGS = (
    mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_VERT | mavlink.EKF_POS_VERT_ABS | mavlink.EKF_CONST_POS_MODE
)
_FRAMES = {
    mavlink.MAV_FRAME_LOCAL_NED: (False, False),
    mavlink.MAV_FRAME_LOCAL_OFFSET_NED: (False, True),
    mavlink.MAV_FRAME_BODY_NED: (True, True),
    mavlink.MAV_FRAME_BODY_OFFSET_NED: (True, True),
}
"""Whether the axes of a frame are the body's, and whether its positions are relative to the vehicle's."""
_POSITION, _VELOCITY, _ACCELERATION, _YAW, _YAW_RATE = 0b111, 0b111 << 3, 0b111 << 6, 1 << 10, 1 << 11


RENAMED = {
    "WPNAV_SPEED": ("WP_SPD", 100.0),
    "WPNAV_SPEED_UP": ("WP_SPD_UP", 100.0),
    "WPNAV_SPEED_DN": ("WP_SPD_DN", 100.0),
    "WPNAV_ACCEL": ("WP_ACC", 100.0),
    "WPNAV_ACCEL_Z": ("WP_ACC_Z", 100.0),
    "ATC_SLEW_YAW": ("ATC_RATE_WPY_MAX", 100.0),
    "PSC_JERK_XY": ("PSC_NE_JERK", 1.0),
    "PSC_JERK_Z": ("PSC_D_JERK", 1.0),
}
"""The parameters of 4.6 that 4.7.1 has under another name, in another unit: as many of the old one make a new one."""
RENAMED_IN_4_7_0 = RENAMED | {"PSC_JERK_XY": ("PSC_JERK_NE", 1.0), "PSC_JERK_Z": ("PSC_JERK_D", 1.0)}
RANGEFINDER_MAX_M = 40.0
_MOTORS_COUNT = 4
STANDS_US, _IDLES_US, _TURNS_US = 1000, 1100, 1400
"""The pulses of a motor."""
_SWITCH_US = {LOITER: 1700, GUIDED: 1500, RTL: 1300}
"""The pulse of the transmitter's switch (channel 5) in the positions that the pilot uses."""
_FAILSAFES = {
    "rc": (mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER, True, ("Radio Failsafe",)),
    "battery": (
        mavlink.MAV_SYS_STATUS_SENSOR_BATTERY,
        True,
        ("Battery 1 is low 10.40V used 98 mAh", "Battery Failsafe"),
    ),
    "fence": (mavlink.MAV_SYS_STATUS_GEOFENCE, False, ("Circle fence breached",)),
}
"""The sensor that fails, whether the system status gets CRITICAL, and the texts, as recorded."""


_NOT_IN_3_6 = (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
_GROUPS = {
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (mavlink.MAVLINK_MSG_ID_SYS_STATUS, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT),
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: (
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
    ),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,),
}
"""The streams of 3.6 (GCS_Mavlink.cpp, STREAM_...)."""
_MAVLINK, _EXTERNAL_NAVIGATION = 1, 6
"""VISO_TYPE and EK3_SRC1_POSXY with which it uses poses from outside."""


class ArduPilot(Autopilot):
    """An ArduCopter with any number of equal links. If `radio` is given, the pilot's transmitter is there.

    It starts on the ground `start` from its origin, in STABILIZE, `boot_s` after it has booted. `settle_s` is how long
    after booting its estimator is good (40 s for the real one).
    """

    autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    external_pose_message = mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE
    make_store = ArduPilotStore
    files_slow_streams = 4.0
    flight_sw_version = 0x040603FF
    gps_fix = mavlink.GPS_FIX_TYPE_RTK_FIXED
    vtol_state = mavlink.MAV_VTOL_STATE_MC

    def __init__(
        self,
        links: Port | Iterable[Port],
        radio: Port | None = None,
        *,
        system_id: int = 1,
        start: Vector = (0.0, 0.0, 0.02),
        boot_s: float = 42.0,
        settle_s: float = 40.0,
        seed: int = 0,
        wander_m: float = 0.0,
    ) -> None:
        self._radio = radio
        self.settle_s = settle_s
        self.has_rangefinder = False
        """Whether it uses a rangefinder, up to `RANGEFINDER_MAX_M`: a take-off then counts from the ground below."""
        self.takeoff_error_m = 0.0
        """Metres by which a take-off leads higher than commanded."""
        rates_hz = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0, mavlink.MAVLINK_MSG_ID_TIMESYNC: 0.1}
        super().__init__(
            [Channel(port, rates_hz) for port in ([links] if isinstance(links, Port) else links)],
            FlatProjection(47.3977420, 8.5455940, 488.100),
            system_id=system_id,
            start=start,
            boot_s=boot_s,
            seed=seed,
            wander_m=wander_m,
        )
        self.files.made[parameter_files.PACKED] = lambda: parameter_files.packed(self.parameters)

    def default_parameters(self) -> dict[str, float]:
        return {
            "WPNAV_SPEED": 1000.0,
            "WPNAV_SPEED_UP": 250.0,
            "WPNAV_SPEED_DN": 150.0,
            "WPNAV_ACCEL": 250.0,
            "WPNAV_ACCEL_Z": 100.0,
            "PSC_JERK_XY": 5.0,
            "PSC_JERK_Z": 5.0,
            "ATC_SLEW_YAW": 6000.0,
            "LAND_SPEED": 50.0,
            "VISO_TYPE": 0.0,
            "EK3_SRC1_POSXY": 3.0,
            "GUID_TIMEOUT": 3.0,
            "DISARM_DELAY": 10.0,
            "FS_GCS_ENABLE": 0.0,
            "FS_OPTIONS": 0.0,
            "MIS_RESTART": 0.0,
            "SIM_SPEEDUP": 1.0,
            "SIM_GPS_DISABLE": 0,
            "FENCE_ENABLE": 0,
            "FENCE_AUTOENABLE": 0,
            "FENCE_TYPE": 7,
            "FENCE_RADIUS": 300.0,
            "FENCE_ALT_MAX": 100.0,
            "FENCE_ALT_MIN": -10.0,
            "FENCE_TOTAL": 0,
            "FENCE_OPTIONS": 0,
            "FLTMODE1": LOITER,
            "FLTMODE2": LOITER,
            "FLTMODE3": STABILIZE,
            "FLTMODE4": GUIDED,  # the switch position in which the pilot does not take over
            "FLTMODE5": LOITER,
            "FLTMODE6": STABILIZE,
            "MOT_PWM_MIN": STANDS_US,
            **{f"SERVO{number}_FUNCTION": 32 + number if number <= _MOTORS_COUNT else 0 for number in range(1, 17)},
        }

    def become_4_7(self, renamed: Mapping[str, tuple[str, float]] = RENAMED) -> None:
        """Makes it an ArduCopter 4.7, whose parameters have other names and units."""
        with self.lock:
            self.flight_sw_version = 0x040701FF
            for old, (new, per_unit) in renamed.items():
                self.parameters[new] = self.parameters.pop(old) / per_unit

    def become_3_6(self) -> None:
        """Makes it an ArduCopter 3.6, which knows only groups of streams, and no message that is newer."""
        with self.lock:
            self.flight_sw_version = 0x030600FF
            self.is_old = True
            for message_id in _NOT_IN_3_6:
                del self.builders[message_id]
            for channel in self.channels:  # it boots, and streams nothing that the newer firmware was asked for
                channel.boot(self.system_id, self.elapsed_s, self.component_id)
            self._handlers[mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM] = self._on_request_data_stream

    def _on_request_data_stream(self, message: Message, sender: Sender) -> None:
        for message_id in _GROUPS.get(message.req_stream_id, ()):
            interval_s = 1.0 / message.req_message_rate if message.start_stop else None
            sender.channel.stream(message_id, interval_s, self.elapsed_s)

    def setting(self, name: str) -> float:
        """Returns a parameter of `RENAMED`, by its old name, in SI units and degrees."""
        _, per_unit = RENAMED[name]
        if name in self.parameters:
            return self.parameters[name] / per_unit
        return next(
            self.parameters[new[name][0]] for new in (RENAMED, RENAMED_IN_4_7_0) if new[name][0] in self.parameters
        )

    def _boot(self, boot_s: float) -> None:
        super()._boot(boot_s)
        self.mode = STABILIZE
        self.mission = self._new_mission(1)
        self._compared_items = list(self.missions.lists[0])
        """The mission before its last change."""
        self._is_auto_armed = False
        """Whether it may lift in AUTO: by MISSION_START, or a raised throttle."""
        self._target = Target()
        self._setpoint_s = -math.inf
        self._is_timed = False
        self._aim: tuple[Vector, Vector] | None = None
        """The place to which a velocity has led so far, and how it moves."""
        self._takeoff: tuple[float, float] | None = None
        self._is_landed = True
        self._is_beyond = False
        """Whether it is beyond its fence, which it has told."""
        self._landed_s = -math.inf
        self._touched_s: float | None = None
        self._has_radio = False
        self._is_critical = False
        self._switch_us = _SWITCH_US[GUIDED]
        self._switch: int | None = None
        self._switch_seen: tuple[int, float] | None = None
        if self.has_satellites:
            self.home = (self.body.position[0], self.body.position[1], 0.0)  # at the origin's height, until it is armed

    def close(self) -> None:
        super().close()
        if self._radio is not None:
            self._radio.close()

    def uses(self, message: Message) -> bool:
        is_set_up = (
            self.parameters["VISO_TYPE"] == _MAVLINK and self.parameters["EK3_SRC1_POSXY"] == _EXTERNAL_NAVIGATION
        )
        return is_set_up and math.isfinite(message.yaw)

    # State

    @property
    def has_position(self) -> bool:
        """Whether its estimator is good."""
        return self.now_s >= self.settle_s and self.unaided_s < _GPS_FLAGS_S

    @property
    def is_ready_to_arm(self) -> bool:
        return self.has_position and not self.arm_refusal

    @property
    def is_taking_off(self) -> bool:
        """Whether NAV_TAKEOFF is running."""
        return self.mode == GUIDED and self._takeoff is not None

    @property
    def landed_state(self) -> int:
        if self.is_taking_off and self._takeoff is not None and self.now_s - self._takeoff[1] >= _TAKEOFF_SHOWN_S:
            return int(mavlink.MAV_LANDED_STATE_TAKEOFF)
        if self._is_landed:
            return int(mavlink.MAV_LANDED_STATE_ON_GROUND)
        if self.mode == LAND or (self._returns() and self._is_over_home()) or self._lands_in_auto():
            return int(mavlink.MAV_LANDED_STATE_LANDING)
        return int(mavlink.MAV_LANDED_STATE_IN_AIR)

    # Modes and arming

    def set_mode(self, mode: int) -> bool:
        """Handles a request for a mode. Returns whether it was accepted; an accepted mode is reported at once."""
        why = ""
        if mode not in MODES:
            return False
        if mode == AUTO and self.is_armed and len(self.missions.lists[0]) < 2:  # it has no mission but home
            why = "init failed"
        elif mode == AUTO and self.is_armed and self._is_landed and not self._begins_with_take_off():
            self.say("Auto: Missing Takeoff Cmd")
            why = "init failed"
        elif mode in _NEEDS_POSITION and not self.has_position:
            why = "requires position"
        if why:
            self.say(f"Mode change to {MODES[mode]} failed: {why}", mavlink.MAV_SEVERITY_WARNING)
            return False
        if mode != self.mode:
            was, self.mode = self.mode, mode
            self._stop()
            if was == AUTO:
                self.mission.leave()
            if mode == AUTO:
                if self.parameters["MIS_RESTART"]:
                    self.mission.reset()
                self._is_auto_armed = not self._is_landed
                north, east, down = self._target.position
                assert north is not None
                assert east is not None
                assert down is not None
                self.mission.begin((north, east, down))
            self._push(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        return True

    def _on_mission_changed(self) -> None:
        super()._on_mission_changed()
        before, self._compared_items = self._compared_items, list(self.missions.lists[0])
        seq = self.mission.seq
        if self.mode == AUTO and before[seq : seq + 3] != self._compared_items[seq : seq + 3]:
            self.say("Auto mission changed, restarted command")

    def _begins_with_take_off(self) -> bool:
        """Returns whether the first item that moves it is a take-off."""
        moving = (each.command for each in self.missions.lists[0][1:] if each.command <= NAV_LAST)
        return bool(next(moving, 0) == mavlink.MAV_CMD_NAV_TAKEOFF)

    def trigger_failsafe(self, kind: str) -> None:
        """Triggers a failsafe as recorded: "rc", "battery" or "fence". It returns; on the ground it changes nothing."""
        with self.lock:
            sensor, is_critical, texts = _FAILSAFES[kind]
            self.failing_sensors |= sensor
            self._is_critical = self._is_critical or is_critical
            if self.is_armed and not self._is_landed:
                self.set_mode(RTL)  # its heartbeat comes first
                for text in texts:
                    self.say(text)

    def end_failsafe(self) -> None:
        """The transmitter is heard again, the battery is another one, it is inside the fence. Its mode stays."""
        with self.lock:
            self.failing_sensors, self._is_critical = 0, False

    def cancel_takeoff(self) -> None:
        """Ends a take-off, as any setpoint does before its end."""
        self._takeoff = None

    def _turn_targets(self, by_rad: float) -> None:
        """A heading that was sent in GUIDED is the companion's, and stays; that of a take-off is its own."""
        if self._target.yaw_rad is not None and (self.mode != GUIDED or self._takeoff is not None):
            self._target = replace(self._target, yaw_rad=self._target.yaw_rad + by_rad)

    def _shift_targets(self, offset: Vector) -> None:
        """A target of GUIDED is the companion's, and stays; that of a take-off is its own."""
        if self.mode != GUIDED or self._takeoff is not None:
            self._target = self._target.moved(offset)
        if self._aim is not None:
            self._aim = (plus(self._aim[0], offset), self._aim[1])
        if self._takeoff is not None:
            self._takeoff = (self._takeoff[0] + offset[2], self._takeoff[1])

    def _stop(self) -> None:
        """Brakes, and holds the position where it comes to rest."""
        limit = self.setting("WPNAV_ACCEL")
        x, y, z = (p + v * abs(v) / (2.0 * limit) for p, v in zip(self.position, self.velocity, strict=True))
        self._target = Target((x, y, z), yaw_rad=self.body.yaw_rad)
        self._takeoff = None
        self._is_timed = False
        self._aim = None

    def arm(self, *, is_forced: bool) -> int:
        if self.is_armed:
            return ACCEPTED
        if not is_forced:
            if self.mode in _NOT_ARMABLE and not (self.mode == AUTO and self._auto_options & _AUTO_ARMABLE):
                self.say(f"Arm: {MODES[self.mode]} mode not armable")
                return FAILED
            if self.arm_refusal:
                self.say(f"Arm: {self.arm_refusal}")
                return FAILED
            if not self.has_position:
                self.say("PreArm: Need Position Estimate")
                return FAILED
        self.is_armed = True
        self.armed_s = self.now_s
        self._is_landed, self._touched_s = True, None
        if self.has_satellites:
            self.home = self.position
        self._stop()
        if self.mode == AUTO:
            self.mission.reset()
            self.mission.begin(self.position)
            self._is_auto_armed = bool(self._auto_options & _AUTO_TAKES_OFF)
        self.at(0.0, self._tell_armed)
        return ACCEPTED

    @property
    def _auto_options(self) -> int:
        return int(self.parameters.get("AUTO_OPTIONS", 0.0))

    def _tell_armed(self) -> None:
        for channel in self.channels:
            if channel.is_active:
                for message_id in (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN, mavlink.MAVLINK_MSG_ID_HOME_POSITION):
                    message = self.builders[message_id]()
                    if message is not None:
                        channel.send(message, self.elapsed_s)
        self.say("Arming motors", mavlink.MAV_SEVERITY_INFO)

    def disarm(self, *, is_forced: bool) -> int:
        if self.is_armed and not is_forced and not self._is_landed:
            return FAILED
        if self.is_armed:
            self._stop_motors()
        return ACCEPTED

    def _stop_motors(self) -> None:
        self.is_armed = False
        self._is_landed = True
        self._takeoff = None
        self.say("Disarming motors", mavlink.MAV_SEVERITY_INFO)

    def pilot_readies(self) -> None:
        with self.lock:
            if not self.is_armed and self.mode in _NOT_ARMABLE:
                self.set_mode(GUIDED)

    def pilot_take_over(self) -> None:
        with self.lock:
            self.pilot_moves(Sticks())
            self.at(_SWITCH_S, partial(self._flip, LOITER))

    def pilot_switches_to(self, mode: int) -> None:
        """The safety pilot moves the mode switch to another mode of the autopilot."""
        with self.lock:
            self.at(_SWITCH_S, partial(self._flip, mode))

    def pilot_give_back(self) -> None:
        """The safety pilot sets the mode switch to GUIDED."""
        with self.lock:
            self.at(_SWITCH_S, partial(self._flip, GUIDED))

    def _flip(self, mode: int) -> None:
        self._switch_us = _SWITCH_US[mode]
        self.set_mode(mode)

    def request_custom_mode(self, custom_mode: int) -> None:
        self.set_mode(custom_mode)

    def _command(self, command: int, params: tuple[float, ...], sender: Sender) -> int | None:
        if command == mavlink.MAV_CMD_DO_SET_MODE:
            return ACCEPTED if self.set_mode(int(params[1])) else FAILED
        if command == mavlink.MAV_CMD_NAV_TAKEOFF:
            if self.mode != GUIDED or not self.is_armed or not self._is_landed or self.home is None:
                return FAILED
            x, y, z = self.position
            if params[6] <= max(0.0, self.home[2] - z):  # not downwards
                return FAILED
            is_from_ground = self.has_rangefinder and params[6] < RANGEFINDER_MAX_M
            base_z = z if is_from_ground else self.home[2]
            self._takeoff = (base_z - params[6] - self.takeoff_error_m, self.now_s)
            self._target = Target((x, y, self._takeoff[0]), yaw_rad=self.body.yaw_rad)
            self._is_timed = False
            return ACCEPTED
        if command in (mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH):
            return ACCEPTED if self.set_mode(LAND if command == mavlink.MAV_CMD_NAV_LAND else RTL) else FAILED
        if command == mavlink.MAV_CMD_MISSION_START:
            if not self.set_mode(AUTO):
                return FAILED
            self._is_auto_armed = True
            return ACCEPTED
        return UNSUPPORTED

    # Setpoints

    def _on_local_target(self, message: Message, sender: Sender) -> None:
        self.setpoints_s.append(self.elapsed_s)
        self.setpoint_senders.append((sender.system_id, sender.component_id))
        if self.mode != GUIDED or not self.is_armed or message.coordinate_frame not in _FRAMES:
            return
        mask = message.type_mask
        has_position, has_velocity, has_acceleration = (
            not mask & group for group in (_POSITION, _VELOCITY, _ACCELERATION)
        )
        is_valid = (has_position and (has_velocity or not has_acceleration)) or (
            not has_position and (has_velocity or has_acceleration)
        )
        self.cancel_takeoff()
        if not is_valid:
            self._stop()
            return
        self._setpoint_s = self.now_s
        self._is_timed = has_velocity or has_acceleration
        is_body, is_offset = _FRAMES[message.coordinate_frame]
        position = self._turned((message.x, message.y, message.z), is_body=is_body)
        if is_offset:
            x, y, z = (p + here for p, here in zip(position, self.position, strict=True))
            position = (x, y, z)
        if has_position and self._is_beyond_fence(position):
            return  # silently
        zero = (0.0, 0.0, 0.0)
        velocity = self._turned((message.vx, message.vy, message.vz), is_body=is_body) if has_velocity else zero
        yaw_rad, yaw_rate_rad_s = self._yaw_of(message, velocity, is_body=is_body)
        self._target = Target(
            position if has_position else (None, None, None),
            velocity,
            self._turned((message.afx, message.afy, message.afz), is_body=is_body) if has_acceleration else zero,
            yaw_rad,
            yaw_rate_rad_s,
        )

    def _is_beyond_fence(self, position: Vector) -> bool:
        p, home = self.parameters, self.home
        if not p["FENCE_ENABLE"] or home is None:
            return False
        kinds = int(p["FENCE_TYPE"])
        is_high = kinds & 1 and home[2] - position[2] > p["FENCE_ALT_MAX"]
        is_far = kinds & 2 and math.dist(position[:2], home[:2]) > p["FENCE_RADIUS"]
        self.fence.unites_inclusions = bool(int(p["FENCE_OPTIONS"]) & 2)
        return bool(is_high or is_far or (kinds & 4 and self.is_beyond_zones(position)))

    def _on_fence_set(self) -> None:
        count = len(self.fence.items)
        self.parameters["FENCE_TOTAL"] = count + 2 if count >= 3 else 0
        for channel in self.channels:
            channel.send(self._parameter("FENCE_TOTAL"), self.elapsed_s)

    def _yaw_of(self, message: Message, velocity: Vector, *, is_body: bool) -> tuple[float | None, float]:
        """Returns the heading and yaw rate of a setpoint. Without both, the nose turns to the direction of flight."""
        has_yaw, has_rate = not message.type_mask & _YAW, not message.type_mask & _YAW_RATE
        rate_rad_s = message.yaw_rate if has_rate else 0.0
        if has_yaw:
            return message.yaw + (self.body.yaw_rad if is_body else 0.0), rate_rad_s
        if has_rate:
            return None, rate_rad_s
        if math.hypot(*velocity[:2]) > 0.5:
            return math.atan2(velocity[1], velocity[0]), 0.0
        return self.body.yaw_rad, 0.0

    def _turned(self, vector: Vector, *, is_body: bool) -> Vector:
        if not is_body:
            return vector
        cos, sin = math.cos(self.body.yaw_rad), math.sin(self.body.yaw_rad)
        return (vector[0] * cos - vector[1] * sin, vector[0] * sin + vector[1] * cos, vector[2])

    # Flight

    def _fly(self) -> None:
        self._hear_radio()
        body = self.body
        if not self.is_armed:
            body.fall(STEP_S)
            return
        self._watch()
        if not self.is_armed:
            return
        if self._falls:
            body.fall(STEP_S)
            if body.is_on_ground:  # which it notices once its motors work
                self._touched_s = self.now_s
            return
        target = self._wanted()
        if not body.is_on_ground:
            self._follow(target, self._agility())
            if body.is_on_ground:
                self._touched_s = self.now_s
                self._takeoff = None
            elif self._takeoff is not None and abs(self.position[2] - self._takeoff[0]) < _TAKEOFF_REACHED_M:
                self._takeoff = None
        elif self._lifts():
            self._is_landed, self._touched_s = False, None
            self._follow(target, self._agility())
        elif self._touched_s is not None and not self._is_landed and self.now_s - self._touched_s >= _LANDED_S:
            self._is_landed = True
            self._landed_s = self.now_s
            if self.mode == AUTO:
                self.mission.landed()

    def _lifts(self) -> bool:
        """Returns whether it leaves the ground: by a take-off or by the throttle. A velocity setpoint is not enough."""
        if self.is_taking_off and self._takeoff is not None:
            return self.now_s - self._takeoff[1] >= _TAKEOFF_LIFTS_S
        if self.mode == AUTO:
            return self._is_auto_armed and self.mission.state == ACTIVE and self._wanted_up()
        return self.mode in _BY_STICKS and self.has_sticks and self.sticks.up > 0.2

    def _wanted_up(self) -> bool:
        down = self._wanted().position[2]
        return down is not None and down < self.position[2] - 0.5

    def _returns(self) -> bool:
        """Returns whether it flies home: in its mode for that, or by an item of its mission, in AUTO."""
        return self.mode == RTL or (self.mode == AUTO and self._auto_command() == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    def _lands_in_auto(self) -> bool:
        return self.mode == AUTO and self.mission.is_landing(self.position)

    def _auto_command(self) -> int:
        item = self.mission.item if self.mission.state == ACTIVE else None
        return 0 if item is None else item.command

    def _watch(self) -> None:
        """Applies failsafes and automatic disarming."""
        if self.unaided_s >= _GPS_FAILSAFE_S and self.mode in _NEEDS_POSITION:
            self.say("EKF Failsafe: changed to LAND Mode")
            self.set_mode(LAND)
        if self._has_radio and self.now_s - self.sticks_s > _RADIO_LOST_S and self.mode not in (LAND, RTL):
            self.say("Radio Failsafe - RTL")
            self.set_mode(RTL)
        was_beyond, self._is_beyond = self._is_beyond, not self._is_landed and self._is_beyond_fence(self.position)
        if self._is_beyond and not was_beyond and self.mode not in (LAND, RTL):  # once, until it is inside again
            self.say(f"{'Polygon' if self.is_beyond_zones(self.position) else 'Circle'} fence breached")
            self.set_mode(RTL)
        if self._is_landed and self._takeoff is None:
            since_s = self.now_s - max(self.armed_s, self._landed_s)
            ends = self.mode in (LAND, RTL) or self._is_mission_over()
            is_down = ends and self._landed_s > self.armed_s and since_s >= _LANDED_DISARM_S
            if is_down or since_s >= self.parameters["DISARM_DELAY"]:
                self._stop_motors()

    def _is_mission_over(self) -> bool:
        return self.mode == AUTO and self.mission.state == COMPLETE

    def _wanted(self) -> Target:
        if self.mode == GUIDED:
            return self._guided()
        if self.mode in _BY_STICKS:
            return self._by_sticks()
        if self._returns() and not self._is_over_home() and self.home is not None:
            down = self.mission.hold[2] if self.mode == AUTO else self._target.position[2]
            return replace(self._target, position=(self.home[0], self.home[1], down))
        if self.mode == AUTO and not self._returns() and not self._lands_in_auto():
            return self.mission.target(self.position, self.now_s, self._target.yaw_rad or 0.0)
        if self.mode in (LAND, RTL, AUTO):
            north, east, _ = self._target.position if self.mode != AUTO else self.position
            if not self.has_position:
                north = east = None
            return Target(
                (north, east, None), (0.0, 0.0, self.parameters["LAND_SPEED"] / 100.0), yaw_rad=self._target.yaw_rad
            )
        return self._target

    def _guided(self) -> Target:
        target = self._target
        if not self._is_timed:
            self._aim = None
            return target
        if self.now_s - self._setpoint_s > self.parameters["GUID_TIMEOUT"]:
            if any(target.velocity) or any(target.acceleration) or target.yaw_rate_rad_s:
                self._target = replace(
                    target, velocity=(0.0, 0.0, 0.0), acceleration=(0.0, 0.0, 0.0), yaw_rate_rad_s=0.0
                )
            return self._target
        north, east, down = target.position
        if north is not None and east is not None and down is not None:  # continues with its velocity
            vx, vy, vz = target.velocity
            self._target = replace(target, position=(north + vx * STEP_S, east + vy * STEP_S, down + vz * STEP_S))
        if target.position == (None, None, None):
            return self._led(target)
        self._aim = None
        return target

    def _led(self, target: Target) -> Target:
        """Returns the place to which a velocity has led so far: it shapes the velocity, and holds that place."""
        agility = self._agility()
        position, velocity = self._aim or (self.position, self.velocity)
        north, east, down = (wanted - now for wanted, now in zip(target.velocity, velocity, strict=True))
        scale = min(1.0, agility.acceleration_m_s2 / max(agility.velocity_gain * math.hypot(north, east), 1e-9))
        share, limit = agility.velocity_gain * scale * STEP_S, agility.vertical_acceleration_m_s2 * STEP_S
        down = clamp(down * agility.vertical_gain * STEP_S, -limit, limit)
        change = (north * share, east * share, down)
        velocity = plus(velocity, change)
        position = plus(position, (velocity[0] * STEP_S, velocity[1] * STEP_S, velocity[2] * STEP_S))
        self._aim = position, velocity
        acceleration = (change[0] / STEP_S, change[1] / STEP_S, change[2] / STEP_S)
        return replace(target, position=position, velocity=velocity, acceleration=acceleration)

    def _by_sticks(self) -> Target:
        sticks = self.sticks if self.has_sticks else Sticks()
        velocity = self._stick_velocity(5.0, self.setting("WPNAV_SPEED_UP"))
        is_held = math.hypot(sticks.forward, sticks.right) < 0.05 and self.mode in (LOITER, POSHOLD)
        if sticks != Sticks():
            self._stop()
        north, east, down = self._target.position
        return Target(
            (north if is_held else None, east if is_held else None, down if abs(sticks.up) < 0.05 else None),
            velocity,
            yaw_rad=None if abs(sticks.turn_right) >= 0.05 else self._target.yaw_rad,
            yaw_rate_rad_s=sticks.turn_right * 1.5,
        )

    def _is_over_home(self) -> bool:
        return self.home is None or math.dist(self.position[:2], self.home[:2]) < 1.0

    def _agility(self) -> Agility:
        p = self.setting
        return Agility(
            position_gain=1.0,
            height_gain=_TAKEOFF_GAIN if self.is_taking_off else 1.0,
            # the real one shapes its velocity like this: with a lag of the acceleration limit divided by the jerk limit
            velocity_gain=p("PSC_JERK_XY") / p("WPNAV_ACCEL"),
            vertical_gain=4.0,
            speed_m_s=self.mission.speed_m_s or p("WPNAV_SPEED") if self.mode == AUTO else p("WPNAV_SPEED"),
            climb_m_s=min(_TAKEOFF_M_S if self.is_taking_off else math.inf, p("WPNAV_SPEED_UP")),
            descent_m_s=p("WPNAV_SPEED_DN"),
            acceleration_m_s2=p("WPNAV_ACCEL"),
            vertical_acceleration_m_s2=_TAKEOFF_M_S2 if self.is_taking_off else 2.5,
            jerk_m_s3=20.0,
            yaw_gain=4.5,
            yaw_rate_rad_s=math.radians(p("ATC_SLEW_YAW")),
        )

    # The pilot's transmitter

    def _hear_radio(self) -> None:
        if self._radio is None:
            return
        for data in self._radio.receive(self.elapsed_s):
            if len(data) == 16:
                roll, pitch, throttle, yaw, switch, *_ = struct.unpack("<8H", data)
                self.sticks = Sticks(
                    (1500 - pitch) / 500.0, (roll - 1500) / 500.0, (throttle - 1500) / 500.0, (yaw - 1500) / 500.0
                )
                self.sticks_s = self.now_s
                self._has_radio = True
                self._hear_switch(sum(switch >= limit for limit in _SWITCH_LIMITS))

    def _hear_switch(self, position: int) -> None:
        """Applies a new switch position once it has lasted for a while."""
        if self._switch_seen is None or self._switch_seen[0] != position:
            self._switch_seen = (position, self.now_s)
        if self.now_s - self._switch_seen[1] >= _SWITCH_S and position != self._switch:
            self._switch = position
            self.set_mode(int(self.parameters[f"FLTMODE{position + 1}"]))

    # Messages

    def _push(self, message_id: int) -> None:
        if self.is_booting:
            return
        for channel in self.channels:
            self._stream(channel, message_id)

    def _may_stream(self, message_id: int) -> int:
        return ACCEPTED if message_id in self.builders else UNSUPPORTED

    def _builders(self) -> dict[int, Callable[[], Message | None]]:
        return {
            **super()._builders(),
            mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: self._ekf_status_report,
            mavlink.MAVLINK_MSG_ID_SIM_STATE: self._sim_state,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self._position_target,
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: self._rc_channels,
            mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self._servo_outputs,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current,
        }

    def _mission_current(self) -> Message:
        total = max(0, len(self.missions.lists[0]) - 1)
        state = {PAUSED: NOT_STARTED}.get(self.mission.state, self.mission.state)
        return mavlink.MAVLink_mission_current_message(self.mission.seq, total, state, int(self.mode == AUTO))

    def _servo_outputs(self) -> Message:
        """Its motors turn whether or not they have thrust: it does not measure that."""
        turning_us = _IDLES_US if self._is_landed else _TURNS_US
        pulse_us = turning_us if self.is_armed and not self.is_killed else STANDS_US
        pulses_us = [pulse_us] * _MOTORS_COUNT + [0] * (16 - _MOTORS_COUNT)
        return mavlink.MAVLink_servo_output_raw_message(round(self.now_s * 1e6) & 0xFFFFFFFF, 0, *pulses_us)

    def kill(self, is_killed: bool = True) -> None:
        super().kill(is_killed)
        self.say(f"RC7: MotorEStop {'HIGH' if is_killed else 'LOW'}")

    def heartbeat(self) -> Message:
        base_mode = 81 if self.mode == STABILIZE else 89
        if self.is_armed:
            base_mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        status = mavlink.MAV_STATE_STANDBY
        if self.is_armed and (not self._is_landed or self.is_taking_off):
            status = mavlink.MAV_STATE_ACTIVE
        if self._is_critical:
            status = mavlink.MAV_STATE_CRITICAL
        if self._is_booting:
            status = mavlink.MAV_STATE_BOOT
        return mavlink.MAVLink_heartbeat_message(self.kind, self.autopilot, base_mode, self.mode, status, 3)

    def _local_position(self) -> Message | None:
        return super()._local_position() if self.now_s >= self.settle_s else None

    def _origin(self) -> Message | None:
        return super()._origin() if self.now_s >= self.settle_s else None

    @property
    def more_sensors(self) -> int:
        return int(mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION) if self.has_rangefinder else 0

    @property
    def _is_booting(self) -> bool:
        return self.now_s < self._awake_s + _BOOT_S

    @property
    def unmeasured_sensors(self) -> int:
        """ArduCopter 4.6.3 calls its battery and its compass ill while it boots."""
        ill = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
        return int(ill) if self._is_booting else 0

    def _ekf_status_report(self) -> Message:
        flags = _GOOD_FLAGS if self.has_position else _NO_POSITION_FLAGS
        return mavlink.MAVLink_ekf_status_report_message(flags, 0.1, 0.1, 0.1, 0.1, 0.1)

    def _rc_channels(self) -> Message:
        others = [1500] * 4
        channels = [*others, self._switch_us, 1500, 1500, 1500, *[0] * 10]
        return mavlink.MAVLink_rc_channels_message(self.time_ms, 8, *channels, 255)

    def _position_target(self) -> Message:
        """Returns the target that it flies to, in any mode."""
        position = tuple(
            here if goal is None else goal for goal, here in zip(self._target.position, self.position, strict=True)
        )
        return mavlink.MAVLink_position_target_local_ned_message(
            self.time_ms,
            mavlink.MAV_FRAME_LOCAL_NED,
            _POSITION if self._target.position == (None, None, None) else 0,
            *position,
            *self._target.velocity,
            *self._target.acceleration,
            self._target.yaw_rad or 0.0,
            self._target.yaw_rate_rad_s,
        )

    def _to_wire(self, value: int) -> float:
        return float(value)

    def _from_wire(self, value: float) -> int:
        return round(value)
