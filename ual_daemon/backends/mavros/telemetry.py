"""Snapshot of the messages that MAVROS has published last. Belongs to the link's thread."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ual.geometry import Pose, Twist
from ual.types import Battery, GeoPoint, GpsInfo, Health
from ual_daemon.backends.engine.agreement import AirborneWatch
from ual_daemon.backends.engine.clock_offset import ClockOffset
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.engine.readings import Reading, Readings, Valid
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.baseline import Baseline
from ual_daemon.backends.firmwares.batteries import Batteries
from ual_daemon.backends.firmwares.fence_items import found_zones
from ual_daemon.backends.firmwares.fence_reader import FenceReader
from ual_daemon.backends.firmwares.home_watch import HomeWatch
from ual_daemon.backends.firmwares.local_origin import LocalOrigin
from ual_daemon.backends.firmwares.mission_items import MissionType
from ual_daemon.backends.firmwares.numbers import Sensor
from ual_daemon.backends.mavros import messages, topics
from ual_daemon.backends.mavros.geoid import Geoid
from ual_daemon.backends.mavros.gimbal import GimbalTopics
from ual_daemon.backends.mavros.missions import MissionTopics
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.fields import number, stamp_s, vector
from ual_daemon.backends.rosbridge.ordering import Ordering
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

GEO_LIMIT_S = 1.5
"""A position on Earth that is older is not reported."""
VELOCITY_LIMIT_S = 1.0
"""Without a velocity that is younger, nothing may be flown: UAL brakes and judges arrivals by it."""
ATTITUDE_LIMIT_S = 1.2
"""MAVROS goes on publishing poses with the last attitude that came. So ``imu/data`` must show that attitudes come."""
_PHOTO_TAKEN_RESULT = 1
_SAME_MOMENT_S = 0.1
_HOME_TOLERANCE_M, _HOME_DOUBTS_COUNT = 0.5, 4
"""The altitude and the height above home are of one message of the autopilot, but come on two topics."""
_PROMPT_TOPIC_MS = 100
"""Throttling interval in ms from which a topic says nothing about now: its newest message waits in the bridge for that
time.
"""
_NO_VELOCITY = Estimator(False, f"MAVROS publishes no velocity ({topics.VELOCITY})")
_NO_ATTITUDE = Estimator(False, f"MAVROS gets no attitude any more ({topics.IMU} is silent)")
_NO_AHRS = Estimator(False, "its attitude and position estimate is not healthy (AHRS in SYS_STATUS)")
_GOOD = Estimator(True)


class MavrosTelemetry:
    """The newest data of one autopilot. `utc_s` returns UTC, to which the stamps of the ROS computer are converted.

    What a silence may hide is discarded with the first message after it; the vehicle's properties stay known.
    """

    def __init__(self, autopilot: Autopilot, watch: LinkWatch, utc_s: Callable[[], float]) -> None:
        self.autopilot = autopilot
        self._watch = watch
        self.boots_count = watch.begin_boot()
        self.plausibility = Plausibility()
        self.parameters: dict[str, float] = {}
        self.fence = FenceReader(autopilot, self.parameters)
        self.counts: Counter[str] = Counter()
        """Messages that came on each topic."""
        self.origin = LocalOrigin()
        self.home_s = math.inf
        """Since when the home of the present arming is missing; infinite while it is not."""
        self.home_watch = HomeWatch(_HOME_TOLERANCE_M, _HOME_DOUBTS_COUNT)
        """Whether home is to be requested, as it is elsewhere now."""
        self.is_ready_to_arm: bool | None = None
        self.vtol_state = 0
        self.flight = AirborneWatch()
        self.is_connected = False
        """Whether MAVROS hears the autopilot, by its own words: it takes 10 s to notice that it does not."""
        self._utc_s = utc_s
        self._ordering = Ordering()
        self._clock_offset = ClockOffset()
        self._geoid = Geoid()
        self._stamp_s = self._measured_s = 0.0
        readings = self.readings = Readings()
        self.armed: Reading[bool] = readings.add(Valid.WHILE_HEARD)
        self.mode: Reading[Mode] = readings.add(Valid.WHILE_HEARD)
        self.landed: Reading[LandedState] = readings.add(
            Valid.WHILE_HEARD, unknown=Sample(LandedState.UNKNOWN, NEVER_S)
        )
        self._estimator: Reading[Estimator] = readings.add(Valid.WHILE_HEARD)
        self.pose: Reading[Pose] = readings.add(Valid.WHILE_HEARD)
        self.velocity: Reading[Twist] = readings.add(Valid.WHILE_HEARD)
        self._geo: Reading[Message] = readings.add(Valid.WHILE_HEARD, limit_s=GEO_LIMIT_S)
        self._above_home_m: Reading[float] = readings.add(Valid.UNTIL_REBOOT)
        self._home: Reading[Message] = readings.add(Valid.UNTIL_REBOOT)
        self._origin: Reading[Message] = readings.add(Valid.UNTIL_REBOOT)
        self._placed: Reading[object] = readings.add(Valid.UNTIL_REBOOT)
        self._attitude_s: float | None = None
        self._gps_raw: Message | None = None
        self._fix: Message | None = None
        self._gps: GpsInfo | None = None
        self.corrections_age_s: float | None = None
        """Seconds since the last corrections left for its receiver; None before the first."""
        self._baseline = Baseline()
        self._satellites_count = 0
        self._battery: Battery | None = None
        self._batteries = Batteries()
        self._has_rangefinder = False
        self.status_text = ""
        self.missions = MissionTopics(autopilot)
        self.gimbal = GimbalTopics(autopilot, self.parameters)
        self._handlers: dict[str, Callable[[Message, float], None]] = {
            topics.STATE: self._on_state,
            topics.EXTENDED_STATE: self._on_extended_state,
            topics.SYS_STATUS: self._on_sys_status,
            topics.ESTIMATOR_STATUS: self._on_estimator_status,
            topics.STATUS_TEXT: self._on_status_text,
            topics.POSE: self._on_pose,
            topics.VELOCITY: self._on_velocity,
            topics.IMU: self._on_imu,
            topics.GLOBAL: self._on_global,
            topics.ABOVE_HOME: self._on_above_home,
            topics.ORIGIN: self._on_origin,
            topics.FIX: self._on_fix,
            topics.SATELLITES: self._on_satellites,
            topics.GPS_RAW: self._on_gps_raw,
            topics.GPS_RTK: self._on_gps_rtk,
            topics.GPS2_RTK: self._on_gps_rtk,
            topics.VFR_HUD: self._on_vfr_hud,
            topics.HOME: self._on_home,
            topics.BATTERY: self._on_battery,
            topics.TIMESYNC: self._on_timesync,
            **self.missions.handlers,
            **self.gimbal.handlers,
            topics.FENCE: self._on_fence,
        }

    def update(self, topic: str, message: Message, now_s: float) -> bool:
        """Takes a message. Returns False for one that is late, and older than the one before."""
        if not self._ordering.accepts(topic, stamp_s(message)):
            return False
        is_prompt = topics.TOPICS[topic].throttle_ms < _PROMPT_TOPIC_MS
        if is_prompt and (topic != topics.STATE or message["connected"]):
            self._watch.on_message(now_s)
        self.counts[topic] += 1
        handler = self._handlers.get(topic)
        if handler is not None:
            handler(message, now_s)
        return True

    def set_armed(self, is_armed: bool, reported_s: float, now_s: float) -> None:
        """Takes that it was armed or disarmed at a time. Autopilots move home to where they are armed."""
        if is_armed and not self.is_armed:
            self._home.discard()
            self.home_s = now_s
        elif not is_armed:
            self.home_s = math.inf
        self.armed.set(is_armed, reported_s)

    @property
    def measured_s(self) -> float:
        """Time of the pose's measurement, on the clock of the ROS computer."""
        return self._measured_s

    @property
    def mode_name(self) -> str:
        """The name of its mode; empty while it is not known."""
        return "" if self.mode.value is None else self.mode.value.name

    @property
    def is_armed(self) -> bool:
        """Whether it is armed, as far as it is known."""
        return bool(self.armed.value)

    @property
    def knows_arming(self) -> bool:
        """Whether it is known if it is armed."""
        return self.armed.sample is not None

    @property
    def is_flying(self) -> bool:
        """Whether it is armed, and not known to stand on the ground."""
        return self.is_armed and self.landed.value is not LandedState.ON_GROUND

    def photo(self, message: Message) -> tuple[int, float | None, GeoPoint | None] | None:
        """Reads a CameraImageCaptured: its number, and when (UTC) and where it was taken; None where that failed."""
        if int(message["capture_result"]) != _PHOTO_TAKEN_RESULT:
            return None
        geo = message["geo"]
        place = None
        if self._accepts_position(geo) and any(number(geo[name]) for name in ("latitude", "longitude")):
            ellipsoid_m = number(geo["altitude"])
            amsl_m = self._geoid.amsl_m(ellipsoid_m)
            place = replace(_geo_point(geo), altitude_amsl_m=amsl_m, altitude_ellipsoid_m=ellipsoid_m)
        taken_s = stamp_s(message) + self._stamp_s - self._measured_s if self._measured_s else None
        return int(message["image_index"]), taken_s, place

    def snapshot(
        self,
        now_s: float,
        control: ControlState | None = None,
        health: Health | None = None,
        severe_texts: tuple[SevereText, ...] = (),
        aids: str = "",
    ) -> Snapshot:
        """Returns all values as of now, with those that are known elsewhere."""
        home = self._home.value
        return Snapshot(
            now_s,
            self._watch.heard_s,
            control=control or ControlState(self.armed.sample, self.landed.sample, self.mode.sample),
            motion=MotionState(
                estimator=self._assessed_estimator(now_s),
                pose=self.pose.sample,
                velocity=self.velocity.sample,
                position_geo=self._position_geo(now_s),
                stamp_s=self._stamp_s,
                measured_s=self._measured_s,
            ),
            earth=EarthReference(
                projection=self.origin.projection,
                home_geo=None if home is None else _home_point(home["geo"]),
                home_altitude_amsl_m=None if home is None else self._geoid.amsl_m(number(home["geo"]["altitude"])),
                geoid_separation_m=self._geoid.separation_m,
            ),
            condition=Condition(
                self._battery,
                self._gps_now(now_s),
                self.status_text,
                health,
                self._has_rangefinder,
                self._batteries.all,
                severe_texts,
                aids,
            ),
            link=LinkState(boots_count=self.boots_count),
            autopilot_fence=self.fence.limits,
        )

    def _gps_now(self, now_s: float) -> GpsInfo | None:
        gps, age_s, baseline_m = self._gps, self.corrections_age_s, self._baseline.fresh_m(now_s)
        if gps is None or (age_s is None and baseline_m is None):
            return gps
        return replace(gps, corrections_age_s=age_s, baseline_m=baseline_m)

    # --- What comes ---------------------------------------------------------------------------------------------------

    def _on_state(self, message: Message, now_s: float) -> None:
        self.is_connected = bool(message["connected"])
        if not self.is_connected:
            self.armed.discard()
            self.mode.discard()
            return
        # Not when it came: after a stall of the bridge an older one comes.
        reported_s = self._ordering.state_time_s(stamp_s(message), now_s)
        self.set_armed(bool(message["armed"]), reported_s, now_s)
        self.mode.set(messages.mode(str(message["mode"]), self.autopilot), reported_s)

    def _on_extended_state(self, message: Message, now_s: float) -> None:
        self.landed.set(messages.landed_state(message), now_s)
        self.vtol_state = int(message["vtol_state"])

    def _on_sys_status(self, message: Message, now_s: float) -> None:
        present, enabled, health = (int(message[f"sensors_{name}"]) for name in ("present", "enabled", "health"))
        self.is_ready_to_arm = bool(health & Sensor.PREARM_CHECK)
        self._has_rangefinder = bool(enabled & Sensor.LASER_POSITION)
        self.fence.set_enabled(bool(enabled & Sensor.GEOFENCE))
        if self._batteries.drop_silent(now_s):
            self._battery = self._batteries.decisive()
        if not self.counts[topics.ESTIMATOR_STATUS]:  # ArduPilot does not send it: its poses come while they are good
            is_ill = present & Sensor.AHRS and not health & Sensor.AHRS
            self._estimator.set(_NO_AHRS if is_ill else _GOOD, now_s)

    def _on_estimator_status(self, message: Message, now_s: float) -> None:
        estimator = self.autopilot.estimator(messages.estimator_flags(message))
        if estimator.is_regained_after(self._estimator.sample):
            self.pose.discard()
            self.velocity.discard()
        self._estimator.set(estimator, now_s)

    def _on_status_text(self, message: Message, _now_s: float) -> None:
        self.status_text = str(message["text"])

    def _on_pose(self, message: Message, now_s: float) -> None:
        found = messages.pose(message)
        judge = self.plausibility
        if not (judge.accepts_position(found.position) and judge.accepts_rotation(found.orientation)):
            return
        measured_s = stamp_s(message)
        self._measured_s = measured_s
        self._stamp_s = self._clock_offset.to_utc(measured_s, now_s, self._utc_s()) if measured_s else 0.0
        self.pose.set(Pose(found.position, found.orientation.normalized()), self._sent_s(measured_s, now_s))

    def _on_velocity(self, message: Message, now_s: float) -> None:
        pose = self.pose.value
        if pose is None:
            return
        found = messages.twist(message, pose)
        if self.plausibility.accepts_velocity(found.linear) and self.plausibility.accepts_rates(found.angular):
            self.velocity.set(found, self._sent_s(stamp_s(message), now_s))
            self.origin.on_position(_milliseconds(message), pose.position, found.linear)

    def _sent_s(self, measured_s: float, now_s: float) -> float:
        return self._ordering.sent_s(measured_s, now_s)

    def _on_imu(self, _message: Message, now_s: float) -> None:
        self._attitude_s = now_s

    def _on_global(self, message: Message, now_s: float) -> None:
        if message["latitude"] == message["longitude"] == 0.0:
            self._geo.discard()
            return
        point = _geo_point(message)
        if not self._accepts_position(message):
            return
        self._geo.set(message, now_s)
        self.origin.on_geo(_milliseconds(message), point)

    def _on_above_home(self, message: Message, now_s: float) -> None:
        above_m = number(message["data"])
        if not self.plausibility.accepts_altitude(above_m):
            return
        self._above_home_m.set(above_m, now_s)
        geo, home = self._geo.sample, self._home.value
        if geo is None or home is None or now_s - geo.time_s > _SAME_MOMENT_S:
            return
        self.home_watch.is_contradicted(number(home["geo"]["altitude"]), number(geo.value["altitude"]), above_m)

    def _on_origin(self, message: Message, now_s: float) -> None:
        self._origin.set(message, now_s)
        self._set_origin(now_s)

    def _set_origin(self, now_s: float) -> None:
        """Tells the origin, once the altitude of mean sea level there is known; and once only, as that differs with the
        place where it is measured.
        """
        origin = self._origin.value
        if origin is None:
            return
        place = origin["position"]
        if not self._accepts_position(place):
            return
        amsl_m = self._geoid.amsl_m(number(place["altitude"]))
        point = _geo_point(place)
        if amsl_m is None or place == self._placed.value:
            return
        self._placed.set(place, now_s)
        self.origin.on_origin(self.autopilot.projection(point.latitude_deg, point.longitude_deg, amsl_m))

    def _on_fix(self, message: Message, now_s: float) -> None:
        self._fix = message
        self._pair_fixes(now_s)
        self._gps = messages.gps_info(message, self._gps_raw, self._satellites_count)

    def _on_satellites(self, message: Message, _now_s: float) -> None:
        self._satellites_count = int(message["data"])

    def _on_gps_raw(self, message: Message, now_s: float) -> None:
        self._gps_raw = message
        self._pair_fixes(now_s)

    def _on_gps_rtk(self, message: Message, now_s: float) -> None:
        a_mm, b_mm, c_mm = (number(message[f"baseline_{axis}"]) for axis in "abc")
        self._baseline.on_components(a_mm, b_mm, c_mm, now_s)

    def _pair_fixes(self, now_s: float) -> None:
        """Compares the altitudes of one message of the autopilot, which comes on two topics in any order."""
        fix, raw = self._fix, self._gps_raw
        if fix is None or raw is None or not _is_same_fix(raw, fix):
            return
        self._geoid.on_exact(number(fix["altitude"]), number(raw["alt"]) / 1000.0)
        self._set_origin(now_s)

    def _on_vfr_hud(self, message: Message, now_s: float) -> None:
        geo = self._geo.fresh(now_s)
        if geo is not None and self._geoid.separation_m is None:
            self._geoid.on_estimate(number(geo["altitude"]), number(message["altitude"]))
            self._set_origin(now_s)

    def _on_home(self, message: Message, now_s: float) -> None:
        if self._accepts_position(message["geo"]):
            self._home.set(message, now_s)
            self.home_s = math.inf

    def _on_battery(self, message: Message, now_s: float) -> None:
        found = messages.battery(message)
        if found == Battery(id=found.id):
            self._battery = None if not self._batteries.are_several else self._battery
            return
        self._batteries.on_battery(found, now_s)
        self._battery = self._batteries.decisive()

    def _on_fence(self, message: Message, now_s: float) -> None:
        """Takes the zones as MAVROS has read or sent them last: so UAL plans by them, too."""
        self.missions.handlers[topics.FENCE](message, now_s)
        self.fence.set_zones(found_zones(self.missions.lists[MissionType.FENCE].items))

    def _on_timesync(self, message: Message, now_s: float) -> None:
        """Takes the autopilot's time since boot, by which a reboot shows."""
        if self._watch.on_boot_time(number(message["remote_timestamp_ns"]) * 1e-9, now_s):
            self._discard_boot()

    def _discard_boot(self) -> None:
        self.boots_count = self._watch.begin_boot()
        self.readings.discard_boot()
        self.parameters.clear()
        self.missions.discard()
        self.gimbal.discard()
        self.origin = LocalOrigin()

    def _accepts_position(self, message: Message) -> bool:
        """Judges a place on Earth with its altitude: a height is computed from it, by which ArduPilot takes off."""
        judge = self.plausibility
        return judge.accepts_geo_point(_geo_point(message)) and judge.accepts_altitude(number(message["altitude"]))

    # --- What follows from it -----------------------------------------------------------------------------------------

    def _assessed_estimator(self, now_s: float) -> Sample[Estimator] | None:
        """Judges by what was received last: if nothing comes any more, it is not one topic that is silent."""
        estimator, velocity = self._estimator.sample, self.velocity.sample
        if estimator is None or not estimator.value.is_good:
            return estimator
        heard_s = now_s if self._watch.heard_s is None else self._watch.heard_s
        if velocity is None or heard_s - velocity.time_s > VELOCITY_LIMIT_S:
            return Sample(_NO_VELOCITY, now_s)
        if self._attitude_s is not None and heard_s - self._attitude_s > ATTITUDE_LIMIT_S:
            return Sample(_NO_ATTITUDE, now_s)
        return estimator

    def _position_geo(self, now_s: float) -> GeoPoint | None:
        geo = self._geo.fresh(now_s)
        if geo is None:
            return None
        ellipsoid_m = number(geo["altitude"])
        return GeoPoint(
            number(geo["latitude"]),
            number(geo["longitude"]),
            altitude_amsl_m=self._geoid.amsl_m(ellipsoid_m),
            altitude_home_m=self._above_home_m.value,
            altitude_ellipsoid_m=ellipsoid_m,
        )


def _geo_point(message: Message) -> GeoPoint:
    return GeoPoint(number(message["latitude"]), number(message["longitude"]))


def _home_point(message: Message) -> GeoPoint | None:
    """Returns the place of home; None where it is not known: an autopilot may say zeros before its first fix."""
    return _geo_point(message) if any(message[name] for name in ("latitude", "longitude")) else None


def _milliseconds(message: Message) -> int:
    return round(stamp_s(message) * 1000.0)


def _is_same_fix(raw: Message, fix: Message) -> bool:
    """Returns whether a GPSRAW and a NavSatFix are of one message of the autopilot."""
    names: tuple[tuple[str, str], ...] = (("lat", "latitude"), ("lon", "longitude"))
    return all(abs(number(raw[ours]) / 1e7 - number(fix[theirs])) < 1e-9 for ours, theirs in names)


def target(message: Message) -> tuple[Any, ...]:
    """Returns position, velocity and type mask of a PositionTarget."""
    return vector(message["position"]), vector(message["velocity"]), int(message["type_mask"])
