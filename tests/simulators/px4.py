"""A simulated PX4 multirotor. It behaves as PX4 1.17 with its SIH quadrotor was measured and recorded."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators import parameter_files
from tests.simulators.autopilot import (
    ACCEPTED,
    FAILED,
    REJECTED,
    STEP_S,
    UNSUPPORTED,
    Autopilot,
    Sticks,
    filler,
)
from tests.simulators.channel import Channel, RawMessage
from tests.simulators.mission_flight import ACTIVE, COMPLETE, PAUSED
from tests.simulators.mission_store import Px4Store, Sender
from tests.simulators.physics import Agility, Target, Vector, clamp, plus
from tests.simulators.ports import Port
from ual_daemon.backends.firmwares.px4_events import event_id
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.geodesy import SphereProjection


class Mode(NamedTuple):
    """PX4's main and sub mode."""

    main: int
    sub: int = 0

    @property
    def custom(self) -> int:
        """Returns the custom mode of the heartbeat."""
        return self.main << 16 | self.sub << 24


MANUAL, ALTCTL, POSCTL, OFFBOARD, STABILIZED = Mode(1), Mode(2), Mode(3), Mode(6), Mode(7)
TAKEOFF, LOITER, MISSION, RTL, LAND = Mode(4, 2), Mode(4, 3), Mode(4, 4), Mode(4, 5), Mode(4, 6)
MODES = frozenset({MANUAL, ALTCTL, POSCTL, OFFBOARD, STABILIZED, TAKEOFF, LOITER, MISSION, RTL, LAND})
_PASSING = frozenset({TAKEOFF, RTL, LAND})
"""Modes that are not kept: once disarmed, it is in the mode that was asked for before (UserModeIntention.cpp)."""
_BASE_MODE = {MANUAL: 81, ALTCTL: 81, POSCTL: 81, STABILIZED: 81, OFFBOARD: 17}
_BASE_MODE_AUTO = 29
_STANDARD_MODE = {POSCTL: 1, ALTCTL: 4, RTL: 5, LAND: 7, TAKEOFF: 8}

STREAM_LOST_S = 0.2
"""The time from the last usable setpoint until it leaves OFFBOARD, beyond COM_OF_LOSS_T."""
_STREAM_FRESH_S = 0.5
"""Most age in seconds of a setpoint for OFFBOARD to be entered."""
_SPOOL_UP_S = 1.0
_TAKEOFF_SHOWN_S = 1.75
"""The time from arming until an automatic take-off is reported as TAKEOFF, and the thrust begins to rise."""
_TAKEOFF_REACHED_M, _TAKEOFF_SHARE = 0.4, 0.8
"""Metres below its height at which an automatic take-off ends, and the part of MPC_TKO_SPEED with which it really
climbs.
"""
_OFFBOARD_FLIES_S = 2.0
"""The time from arming until it reports IN_AIR in OFFBOARD, whatever it does."""
_OFFBOARD_ENTERED_S = 0.4
"""The same, from entering OFFBOARD."""
_RAMP_S = 1.8
"""Seconds for which the thrust rises before the vehicle leaves the ground."""
_HOVERS_M = 0.12
"""Height in metres at which it hovers where its take-off was held too late, as measured."""
_LANDED_S = 3.0
"""The time from the touch-down until it reports ON_GROUND."""
_LANDED_DISARM_S = 2.0
_IDLE_DISARM_S = 10.0
_GPS_FLAGS_S, _GPS_FAILSAFE_S = 5.6, 5.3
"""The time from the loss of GPS until the estimator's flags show it, and until the failsafe."""
_CRAWL_HEIGHT_M, _CRAWL_M_S = 1.5, 0.35
_BLIND_DESCENT_M_S = 0.18
"""The speed of descent without a position."""
_UID = int.from_bytes(b"ONIDLATI", "little")
_EVENT, _EVENT_CRC_EXTRA = 410, 160
_COMPONENT_METADATA, _COMPONENT_METADATA_CRC_EXTRA = 397, 182
# Ids, log levels and arguments of events, as recorded. The id of the denial is the hash of its name.
_ARMED, _DISARMED = (0x0190CAF3, 0x66, b"\x04"), (0x01F46777, 0x66, b"\x06")
_TAKEOFF_DETECTED, _LANDING_DETECTED = (0x01414569, 0x66, b""), (0x019638AC, 0x66, b"")
_FAILSAFE_EVENTS = {
    "rc": (
        (event_id("commander_rc_lost"), 0x66, b""),
        (event_id("commander_failsafe_enter_hold"), 0x42, bytes.fromhex("0000060006050001")),
        (event_id("commander_failsafe_enter_generic"), 0x42, bytes.fromhex("0000060006000000")),
    ),
    "battery": (
        (event_id("check_battery_critical"), 0x22, bytes.fromhex("ffffffff0b000000")),
        (event_id("commander_failsafe_enter_hold"), 0x42, bytes.fromhex("0000060006050004")),
        (event_id("commander_failsafe_enter"), 0x42, bytes.fromhex("0000060006040000")),
    ),
    "fence": (
        (event_id("check_gf_violation_max_hor_dist"), 0x33, bytes.fromhex("ffffffff14000000")),
        (event_id("commander_failsafe_enter_generic_hold"), 0x42, bytes.fromhex("0000060006050000")),
        (event_id("commander_failsafe_enter_generic"), 0x42, bytes.fromhex("0000060006000000")),
    ),
}
"""Events that trigger a failsafe, its Hold, and the events that follow after 5 s, as recorded."""
_NO_POSITION = (event_id("check_modes_local_pos"), 0x22, bytes.fromhex("ffffffff00000000"))
"""By its source."""
_FAILSAFE_HOLD_S = 5.0
_FAILSAFE = (0x01C2DC72, 0x42, b"\x00\x06\x00\x03")
_ARMING_DENIED = (event_id("commander_arm_denied_resolve_failures"), 0x22, b"")
_UNKNOWN = {8: (b"\xa0\x89\x3f" + bytes(17) + b"\x01", 117), 380: (bytes(4) + b"\xff" * 16, 232), 411: (b"\x02", 106)}
"""Messages that PX4 sends and pymavlink does not know: LINK_NODE_STATUS, TIME_ESTIMATE_TO_TARGET,
CURRENT_EVENT_SEQUENCE; with the seeds of their checksums.
"""
_FAILING = {"rc": mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER, "battery": mavlink.MAV_SYS_STATUS_SENSOR_BATTERY}
"""The sensors of SYS_STATUS that fail with it; PX4's fence has none."""
_STATUS_S = 0.5
"""The period at which vehicle_status is published when nothing changes."""

