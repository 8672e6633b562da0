"""The newest data of one autopilot: from decoded messages to snapshots. No sockets, no clock of its own."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Battery, GeoPoint, GpsFix, GpsInfo, Health
from ual_daemon.backends.engine.agreement import Agreement, AirborneWatch
from ual_daemon.backends.engine.boot_time import has_wrapped
from ual_daemon.backends.engine.clock_offset import ClockOffset
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.engine.readings import Reading, Readings, Valid
from ual_daemon.backends.firmwares.batteries import Batteries
from ual_daemon.backends.firmwares.fence_reader import FenceReader
from ual_daemon.backends.firmwares.home_watch import HomeWatch
from ual_daemon.backends.firmwares.local_origin import LocalOrigin
from ual_daemon.backends.mavlink.dialects.axes import frd_to_flu, ned_to_enu, orientation_to_enu
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.corrections_injection import NO_CORRECTIONS, CorrectionsAge
from ual_daemon.backends.mavlink.session.conversions import (
    battery,
    battery_status,
    degrees,
    geo_point,
    gps_info,
    landed_state,
    milli,
)
from ual_daemon.backends.mavlink.session.mode_names import ModeNames
from ual_daemon.backends.mavlink.session.sequence import SequenceUnwrapper
from ual_daemon.backends.mavlink.session.status_text import StatusText
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import (
    NEVER_S,
    Condition,
    ControlState,
    EarthReference,
    Estimator,
    LandedState,
    LinkState,
    Mode,
    MotionState,
    Sample,
    SevereText,
    Snapshot,
)

ATTITUDE_LIMIT_S = 0.5
"""A position is a pose only with an attitude that is not older than this."""
GEO_LIMIT_S = 1.5
"""A position on Earth that is older than this is left out; all autopilots send it at 5 Hz or more."""
LATE_MESSAGE_S = 0.3
"""A jitter of this much reorders messages."""
LONGEST_REORDERING_S = 3.0
"""Seconds for which a message with an earlier sequence number is ignored; after that the numbers must be wrong."""


class _Home(NamedTuple):
    """Position of home: its latitude and longitude may not be known."""

    altitude_amsl_m: float
    place: GeoPoint | None


class AutopilotTelemetry:
    """The newest of each value that one autopilot sent. Not thread-safe: belongs to the thread that receives.

    `now_s` is the backend's clock, `utc_now_s` the same moment as UTC.
    """

    def __init__(self, dialect: Dialect, boots_count: int = 1, flight: AirborneWatch | None = None) -> None:
        self._dialect = dialect
        self._boots_count = boots_count
        self.mode_names = ModeNames(dialect)
        self.plausibility = Plausibility()
        self._clock_offset = ClockOffset()
        self.heard_s: float | None = None
        """Time of its last frame."""
        self._sequence = SequenceUnwrapper(LATE_MESSAGE_S)
        self._stamp_s = self._measured_s = 0.0
        readings = self._readings = Readings()
        # Where a landed state is sure to come, its absence must not be taken for flying.
        not_landed = Sample(LandedState.UNKNOWN, NEVER_S) if dialect.sends_landed_state else None
        self.armed: Reading[bool] = readings.add(Valid.WHILE_HEARD)
        self.mode: Reading[Mode] = readings.add(Valid.WHILE_HEARD)
        self.landed: Reading[LandedState] = readings.add(Valid.WHILE_HEARD, unknown=not_landed)
        self.estimator: Reading[Estimator] = readings.add(Valid.WHILE_HEARD)
        self._attitude: Reading[tuple[Quaternion, Vector3]] = readings.add(Valid.WHILE_HEARD, limit_s=ATTITUDE_LIMIT_S)
        self._angles: Reading[None] = readings.add(Valid.WHILE_HEARD)
        """The same from angles: only its order."""
        self.pose: Reading[Pose] = readings.add(Valid.WHILE_HEARD)
        self.velocity: Reading[Twist] = readings.add(Valid.WHILE_HEARD)
        """Came with the pose."""
        self._position_geo: Reading[GeoPoint] = readings.add(Valid.WHILE_HEARD, limit_s=GEO_LIMIT_S)
        self._home: Reading[_Home] = readings.add(Valid.UNTIL_REBOOT)
        self.origin = LocalOrigin()
        """Position of its local frame on Earth."""
        self.home_watch = HomeWatch()
        """Whether home is to be requested, as it is elsewhere now."""
        self._geoid_separation_m: float | None = None
        self._has_rangefinder = False
        self._battery: Battery | None = None
        self._batteries = Batteries()
        self._gps: GpsInfo | None = None
        self._status_text = StatusText()
        self.version: Message | None = None
        """The autopilot's AUTOPILOT_VERSION."""
        self._versions: Agreement[tuple[object, ...]] | None = None
        self.is_version_doubtful = False
        """Whether the version has come once, or another one since, so that it should be requested again."""
        self.flight = flight or AirborneWatch()
        self.is_hardware_in_the_loop = False
        self.conflict = ""
        """See `ual_daemon.backends.values.LinkState`."""
        self.is_mode_doubtful = False
        """Whether a message that seemed late has another mode: the safety pilot's new one, if many messages before it
        were lost. The caller should request a heartbeat, and sets this back."""
        self.is_ready_to_arm = False
        """Whether its own checks before arming pass, by its last SYS_STATUS."""
        self.reports_readiness = False
        """Whether it says so: some autopilots do not have the bit."""
        self.parameters: dict[str, float] = {}
        """Parameters of `Dialect.parameters` that it has sent."""
        self.changed_parameter = ""
        """The name of one that has come with another value than before, so that it should be read again."""
        self.fence = FenceReader(dialect, self.parameters, awaits_zones=dialect.has_zones)
        self._earth: tuple[tuple[object, ...], EarthReference] = ((), EarthReference())
        self._condition: tuple[tuple[object, ...], Condition] = ((), Condition())
        self._link: tuple[tuple[object, ...], LinkState] = ((), LinkState())
        """The groups that change seldom, each after its values: comparing these costs less than making a group."""
        self.message_counts: Counter[int] = Counter()
        """Messages of each id that came since it booted."""
        self._handlers: dict[int, Callable[[Message, float, float], None]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            mavlink.MAVLINK_MSG_ID_CURRENT_MODE: self._on_mode,
            mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES: self.mode_names.on_available,
            mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES_MONITOR: self.mode_names.on_monitor,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._on_extended_sys_state,
            dialect.estimator_message: self._on_estimator,
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._on_attitude_quaternion,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._on_attitude,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._on_local_position_ned,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._on_global_position_int,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._on_gps_global_origin,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._on_home_position,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._on_gps_raw_int,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._on_sys_status,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._on_battery_status,
            mavlink.MAVLINK_MSG_ID_STATUSTEXT: self._on_statustext,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._on_autopilot_version,
            mavlink.MAVLINK_MSG_ID_PARAM_VALUE: self._on_param_value,
        }

    def discard_state(self) -> None:
        """Discards all that may have changed since it was sent; the vehicle's properties and its frame stay known."""
        self._readings.discard_state()

    def discard_boot(self, boots_count: int) -> None:
        """Discards what belongs to the boot before."""
        self._boots_count = boots_count
        self._readings.discard_boot()
        self._gps = None if self._gps is None else GpsInfo(GpsFix.NONE)
        self._clock_offset = ClockOffset()
        self._sequence = SequenceUnwrapper(LATE_MESSAGE_S)
        self.message_counts.clear()
        self.mode_names.forget()
        self.parameters.clear()
        self.version = self._versions = None
        self.origin = LocalOrigin()

    @property
    def decoded_ids(self) -> frozenset[int]:
        """Ids of the messages that are worth decoding. `ATTITUDE` is, where no quaternion comes."""
        return frozenset(self._handlers) - {mavlink.MAVLINK_MSG_ID_ATTITUDE}

    def update(self, message: Message, now_s: float, utc_now_s: float) -> None:
        """Takes a decoded message of this autopilot."""
        header = message.get_header()
        self.on_frame(header.seq, now_s)
        self.on_content(header.msgId, message, now_s, utc_now_s)

    def on_frame(self, sequence: int, now_s: float) -> None:
        """Takes note of a frame of the autopilot with this number; its content, if used, is taken next."""
        self.heard_s = now_s
        numbers = self._sequence
        number = numbers.newest + 1
        if number & 0xFF == sequence:  # nearly always: as `update` does, without a call
            numbers.newest = numbers.value = self._readings.order = number
            numbers.newest_s = now_s
        else:
            self._readings.order = numbers.update(sequence, now_s)

    def on_content(self, message_id: int, message: Message, now_s: float, utc_now_s: float) -> None:
        """Takes the content of a frame that was noted."""
        handler = self._handlers.get(message_id)
        if handler is not None:
            handler(message, now_s, utc_now_s)
        self.message_counts[message_id] += 1

    def set_armed(self, is_armed: bool, now_s: float) -> None:
        """Takes from a heartbeat, or from an event ahead of it, that it is armed or disarmed.

        Autopilots move home to where they are armed. So the home from before the arming, or from before a time in which
        it may have been armed, is not known any more. A message from before it does not bring it back.
        """
        if not self.armed.is_next(now_s):
            return
        if is_armed and not self.is_armed:
            self._home.discard()
            self._home.is_next(now_s)
        self.armed.set(is_armed, now_s)

    @property
    def is_version_contradicted(self) -> bool:
        """Whether it has reported another version of late, so that it is not known which one is right."""
        return self._versions is not None and self._versions.is_open

    @property
    def is_home_missing(self) -> bool:
        """Whether it is armed, and the home that it has since is not known."""
        return self._home.sample is None and bool(self.armed.value)

    @property
    def is_armed(self) -> bool | None:
        """Whether it is armed; None while that is not known."""
        return self.armed.value

    @property
    def attitude_time_s(self) -> float | None:
        """Time of the newest attitude."""
        attitude = self._attitude.sample
        return None if attitude is None else attitude.time_s

    @property
    def mode_name(self) -> str:
        """The name of its mode; empty while it is not known."""
        mode = self.mode.sample
        return "" if mode is None else mode.value.name

    @property
    def readiness(self) -> bool | None:
        """Whether it is ready to arm; None where it does not say."""
        return self.is_ready_to_arm if self.reports_readiness else None

    @property
    def status_text(self) -> str:
        """Its newest text."""
        return self._status_text.text

    def snapshot(
        self,
        now_s: float,
        control: ControlState | None = None,
        health: Health | None = None,
        *,
        updated_s: float = math.inf,
        scheduling_gap: str = "",
        refused: str = "",
        corrections: CorrectionsAge = NO_CORRECTIONS,
        severe_texts: tuple[SevereText, ...] = (),
        aids: str = "",
    ) -> Snapshot:
        """Returns all values as of now, with those that are known elsewhere."""
        home = self._home.sample
        altitude_m, place = (None, None) if home is None else home.value
        earth = (self.origin.projection, place, altitude_m, self._geoid_separation_m)
        if earth != self._earth[0]:
            self._earth = earth, EarthReference(*earth)
        gps = self._gps
        if gps is not None and corrections is not NO_CORRECTIONS:
            gps = replace(gps, corrections_age_s=corrections.age_s, baseline_m=corrections.baseline_m)
        batteries = self._batteries.all
        text, has_rangefinder = self._status_text.text, self._has_rangefinder
        condition = (self._battery, gps, text, health, has_rangefinder, batteries, severe_texts, aids)
        if condition != self._condition[0]:
            self._condition = condition, Condition(*condition)
        link = ("", refused, self.conflict, self._boots_count, 0)
        if link != self._link[0]:
            self._link = link, LinkState(*link)
        motion = MotionState(
            estimator=self.estimator.sample,
            pose=self.pose.sample,
            velocity=self.velocity.sample,
            position_geo=self._position_geo.fresh(now_s),
            stamp_s=self._stamp_s,
            measured_s=self._measured_s,
        )
        return Snapshot(
            now_s,
            self.heard_s,
            updated_s,
            scheduling_gap,
            control=control or ControlState(self.armed.sample, self.landed.sample, self.mode.sample),
            motion=motion,
            earth=self._earth[1],
            condition=self._condition[1],
            link=self._link[1],
            autopilot_fence=self.fence.limits,
        )

    def _on_heartbeat(self, message: Message, now_s: float, _: float) -> None:
        self.set_armed(bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED), now_s)
        self.is_hardware_in_the_loop = bool(message.base_mode & mavlink.MAV_MODE_FLAG_HIL_ENABLED)
        self._on_mode(message, now_s, _)

    def _on_mode(self, message: Message, now_s: float, _: float) -> None:
        mode = self.mode_names.mode(message.custom_mode)
        if not self.mode.on_value(mode, now_s) and self.mode.sample is not None and mode != self.mode.value:
            self.is_mode_doubtful = True

    def _on_extended_sys_state(self, message: Message, now_s: float, _: float) -> None:
        self.landed.on_value(landed_state(message.landed_state), now_s)

    def _on_estimator(self, message: Message, now_s: float, _: float) -> None:
        if not self.estimator.is_next(now_s):
            return
        estimator = self._dialect.estimator(message.flags)
        if estimator.is_regained_after(self.estimator.sample):
            self.pose.discard()
            self.velocity.discard()
        self.estimator.set(estimator, now_s)

    def _on_attitude_quaternion(self, message: Message, now_s: float, _: float) -> None:
        if not self._attitude.is_next(now_s):
            return
        w, x, y, z = message.q1, message.q2, message.q3, message.q4
        rates = frd_to_flu(message.rollspeed, message.pitchspeed, message.yawspeed)
        if self.plausibility.accepts_norm(math.hypot(x, y, z, w)) and self.plausibility.accepts_rates(rates):
            self._attitude.set((orientation_to_enu(w, x, y, z), rates), now_s)

    def _on_attitude(self, message: Message, now_s: float, _: float) -> None:
        judge, has_quaternion = self.plausibility, self._attitude.was_received_within(ATTITUDE_LIMIT_S, now_s)
        if has_quaternion or not self._angles.is_next(now_s):
            return
        angles = message.roll, message.pitch, message.yaw
        rates = frd_to_flu(message.rollspeed, message.pitchspeed, message.yawspeed)
        if judge.accepts_angles(*angles) and judge.accepts_rates(rates):
            to_ned = Quaternion.from_euler(*angles)
            self._attitude.set((orientation_to_enu(to_ned.w, to_ned.x, to_ned.y, to_ned.z), rates), now_s)

    def _on_local_position_ned(self, message: Message, now_s: float, utc_now_s: float) -> None:
        if not self.pose.is_next(now_s):
            return
        measured_s = milli(message.time_boot_ms)
        if has_wrapped(self._measured_s, measured_s):
            self._clock_offset = ClockOffset()
        stamp_s = self._clock_offset.to_utc(measured_s, now_s, utc_now_s)
        attitude = self._attitude.fresh(now_s)
        if attitude is None:
            return
        place, velocity = ned_to_enu(message.x, message.y, message.z), ned_to_enu(message.vx, message.vy, message.vz)
        if self.plausibility.accepts_position(place) and self.plausibility.accepts_velocity(velocity):
            orientation, rates = attitude
            self._stamp_s, self._measured_s = stamp_s, measured_s  # of the pose: where it is old, so are they
            self.pose.set(Pose(place, orientation), now_s)
            self.velocity.set(Twist(velocity, rates), now_s)
            self.origin.on_position(message.time_boot_ms, place, velocity)

    def _on_global_position_int(self, message: Message, now_s: float, _: float) -> None:
        found = geo_point(message, self._geoid_separation_m)
        if found is None:
            self._position_geo.discard()
        elif self.plausibility.accepts_geo_point(found):
            self._position_geo.set(found, now_s)
            self.origin.on_geo(message.time_boot_ms, found)
            if found.altitude_amsl_m is not None and found.altitude_home_m is not None:
                self._check_home(found.altitude_amsl_m, found.altitude_home_m)

    def _check_home(self, altitude_m: float, above_home_m: float) -> None:
        """Corrects the height of home where a newer message implies another one."""
        home = self._home.sample
        if home is None or self._readings.order < self._home.order:
            return
        if self.home_watch.is_contradicted(home.value.altitude_amsl_m, altitude_m, above_home_m):
            self._home.set(home.value._replace(altitude_amsl_m=altitude_m - above_home_m), home.time_s)

    def _on_gps_global_origin(self, message: Message, _now_s: float, _: float) -> None:
        latitude_deg, longitude_deg = degrees(message.latitude), degrees(message.longitude)
        altitude_m, judge = milli(message.altitude), self.plausibility
        if judge.accepts_geo_position(latitude_deg, longitude_deg) and judge.accepts_altitude(altitude_m):
            self.origin.on_origin(self._dialect.projection(latitude_deg, longitude_deg, altitude_m))

    def _on_home_position(self, message: Message, now_s: float, _: float) -> None:
        altitude_m = milli(message.altitude)
        if self._home.is_next(now_s) and self.plausibility.accepts_altitude(altitude_m):
            place = self._home_position(degrees(message.latitude), degrees(message.longitude))
            self._home.set(_Home(altitude_m, place), now_s)

    def _home_position(self, latitude_deg: float, longitude_deg: float) -> GeoPoint | None:
        if latitude_deg == longitude_deg == 0.0:  # not known: an autopilot may send it before its first fix
            return None
        is_on_earth = self.plausibility.accepts_geo_position(latitude_deg, longitude_deg)
        return GeoPoint(latitude_deg, longitude_deg) if is_on_earth else None

    def _on_gps_raw_int(self, message: Message, _now_s: float, _: float) -> None:
        self._gps = gps_info(message)
        if self._gps.fix >= GpsFix.FIX_3D and message.alt_ellipsoid:
            separation_m = milli(message.alt_ellipsoid - message.alt)
            if self.plausibility.accepts_geoid_separation(separation_m):
                self._geoid_separation_m = separation_m

    def _on_sys_status(self, message: Message, now_s: float, _: float) -> None:
        is_known = bool(self._dialect.capabilities)  # PX4 has the bit only among the healthy ones
        present = message.onboard_control_sensors_present & mavlink.MAV_SYS_STATUS_PREARM_CHECK
        self.reports_readiness = is_known or bool(present)
        self.is_ready_to_arm = bool(message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)
        self._has_rangefinder = bool(
            message.onboard_control_sensors_enabled & mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION
        )
        self.fence.set_enabled(bool(message.onboard_control_sensors_enabled & mavlink.MAV_SYS_STATUS_GEOFENCE))
        found = battery(message)
        self._batteries.drop_silent(now_s)
        is_it = not self._batteries.are_several  # else it is of the first, or of all together
        if is_it and (found is None or self.plausibility.accepts_battery(found)):
            self._battery = found

    def _on_battery_status(self, message: Message, now_s: float, _: float) -> None:
        found = battery_status(message)
        if self.plausibility.accepts_battery(found):
            self._batteries.on_battery(found, now_s)
            if self._batteries.are_several:
                self._battery = self._batteries.decisive()

    def _on_statustext(self, message: Message, _now_s: float, _: float) -> None:
        self._status_text.update(message)

    def _on_autopilot_version(self, message: Message, now_s: float, _: float) -> None:
        """Takes the first at once. Permissions and names follow from it, so it is requested until two agree."""
        values = tuple(repr(getattr(message, name)) for name in message.get_fieldnames())
        is_flying = self.flight.is_flying(now_s)
        if self._versions is None:
            self._versions, self.version, self.is_version_doubtful = Agreement(values), message, True
        elif self._versions.note(values, now_s, is_flying=is_flying) or self._versions.value == values:
            self.version = message
        self.is_version_doubtful = self._versions.is_open or not self._versions.is_backed

    def _on_param_value(self, message: Message, _now_s: float, _: float) -> None:
        """Takes those that are used: a ground station may have it send a thousand others."""
        name = message.param_id
        if name not in self._dialect.parameters:
            return
        value = self._dialect.parameter_value(message)
        if value is not None and self.plausibility.accepts_parameter(name, value):
            is_changed = self.parameters.get(name, value) != value
            self.changed_parameter = name if is_changed else self.changed_parameter
            self.parameters[name] = value
            self.fence.update()
