"""What the autopilot has said, from decoded messages to snapshots. No sockets, no clock of its own."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Battery, GeoPoint, GpsFix, GpsInfo
from ual_daemon.backends.mavlink.autopilots.axes import orientation_to_enu, swap_body, swap_local
from ual_daemon.backends.mavlink.autopilots.dialect import Dialect
from ual_daemon.backends.mavlink.session.clock_offset import StampFilter
from ual_daemon.backends.mavlink.session.sequence import RunningNumber
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import NEVER_S, Estimator, LandedState, Mode, Sample, Snapshot
from ual_daemon.geodesy import Projection

ATTITUDE_LIMIT_S = 0.5
"""A position without an attitude as fresh as this is no pose."""

_LANDED = {
    mavlink.MAV_LANDED_STATE_ON_GROUND: LandedState.ON_GROUND,
    mavlink.MAV_LANDED_STATE_IN_AIR: LandedState.IN_AIR,
    mavlink.MAV_LANDED_STATE_TAKEOFF: LandedState.TAKING_OFF,
    mavlink.MAV_LANDED_STATE_LANDING: LandedState.LANDING,
}
_FIX = {
    mavlink.GPS_FIX_TYPE_2D_FIX: GpsFix.FIX_2D,
    mavlink.GPS_FIX_TYPE_3D_FIX: GpsFix.FIX_3D,
    mavlink.GPS_FIX_TYPE_DGPS: GpsFix.DIFFERENTIAL,
    mavlink.GPS_FIX_TYPE_RTK_FLOAT: GpsFix.RTK_FLOAT,
    mavlink.GPS_FIX_TYPE_RTK_FIXED: GpsFix.RTK_FIXED,
    mavlink.GPS_FIX_TYPE_STATIC: GpsFix.FIX_3D,
    mavlink.GPS_FIX_TYPE_PPP: GpsFix.FIX_3D,
}
GEO_LIMIT_S = 1.5
"""A place on Earth older than this is not told any more; all send it at 5 Hz or more."""
LATE_S = 0.3
"""A jitter as long as this reorders messages."""
OLDEST_S = 3.0
"""What has the number of an earlier message is no news for so long; then the numbers must have gone astray."""
_UNKNOWN_U16 = 0xFFFF
_TEXT_LENGTH = 50


def _mm(value: int) -> float:
    return value / 1000.0


def _degrees(value: int) -> float:
    return value / 1e7


class Telemetry:
    """The newest of each thing one autopilot said. Not thread-safe: belongs to the thread that receives.

    `now_s` is the backend's clock, `utc_now_s` the same moment as UTC.
    """

    def __init__(self, dialect: Dialect) -> None:
        self._dialect = dialect
        self._stamps = StampFilter()
        self._heard_s: float | None = None
        self._number = RunningNumber(LATE_S)
        self._told: dict[str, tuple[int, float]] = {}
        """Of each value the running number of the message that told it last, and when."""
        self._stamp_s = 0.0
        self._armed: Sample[bool] | None
        self._mode: Sample[Mode] | None
        self._landed: Sample[LandedState] | None
        self._estimator: Sample[Estimator] | None
        self._attitude: Sample[tuple[Quaternion, Vector3]] | None
        self._pose: Sample[Pose] | None
        self._velocity: Sample[Twist] | None
        self._position_geo: Sample[GeoPoint] | None
        self.forget()
        self._projection: Projection | None = None
        self._home_altitude_amsl_m: float | None = None
        self._geoid_separation_m: float | None = None
        self._battery: Battery | None = None
        self._gps: GpsInfo | None = None
        self._status_text = ""
        self._status_text_part: tuple[int, int] | None = None
        self.version: Message | None = None
        """The autopilot's AUTOPILOT_VERSION."""
        self.is_hardware_in_the_loop = False
        self.is_mode_doubtful = False
        """Whether a message that seemed to come late told of another mode: the safety pilot's, if many before it were
        lost. It should be asked for; whoever does sets this back."""
        self.is_ready_to_arm = False
        """Whether its own checks before arming pass, by its last SYS_STATUS."""
        self.parameters: dict[str, float] = {}
        self.seen: Counter[int] = Counter()
        """How many messages of which id were heard since it booted."""
        self._handlers: dict[int, Callable[[Message, float, float], None]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            mavlink.MAVLINK_MSG_ID_CURRENT_MODE: self._on_mode,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._on_extended_sys_state,
            dialect.estimator_message: self._on_estimator,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._on_attitude_quaternion,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._on_local_position_ned,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._on_global_position_int,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._on_gps_global_origin,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._on_home_position,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._on_gps_raw_int,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._on_sys_status,
            mavlink.MAVLINK_MSG_ID_STATUSTEXT: self._on_statustext,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._on_autopilot_version,
            mavlink.MAVLINK_MSG_ID_PARAM_VALUE: self._on_param_value,
        }

    def forget(self) -> None:
        """What was heard says no longer how the vehicle is; what it is, and where its frame lies, stays known."""
        self._armed = self._mode = self._estimator = self._attitude = self._pose = self._velocity = None
        self._position_geo = None
        # Where a landed state is to come, none yet must not be taken for in the air.
        self._landed = Sample(LandedState.UNKNOWN, NEVER_S) if self._dialect.tells_landed_state else None

    @property
    def used_ids(self) -> frozenset[int]:
        """Of messages that are worth decoding."""
        return frozenset(self._handlers)

    def update(self, message: Message, now_s: float, utc_now_s: float) -> None:
        """Takes a decoded message of this autopilot."""
        self.heard(message.get_seq(), now_s)
        message_id = message.get_msgId()
        handler = self._handlers.get(message_id)
        if handler is not None:
            handler(message, now_s, utc_now_s)
        self.seen[message_id] += 1

    def armed_changed(self, is_armed: bool, now_s: float) -> None:
        """It told by what was just heard, before its next heartbeat, that it was armed or disarmed."""
        if self._is_newest("armed", now_s):
            self._armed = Sample(is_armed, now_s)

    def heard(self, sequence: int, now_s: float) -> None:
        """The autopilot sent something, of this number; what it says, if that is used, is taken next."""
        self._heard_s = now_s
        self._number.take(sequence, now_s)

    @property
    def heard_s(self) -> float | None:
        """When it was last heard."""
        return self._heard_s

    @property
    def pose(self) -> Sample[Pose] | None:
        """The newest pose."""
        return self._pose

    @property
    def velocity(self) -> Sample[Twist] | None:
        """The newest velocity, which came with the newest pose."""
        return self._velocity

    @property
    def attitude_time_s(self) -> float | None:
        """When the newest attitude came."""
        return None if self._attitude is None else self._attitude.time_s

    @property
    def mode_name(self) -> str:
        """The name of its mode; empty before it has said it."""
        return "" if self._mode is None else self._mode.value.name

    @property
    def status_text(self) -> str:
        return self._status_text

    def snapshot(self, now_s: float) -> Snapshot:
        """All of it, as of now."""
        place = self._position_geo
        return Snapshot(
            time_s=now_s,
            heard_s=self._heard_s,
            stamp_s=self._stamp_s,
            armed=self._armed,
            landed=self._landed,
            mode=self._mode,
            estimator=self._estimator,
            pose=self._pose,
            velocity=self._velocity,
            position_geo=None if place is None or now_s - place.time_s > GEO_LIMIT_S else place.value,
            projection=self._projection,
            home_altitude_amsl_m=self._home_altitude_amsl_m,
            geoid_separation_m=self._geoid_separation_m,
            battery=self._battery,
            gps=self._gps,
            status_text=self._status_text,
        )

    def _is_newest(self, what: str, now_s: float) -> bool:
        """Whether what was just heard is newer than what told a value last. A late one is passed over: else a link that
        reorders them would show the mode before for a moment, as if somebody had taken the UAV.
        """
        number, last = self._number.value, self._told.get(what)
        if last is not None and number < last[0] and now_s - last[1] < OLDEST_S:
            return False
        self._told[what] = (number, now_s)
        return True

    def _on_heartbeat(self, message: Message, now_s: float, _: float) -> None:
        if self._is_newest("armed", now_s):
            self._armed = Sample(bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED), now_s)
        self.is_hardware_in_the_loop = bool(message.base_mode & mavlink.MAV_MODE_FLAG_HIL_ENABLED)
        self._on_mode(message, now_s, _)

    def _on_mode(self, message: Message, now_s: float, _: float) -> None:
        mode = self._dialect.mode(message.custom_mode)
        if self._is_newest("mode", now_s):
            self._mode = Sample(mode, now_s)
        elif self._mode is not None and mode != self._mode.value:
            self.is_mode_doubtful = True

    def _on_extended_sys_state(self, message: Message, now_s: float, _: float) -> None:
        if self._is_newest("landed", now_s):
            self._landed = Sample(_LANDED.get(message.landed_state, LandedState.UNKNOWN), now_s)

    def _on_estimator(self, message: Message, now_s: float, _: float) -> None:
        if self._is_newest("estimator", now_s):
            self._estimator = Sample(self._dialect.estimator(message.flags), now_s)

    def _on_attitude_quaternion(self, message: Message, now_s: float, _: float) -> None:
        if not self._is_newest("attitude", now_s):
            return
        w, x, y, z = message.q1, message.q2, message.q3, message.q4
        roll, pitch, yaw = message.rollspeed, message.pitchspeed, message.yawspeed
        if math.isfinite(w + x + y + z + roll + pitch + yaw) and (w, x, y, z) != (0.0, 0.0, 0.0, 0.0):
            self._attitude = Sample((orientation_to_enu(w, x, y, z), swap_body(roll, pitch, yaw)), now_s)

    def _on_local_position_ned(self, message: Message, now_s: float, utc_now_s: float) -> None:
        if not self._is_newest("position", now_s):
            return
        stamp_s = self._stamps.utc(_mm(message.time_boot_ms), now_s, utc_now_s)
        attitude = self._attitude
        if attitude is None or now_s - attitude.time_s > ATTITUDE_LIMIT_S:
            return
        x, y, z, vx, vy, vz = message.x, message.y, message.z, message.vx, message.vy, message.vz
        if math.isfinite(x + y + z + vx + vy + vz):
            orientation, rates = attitude.value
            self._stamp_s = stamp_s  # the pose's: where that is old, the stamp says so
            self._pose = Sample(Pose(swap_local(x, y, z), orientation), now_s)
            self._velocity = Sample(Twist(swap_local(vx, vy, vz), rates), now_s)

    def booted(self) -> None:
        """Forgets what belongs to the boot before; what is sampled grows old by itself."""
        self._stamps = StampFilter()
        self._number = RunningNumber(LATE_S)
        self._told.clear()
        self.seen.clear()
        self.parameters.clear()
        self.version = None
        self._projection = None
        self._home_altitude_amsl_m = None

    def _on_global_position_int(self, message: Message, now_s: float, _: float) -> None:
        if message.lat == message.lon == 0:  # before its first fix ArduPilot sends this
            self._position_geo = None
            return
        altitude_m = _mm(message.alt)
        separation_m = self._geoid_separation_m
        place = GeoPoint(
            _degrees(message.lat),
            _degrees(message.lon),
            altitude_amsl_m=altitude_m,
            altitude_home_m=_mm(message.relative_alt),
            altitude_ellipsoid_m=None if separation_m is None else altitude_m + separation_m,
        )
        self._position_geo = Sample(place, now_s)

    def _on_gps_global_origin(self, message: Message, _now_s: float, _: float) -> None:
        self._projection = self._dialect.projection(
            _degrees(message.latitude), _degrees(message.longitude), _mm(message.altitude)
        )

    def _on_home_position(self, message: Message, _now_s: float, _: float) -> None:
        self._home_altitude_amsl_m = _mm(message.altitude)

    def _on_gps_raw_int(self, message: Message, _now_s: float, _: float) -> None:
        fix = _FIX.get(message.fix_type, GpsFix.NONE)
        self._gps = GpsInfo(
            fix,
            satellites_count=0 if message.satellites_visible == 0xFF else message.satellites_visible,
            horizontal_accuracy_m=_mm(message.h_acc) or None,  # 0 where it is not known
            vertical_accuracy_m=_mm(message.v_acc) or None,
        )
        if fix >= GpsFix.FIX_3D and message.alt_ellipsoid:
            self._geoid_separation_m = _mm(message.alt_ellipsoid - message.alt)

    def _on_sys_status(self, message: Message, _now_s: float, _: float) -> None:
        self.is_ready_to_arm = bool(message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)
        voltage, current, remaining = message.voltage_battery, message.current_battery, message.battery_remaining
        battery = Battery(
            remaining_percent=None if remaining < 0 else float(remaining),
            voltage_v=None if voltage in (0, _UNKNOWN_U16) else _mm(voltage),  # 0 by ArduPilot without a monitor
            current_a=None if current < 0 else current / 100.0,  # -1 by MAVLink, -100 by PX4, where it is not known
        )
        self._battery = None if battery == Battery() else battery

    def _on_statustext(self, message: Message, _now_s: float, _: float) -> None:
        """A long text comes in parts of one id; a part that follows the last one is added to it."""
        part = (message.id, message.chunk_seq)
        before = self._status_text_part
        if message.id and before is not None and part == (before[0], before[1] + 1):
            self._status_text += message.text
        else:
            self._status_text = message.text
        self._status_text_part = part if len(message.text) == _TEXT_LENGTH else None

    def _on_autopilot_version(self, message: Message, _now_s: float, _: float) -> None:
        self.version = message

    def _on_param_value(self, message: Message, _now_s: float, _: float) -> None:
        if message.param_type == mavlink.MAV_PARAM_TYPE_REAL32 and math.isfinite(message.param_value):
            self.parameters[message.param_id] = message.param_value