_RATES_HZ: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 100.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 50.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 50.0,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: 50.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 30.0,
    mavlink.MAVLINK_MSG_ID_ODOMETRY: 30.0,
    mavlink.MAVLINK_MSG_ID_ALTITUDE: 10.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 10.0,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: 10.0,
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: 10.0,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 10.0,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 10.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 8.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 5.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_PING: 1.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
    mavlink.MAVLINK_MSG_ID_GNSS_INTEGRITY: 1.0,
    mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION: 1.0,
    mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM: 1.0,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: 1.0,  # only on a change
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
    mavlink.MAVLINK_MSG_ID_CURRENT_MODE: 0.5,
    mavlink.MAVLINK_MSG_ID_VIBRATION: 0.5,
    8: 1.0,
    380: 0.5,
    411: 0.33,
}
_UNREAD = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
        mavlink.MAVLINK_MSG_ID_ODOMETRY,
        mavlink.MAVLINK_MSG_ID_ALTITUDE,
        mavlink.MAVLINK_MSG_ID_VFR_HUD,
        mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
    }
)
"""Messages that come often and the daemon does not read: half of all that a PX4 sends."""
_TERSE_RATES_HZ = {mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0}
"""Messages that come more often than needed, and their rates instead."""
_TERSE_MOST_HZ = {
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 12.5,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 10.0,
}
"""Highest rates of messages that the daemon asks for."""
_OTHER_RATES_HZ = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0}
_GROUND_STATION_RATES_HZ: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 10.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0,
}
_USED = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
        mavlink.MAVLINK_MSG_ID_CURRENT_MODE,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
    }
)
_EV_POSITION = 1
_EVERY_POSITION, _EVERY_VELOCITY, _EVERY_ACCELERATION = 0b111, 0b111 << 3, 0b111 << 6
_FORCE, _NO_YAW, _NO_YAW_RATE = 1 << 9, 1 << 10, 1 << 11


class Px4(Autopilot):
    """A PX4 whose `onboard` link is the companion's and whose `ground` link, if there is one, is the ground station's.

    It starts on the ground `start` from its origin, in AUTO.LOITER, `boot_s` after it has booted. With `is_terse` it
    leaves out what the daemon does not read, so that flights cost less.
    """

    autopilot = mavlink.MAV_AUTOPILOT_PX4
    external_pose_message = mavlink.MAVLINK_MSG_ID_ODOMETRY
    make_store = Px4Store
    missions: Px4Store
    flight_sw_version = 0x011100FF  # 1.17.0

    def __init__(
        self,
        onboard: Port,
        ground: Port | None = None,
        *,
        other: Port | None = None,
        system_id: int = 1,
        start: Vector = (0.03, -0.15, -0.37),
        boot_s: float = 4.0,
        seed: int = 0,
        wander_m: float = 0.0,
        is_terse: bool = False,
    ) -> None:
        rates_hz = _RATES_HZ
        if is_terse:
            rates_hz = {each: rate for each, rate in _RATES_HZ.items() if each not in _UNREAD} | _TERSE_RATES_HZ
        channels = [Channel(onboard, rates_hz, most_hz=_TERSE_MOST_HZ if is_terse else None)]
        if ground is not None:
            channels.append(Channel(ground, _GROUND_STATION_RATES_HZ, forwards=True))
        if other is not None:
            channels.append(Channel(other, _OTHER_RATES_HZ))
        super().__init__(
            channels,
            SphereProjection(47.3977428, 8.5455967, 489.052),
            system_id=system_id,
            start=start,
            boot_s=boot_s,
            seed=seed,
            wander_m=wander_m,
        )
        self.uid = _UID + system_id - 1

    def default_parameters(self) -> dict[str, float]:
        return {
            "MPC_XY_VEL_MAX": 12.0,
            "MPC_Z_VEL_MAX_UP": 3.0,
            "MPC_Z_VEL_MAX_DN": 1.5,
            "MPC_ACC_HOR": 3.0,
            "MPC_ACC_UP_MAX": 4.0,
            "MPC_ACC_DOWN_MAX": 3.0,
            "MPC_YAWRAUTO_MAX": 60.0,
            "MPC_TKO_SPEED": 1.5,
            "MPC_LAND_SPEED": 0.7,
            "MIS_TAKEOFF_ALT": 2.5,
            "COM_RC_OVERRIDE": 1,
            "EKF2_EV_CTRL": 0,
            "MPC_XY_CRUISE": 5.0,
            "MPC_XY_VEL_P_ACC": 1.8,
            "MPC_XY_VEL_D_ACC": 0.0,
            "MPC_Z_VEL_P_ACC": 3.0,
            "MPC_Z_VEL_D_ACC": 0.0,
            "COM_OF_LOSS_T": 1.0,
            "GF_ACTION": 2,
            "SIM_GPS_USED": 10,
            "GF_MAX_HOR_DIST": 0.0,
            "GF_MAX_VER_DIST": 0.0,
            "COM_DISARM_LAND": _LANDED_DISARM_S,
            "COM_DISARM_PRFLT": _IDLE_DISARM_S,
            "NAV_DLL_ACT": 0,
            "COM_DLL_EXCEPT": 0,
        }

    def _boot(self, boot_s: float) -> None:
        super()._boot(boot_s)
        self.intention = self._after_disarming = LOITER
        self.mission = self._new_mission(0)
        self.failsafe: Mode | None = None
        self._failsafe_kind = ""
        self._mode_s = boot_s
        self._setpoint = self._flown = Target()
        self.setpoint_s = -math.inf
        self._lands_by_failsafe = False
        self._is_landed = True
        self._has_flown = False
        self._touched_s: float | None = None
        self._landed_s = -math.inf
        self._ramp_s = 0.0
        self._hold: Vector = self.position
        self._hold_yaw_rad = self.body.yaw_rad
        self._takeoff_z_m = 0.0
        self._events_count = 0
        self._status_s = {id(channel): -math.inf for channel in self.channels}
        self._status_changed_s = boot_s
        self._streamed_origin: dict[int, object] = {}

    def uses(self, message: Message) -> bool:
        is_pose = message.frame_id == mavlink.MAV_FRAME_LOCAL_NED and all(map(math.isfinite, message.q))
        return is_pose and bool(int(self.parameters["EKF2_EV_CTRL"]) & _EV_POSITION)

    # State

    @property
    def mode(self) -> Mode:
        """The mode that is flown: the requested one, or a failsafe's."""
        return self.failsafe or self.intention

    @property
    def is_ready_to_arm(self) -> bool:
        return self.is_aided and not self.arm_refusal

    @property
    def has_stream(self) -> bool:
        """Whether usable setpoints come."""
        return self.now_s - self.setpoint_s <= _STREAM_FRESH_S

    @property
    def landed_state(self) -> int:
        if not self.is_armed:
            return int(mavlink.MAV_LANDED_STATE_ON_GROUND)
        if self.mode == TAKEOFF and self.now_s - self.armed_s >= _TAKEOFF_SHOWN_S:
            return int(mavlink.MAV_LANDED_STATE_TAKEOFF)
        if self._is_landed:
            return int(mavlink.MAV_LANDED_STATE_ON_GROUND)
        if self.mode == MISSION and self.mission.is_taking_off:
            return int(mavlink.MAV_LANDED_STATE_TAKEOFF)
        if self.mode == LAND or (self.mode == RTL and self._is_over_home()):  # a return that is far is in the air
            return int(mavlink.MAV_LANDED_STATE_LANDING)
        return int(mavlink.MAV_LANDED_STATE_IN_AIR)

    # Modes and arming

    def request_mode(self, mode: Mode) -> bool:
        """Handles a request for a mode by the ground station, the pilot or the companion. Returns whether it was
        accepted.
        """
        if mode not in MODES:
            return False
        if mode == OFFBOARD and self.is_armed and not self.has_stream:
            return False
        if mode == MISSION and self.is_armed and not self.missions.lists[0]:
            return False
        if mode in (POSCTL, LOITER, MISSION, RTL, TAKEOFF, OFFBOARD) and self.is_armed and not self.is_aided:
            return False
        if mode in (MANUAL, ALTCTL, POSCTL, STABILIZED) and self.is_armed and not self.has_sticks:
            return False
        if mode == TAKEOFF:
            self._takeoff_z_m = self.position[2] - self.parameters["MIS_TAKEOFF_ALT"]
        was, self.failsafe = self.mode, None
        self._intend(mode)
        self._failsafe_kind = ""
        self._entered(was)
        return True

    def _intend(self, mode: Mode) -> None:
        self.intention = mode
        if mode not in _PASSING:
            self._after_disarming = mode

    def _fall_back(self, failsafe: Mode | None) -> None:
        was = self.mode
        if failsafe is not None:
            self._event(*_FAILSAFE)
        self.failsafe = failsafe
        self._entered(was)

    def trigger_failsafe(self, kind: str) -> None:
        """Triggers a failsafe as recorded: "rc", "battery" or "fence". It holds, and returns 5 s later."""
        with self.lock:
            trigger, holds, returns = _FAILSAFE_EVENTS[kind]
            self.failing_sensors |= _FAILING.get(kind, 0)
            self._event(*trigger)
            self._event(*holds)
            was, self.failsafe, self._failsafe_kind = self.mode, LOITER, kind
            self._entered(was)
            self.at(_FAILSAFE_HOLD_S, lambda: self._return_by_failsafe(kind, returns))

    def end_failsafe(self) -> None:
        """The transmitter is heard again, the battery is another one, it is inside the fence."""
        with self.lock:
            self.failing_sensors = 0

    def _return_by_failsafe(self, kind: str, event: tuple[int, int, bytes]) -> None:
        if self._failsafe_kind == kind and self.failsafe == LOITER:
            self._event(*event)
            was, self.failsafe = self.mode, RTL
            self._entered(was)

    def _entered(self, was: Mode) -> None:
        if self.mode == was:
            return
        self._mode_s = self._status_changed_s = self.now_s
        self._hold, self._hold_yaw_rad = self._stopping_point(), self.body.yaw_rad
        if was == MISSION:
            self.mission.leave()
        if self.mode == MISSION:
            self.mission.begin(self._hold)

    def _turn_targets(self, by_rad: float) -> None:
        self._hold_yaw_rad += by_rad

    def _shift_targets(self, offset: Vector) -> None:
        self._hold = plus(self._hold, offset)
        self._takeoff_z_m += offset[2]

    def _stopping_point(self) -> Vector:
        """Returns where it comes to rest if it brakes now."""
        limits = self.parameters["MPC_ACC_HOR"], self.parameters["MPC_ACC_HOR"], self.parameters["MPC_ACC_UP_MAX"]
        north, east, down = (
            p + v * abs(v) / (2.0 * limit) for p, v, limit in zip(self.position, self.velocity, limits, strict=True)
        )
        return (north, east, down)

    def arm(self, *, is_forced: bool) -> int:
        if self.is_armed:
            return ACCEPTED
        if not is_forced:
            if not self.is_ready_to_arm:
                return self._deny_arming(self.arm_refusal or "no valid global position")
            if self.intention in (LAND, RTL) or (self.intention == OFFBOARD and not self.has_stream):
                return self._deny_arming("switch to another mode first")
        self.is_armed = True
        self.armed_s = self._status_changed_s = self.now_s
        self._is_landed, self._has_flown, self._touched_s, self._ramp_s = True, False, None, 0.0
        if self.has_satellites:
            self.home = self.position
        if self.mode == TAKEOFF:
            self._takeoff_z_m = self.position[2] - self.parameters["MIS_TAKEOFF_ALT"]
        if self.mode == MISSION:  # it flies it, and from its first item, however far it was
            self.mission.reset()
            self.mission.begin(self.position)
        self._event(*_ARMED)
        return ACCEPTED

    def _deny_arming(self, why: str) -> int:
        self._event(*_ARMING_DENIED)
        self.say(f"Arming denied: {why}")
        return REJECTED

    def disarm(self, *, is_forced: bool) -> int:
        if self.is_armed and not is_forced and not self._is_landed:
            return REJECTED
        self._stop_motors()
        return ACCEPTED

    def _stop_motors(self) -> None:
        was = self.mode
        self.is_armed = False
        self.failsafe = None
        self._is_landed = True
        self.intention = self._after_disarming
        self._status_changed_s = self.now_s
        self._event(*_DISARMED)
        self._entered(was)

    def _mission_current(self) -> Message:
        """Returns how far it tells that its mission is: untruths of the real one, too."""
        state = self.mission.state
        if state in (ACTIVE, PAUSED) and not self.is_armed:
            state = COMPLETE
        elif state == PAUSED and self.mission.begins_count > 1:
            state = ACTIVE
        return self.missions.current(self.mission.seq, state)

    def pilot_readies(self) -> None:
        with self.lock:
            if not self.is_armed and self.intention in (OFFBOARD, LAND, RTL):
                self.request_mode(LOITER)

    def pilot_take_over(self) -> None:
        with self.lock:
            self.pilot_moves(Sticks())
            self.request_mode(POSCTL)

    def request_custom_mode(self, custom_mode: int) -> None:
        self.request_mode(Mode(custom_mode >> 16 & 0xFF, custom_mode >> 24))

    def _command(self, command: int, params: tuple[float, ...], sender: Sender) -> int | None:
        if command == mavlink.MAV_CMD_DO_SET_MODE:
            self._acknowledge(command, ACCEPTED, sender)  # it was received; the commander's answer follows
            mode = Mode(int(params[1]), int(params[2]))
            result = ACCEPTED if self.request_mode(mode) else REJECTED
            self.at(STEP_S, lambda: self._acknowledge(command, result, sender))
            return None
        if command == mavlink.MAV_CMD_NAV_TAKEOFF:
            is_taken = self.request_mode(TAKEOFF)
            if is_taken and math.isfinite(params[6]):
                self._takeoff_z_m = self.projection.altitude_amsl_m - params[6]
            return ACCEPTED if is_taken else REJECTED
        if command in (mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH):
            mode = LAND if command == mavlink.MAV_CMD_NAV_LAND else RTL
            return ACCEPTED if self.request_mode(mode) else REJECTED
        return UNSUPPORTED

    # Setpoints

    def _on_local_target(self, message: Message, sender: Sender) -> None:
        self.setpoints_s.append(self.elapsed_s)
        self.setpoint_senders.append((sender.system_id, sender.component_id))
        target = self._usable(message)
        if target is not None:
            self._setpoint, self.setpoint_s = target, self.now_s

    def _usable(self, message: Message) -> Target | None:
        """Returns the target of a setpoint; None for one that PX4 ignores silently."""
        mask, frame = message.type_mask, message.coordinate_frame
        has_position = mask & _EVERY_POSITION != _EVERY_POSITION
        has_velocity = mask & _EVERY_VELOCITY != _EVERY_VELOCITY
        has_acceleration = mask & _EVERY_ACCELERATION != _EVERY_ACCELERATION
        if frame == mavlink.MAV_FRAME_BODY_NED:
            if has_position or not has_velocity:
                return None
        elif frame != mavlink.MAV_FRAME_LOCAL_NED or mask & _FORCE:
            return None
        if not (has_position or has_velocity or has_acceleration):
            return None

        def part(first_bit: int, *values: float) -> list[float | None]:
            return [None if mask >> (first_bit + axis) & 1 else value for axis, value in enumerate(values)]

        position = part(0, message.x, message.y, message.z)
        velocity = part(3, message.vx, message.vy, message.vz)
        acceleration = part(6, message.afx, message.afy, message.afz)
        if not all(math.isfinite(each) for each in (*position, *velocity, *acceleration) if each is not None):
            return None
        if frame == mavlink.MAV_FRAME_BODY_NED:
            cos, sin = math.cos(self.body.yaw_rad), math.sin(self.body.yaw_rad)
            forward, right = velocity[0] or 0.0, velocity[1] or 0.0
            velocity[:2] = [forward * cos - right * sin, forward * sin + right * cos]
        yaw_rad = message.yaw
        if mask & _NO_YAW:  # with neither a heading nor a rate it keeps its heading
            yaw_rad = self.body.yaw_rad if mask & _NO_YAW_RATE else None
        return Target(
            (position[0], position[1], position[2]),
            (velocity[0] or 0.0, velocity[1] or 0.0, velocity[2] or 0.0),
            (acceleration[0] or 0.0, acceleration[1] or 0.0, acceleration[2] or 0.0),
            yaw_rad,
            0.0 if mask & _NO_YAW_RATE else message.yaw_rate,
        )

    # Flight

    def _fly(self) -> None:
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
        target = self._flown = self._target()
        if body.is_on_ground:
            self._stand(target)
        else:
            self._follow(target, self._agility())
            if body.is_on_ground:
                self._touched_s = self.now_s
                self._ramp_s = 0.0

    def _stand(self, target: Target) -> None:
        """Handles the ground: the thrust rises while the target is above it, until the vehicle leaves the ground.

        Once it rises, a Hold does not end that (TakeoffHandling): the vehicle lifts off, and hovers.
        """
        goal_z_m = target.position[2]
        wants_up = target.velocity[2] < -0.05 or (goal_z_m is not None and goal_z_m < self.position[2] - 0.15)
        spool_up_s = _TAKEOFF_SHOWN_S if self.mode == TAKEOFF else _SPOOL_UP_S
        is_held_too_late = self.mode == LOITER and self._ramp_s > 0.0
        if is_held_too_late or (wants_up and self.now_s - self.armed_s >= spool_up_s and self.mode not in (LAND, RTL)):
            self._ramp_s += STEP_S
            self._touched_s = None
        else:
            self._ramp_s = 0.0
        if self._touched_s is not None and self.now_s - self._touched_s >= _LANDED_S and not self._is_landed:
            self._is_landed = True
            self._landed_s = self.now_s
            self._event(*_LANDING_DETECTED)
            if self.mode == MISSION:
                self.mission.landed()
        elif self._is_landed and self._touched_s is None:
            armed_s = self.now_s - self.armed_s
            entered_s = self.now_s - self._mode_s
            flies = self.mode == OFFBOARD and armed_s >= _OFFBOARD_FLIES_S and entered_s >= _OFFBOARD_ENTERED_S
            if flies and self.has_stream:
                self._is_landed = False
                self._event(*_TAKEOFF_DETECTED)
        if self._ramp_s >= _RAMP_S:
            if self._is_landed:
                self._event(*_TAKEOFF_DETECTED)
            self._is_landed = False
            self._has_flown = True
            if is_held_too_late:
                self._hold = plus(self._hold, (0.0, 0.0, -_HOVERS_M))
            self._follow(self._target(), self._agility())

    def _watch(self) -> None:
        """Applies failsafes and automatic disarming."""
        silence_s = self.now_s - self.setpoint_s
        is_blind = self.unaided_s >= _GPS_FAILSAFE_S
        wanted = self.failsafe
        if is_blind and self.intention not in (ALTCTL, STABILIZED, MANUAL):
            wanted = ALTCTL
            if self.failsafe != ALTCTL:
                self._event(*_NO_POSITION)
        elif self.intention == OFFBOARD and silence_s > self.parameters["COM_OF_LOSS_T"] + STREAM_LOST_S:
            wanted = self.failsafe or (POSCTL if self.has_sticks else RTL)
        elif self.intention == OFFBOARD and self.failsafe is not None and self.has_stream and not self._failsafe_kind:
            wanted = None  # when the stream is back, OFFBOARD returns by itself
        if wanted != self.failsafe:
            self._fall_back(wanted)
        is_guarded = self.parameters["GF_ACTION"] and self.mode not in (RTL, LAND) and not self._failsafe_kind
        if is_guarded and not self._is_landed and self.is_beyond_zones(self.position):
            self.trigger_failsafe("fence")
        if self._is_landed:
            is_landed_long = self._has_flown and self.now_s - self._landed_s >= self.parameters["COM_DISARM_LAND"]
            is_idle_long = not self._has_flown and self.now_s - self.armed_s >= self.parameters["COM_DISARM_PRFLT"]
            if is_landed_long or is_idle_long:
                self._stop_motors()

    def _target(self) -> Target:
        mode = self.mode
        if mode == OFFBOARD:
            return self._setpoint
        if mode in (POSCTL, ALTCTL, STABILIZED, MANUAL):
            return self._by_sticks(mode)
        if mode == MISSION:
            return self._by_mission()
        north, east, _ = self._hold
        if mode == TAKEOFF:
            if self.position[2] <= self._takeoff_z_m + _TAKEOFF_REACHED_M:
                self._intend(LOITER)
                self._entered(TAKEOFF)
                self._hold = (north, east, self._takeoff_z_m)
            return Target((north, east, self._takeoff_z_m), yaw_rad=self._hold_yaw_rad)
        if mode == RTL and self.home is not None:
            north, east = self.home[:2]
            if not self._is_over_home():
                return Target((north, east, self._hold[2]), yaw_rad=self._hold_yaw_rad)
        if mode in (LAND, RTL):
            height_m = self.body.ground_z_m - self.body.position[2]
            speed_m_s = self.parameters["MPC_LAND_SPEED"]
            down = speed_m_s if height_m > _CRAWL_HEIGHT_M else min(speed_m_s, _CRAWL_M_S * speed_m_s / 0.7)
            return Target((north, east, None), (0.0, 0.0, down), yaw_rad=self._hold_yaw_rad)
        return Target(self._hold, yaw_rad=self._hold_yaw_rad)

    def _is_over_home(self) -> bool:
        return self.home is None or math.dist(self.position[:2], self.home[:2]) <= 1.0

    def _by_mission(self) -> Target:
        """Flies its mission. It holds after the end of it, and returns in its own mode for that."""
        mission = self.mission
        if mission.is_landing(self.position) or (self._is_landed and mission.state == COMPLETE):
            north, east, _ = self._mission_position(mission.item) if mission.item is not None else self._hold
            return Target(
                (north, east, None), (0.0, 0.0, self.parameters["MPC_LAND_SPEED"]), yaw_rad=self._hold_yaw_rad
            )
        target = mission.target(self.position, self.now_s, self._hold_yaw_rad)
        is_return = mission.item is not None and mission.item.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
        if is_return or (mission.state == COMPLETE and not self._is_landed):
            was = self.mode
            self._intend(RTL if is_return else LOITER)
            self._entered(was)
            self._status_changed_s = self.now_s
            return self._target()
        return target

    def _by_sticks(self, mode: Mode) -> Target:
        if self.failsafe == ALTCTL:  # without a position: descends, and drifts with the wind
            return Target((None, None, None), (0.0, 0.0, _BLIND_DESCENT_M_S), yaw_rad=self._hold_yaw_rad)
        velocity = self._stick_velocity(self.parameters["MPC_XY_VEL_MAX"] * 0.8, self.parameters["MPC_Z_VEL_MAX_UP"])
        sticks = self.sticks
        if sticks != Sticks():
            self._hold, self._hold_yaw_rad = self._stopping_point(), self.body.yaw_rad
        north, east, down = self._hold
        is_level = math.hypot(sticks.forward, sticks.right) < 0.05 and mode == POSCTL
        return Target(
            (north if is_level else None, east if is_level else None, down if abs(sticks.up) < 0.05 else None),
            velocity,
            yaw_rad=None if abs(sticks.turn_right) >= 0.05 else self._hold_yaw_rad,
            yaw_rate_rad_s=sticks.turn_right * 1.5,
        )

    def _agility(self) -> Agility:
        p = self.parameters
        climb_m_s = _TAKEOFF_SHARE * p["MPC_TKO_SPEED"] if self.mode == TAKEOFF else p["MPC_Z_VEL_MAX_UP"]
        is_own = self.mode != OFFBOARD  # its own trajectories keep its limits; it follows setpoints without them
        return Agility(
            position_gain=0.95,
            height_gain=1.0,
            velocity_gain=p["MPC_XY_VEL_P_ACC"],
            vertical_gain=p["MPC_Z_VEL_P_ACC"],
            speed_m_s=self.mission.speed_m_s or p["MPC_XY_CRUISE"] if self.mode == MISSION else p["MPC_XY_VEL_MAX"],
            climb_m_s=clamp(climb_m_s, 0.0, p["MPC_Z_VEL_MAX_UP"]),
            descent_m_s=p["MPC_Z_VEL_MAX_DN"],
            acceleration_m_s2=p["MPC_ACC_HOR"] if is_own else 8.0,
            vertical_acceleration_m_s2=p["MPC_ACC_UP_MAX"],
            jerk_m_s3=60.0,
            yaw_gain=2.8,
            yaw_rate_rad_s=3.0,
        )

    # Messages

    def _hears_texts(self, channel: Channel) -> bool:
        return channel.has_ground_station(self.elapsed_s)

    def _may_stream(self, message_id: int) -> int:
        return ACCEPTED if message_id in self.builders and message_id != 0 else FAILED

    def _builders(self) -> dict[int, Callable[[], Message | None]]:
        others = {each: filler(each) for each in _RATES_HZ if each not in _USED and each not in _UNKNOWN}
        remote_id = filler(mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM)
        return {
            **others,
            **super()._builders(),
            mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: self._hil_state,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: self._estimator_status,
            mavlink.MAVLINK_MSG_ID_CURRENT_MODE: self._current_mode,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current,
            mavlink.MAVLINK_MSG_ID_ODOMETRY: self._odometry,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self._position_target,
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: lambda: None,  # accepted; without a transmitter none comes
            # reports the position of the pilot, from GPS
            mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM: lambda: remote_id() if self.is_gps_good else None,
            _COMPONENT_METADATA: self._component_metadata,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: lambda: mavlink.MAVLink_system_time_message(0, self.time_ms),
        }

    def _position_target(self) -> Message:
        """Returns the target that its position controller flies to; on the ground it has none."""
        target = Target() if self._is_landed else self._flown
        velocity = (math.nan,) * 3 if self._is_landed else target.velocity
        position = tuple(math.nan if each is None else each for each in target.position)
        mask = sum(1 << bit for bit, each in enumerate((*position, *velocity)) if math.isnan(each))
        return mavlink.MAVLink_position_target_local_ned_message(
            self.time_ms,
            mavlink.MAV_FRAME_LOCAL_NED,
            mask,
            *position,
            *velocity,
            *target.acceleration,
            math.nan if target.yaw_rad is None else target.yaw_rad,
            target.yaw_rate_rad_s,
        )

    def _component_metadata(self) -> Message:
        files, crc = parameter_files.described()
        self.files.files.update(files)
        uri = f"mftp://{parameter_files.GENERAL}".encode()
        return RawMessage(
            _COMPONENT_METADATA, struct.pack("<II100s", self.time_ms, crc, uri), _COMPONENT_METADATA_CRC_EXTRA
        )

    def _stream(self, channel: Channel, message_id: int) -> None:
        if message_id == mavlink.MAVLINK_MSG_ID_CURRENT_MODE:
            # As often as asked for, but no more often than it is published: on a change, or twice a second; in a
            # failsafe, and without a position, always.
            last_s = self._status_s[id(channel)]
            is_steady = self.failsafe is None and self.unaided_s < _GPS_FAILSAFE_S
            if is_steady and self._status_changed_s < last_s and self.now_s - last_s < _STATUS_S - 1e-9:
                return
            self._status_s[id(channel)] = self.now_s
        if message_id == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN:
            if self._streamed_origin.get(id(channel)) == self.projection:
                return
            self._streamed_origin[id(channel)] = self.projection
        if message_id in _UNKNOWN:
            payload, crc_extra = _UNKNOWN[message_id]
            channel.send_raw(message_id, payload, crc_extra, self.elapsed_s)
        else:
            super()._stream(channel, message_id)

    def _event(self, number: int, levels: int, arguments: bytes) -> None:
        """Sends an event of PX4's event interface, at once and on all links."""
        self._events_count += 1
        payload = struct.pack("<IIHBBB", number, self.time_ms, self._events_count, 0, 0, levels) + arguments
        for channel in self.channels:
            channel.send_raw(_EVENT, payload, _EVENT_CRC_EXTRA, self.elapsed_s)

    def heartbeat(self) -> Message:
        base_mode = _BASE_MODE.get(self.mode, _BASE_MODE_AUTO)
        if self.is_armed:
            base_mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        if self.failsafe is not None:
            status = mavlink.MAV_STATE_CRITICAL
        elif self.is_armed:
            status = mavlink.MAV_STATE_ACTIVE
        else:
            status = mavlink.MAV_STATE_STANDBY if self.is_ready_to_arm else mavlink.MAV_STATE_UNINIT
        if self.is_killed:
            status = mavlink.MAV_STATE_FLIGHT_TERMINATION
        return mavlink.MAVLink_heartbeat_message(self.kind, self.autopilot, base_mode, self.mode.custom, status, 3)

    def _current_mode(self) -> Message:
        standard = _STANDARD_MODE.get(self.mode, 0)
        return mavlink.MAVLink_current_mode_message(standard, self.mode.custom, self.intention.custom)

    def _odometry(self) -> Message:
        return mavlink.MAVLink_odometry_message(
            round(self.now_s * 1e6),
            mavlink.MAV_FRAME_LOCAL_NED,
            mavlink.MAV_FRAME_BODY_FRD,
            *self.position,
            list(self._quaternion()),
            *self.velocity,
            0.0,
            0.0,
            self.body.yaw_rate_rad_s,
            [math.nan] * 21,
            [math.nan] * 21,
            reset_counter=self.resets_count % 256,
        )

    def _estimator_status(self) -> Message:
        if self.unaided_s >= _GPS_FLAGS_S:
            flags = 0x365
        elif not self.is_armed:
            flags = 0x3FF
        else:
            flags = 0x33F if self.body.is_on_ground else 0x37F
        return mavlink.MAVLink_estimator_status_message(
            round(self.now_s * 1e6), flags, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.5, 0.5
        )
