"""From messages to snapshots."""

from __future__ import annotations

import logging
import math

from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Battery, GeoPoint, GpsFix, GpsInfo, Health
from ual_daemon import logs
from ual_daemon.backends.dji import modes
from ual_daemon.backends.dji.authority import DjiAuthority
from ual_daemon.backends.dji.local_frame import DjiLocalFrame
from ual_daemon.backends.dji.motor_errors import motor_error_text
from ual_daemon.backends.dji.obstacles import ObstacleWatch
from ual_daemon.backends.dji.settings import DjiSettings
from ual_daemon.backends.dji.wrappers import DjiTopic, Wrapper
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.engine.readings import Reading, Readings, Valid
from ual_daemon.backends.engine.severe_texts import SEVERE, SevereTexts
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.fields import number, quaternion, stamp_s, vector
from ual_daemon.backends.rosbridge.ordering import Ordering
from ual_daemon.backends.values import (
    Cause,
    Condition,
    Control,
    ControlState,
    EarthReference,
    Estimator,
    LandedState,
    Mode,
    MotionState,
    Sample,
    Snapshot,
)

_log = logging.getLogger(__name__)

_REMOTE, _APP, _OURS = 0, 1, 4
"""Controllers of the aircraft in `device_mode`."""
_RTK_FIXED_TYPE = 50
_PLACE = ("latitude", "longitude", "altitude")
_WARNING_ROS1, _WARNING_ROS2 = 4, 30
_FATAL_ROS1, _FATAL_ROS2 = 16, 50


class DjiTelemetry:
    """The newest values. Belongs to the link's thread; what they say together is for any.

    Any of them may be discarded meanwhile, so other threads read each once.
    """

    def __init__(self, wrapper: Wrapper, settings: DjiSettings) -> None:
        self.wrapper = wrapper
        self._required = tuple(topic for topic in wrapper.topics if topic.is_required)
        self.frame = DjiLocalFrame()
        self.authority = DjiAuthority()
        self.obstacles = ObstacleWatch()
        self._plausibility = Plausibility()
        self._taken_s: dict[str, float] = {}
        self._begun_s = math.inf
        self._braked: Sample[str] | None = None
        self._text: Sample[str] | None = None
        self.severe_texts = SevereTexts()
        readings = self._readings = Readings()
        self.height: Reading[float] = readings.add(Valid.WHILE_HEARD)
        """Height above the ground, or above where it took off."""
        self.poses_count = 0
        self._settings = settings
        self._ordering = Ordering()
        self._orientation: Reading[Quaternion] = readings.add(Valid.WHILE_HEARD)
        self._rates = Vector3()
        self._velocity: Reading[Vector3] = readings.add(Valid.WHILE_HEARD)
        self._pose: Reading[Pose] = readings.add(Valid.WHILE_HEARD)
        self._geo: GeoPoint | None = None
        self._status: Reading[int] = readings.add(Valid.WHILE_HEARD)
        self._display: Reading[int] = readings.add(Valid.WHILE_HEARD)
        self._left_landing: Reading[None] = readings.add(Valid.WHILE_HEARD)
        """Since when another mode than landing shows."""
        self._device: Reading[int] = readings.add(Valid.WHILE_HEARD)
        self._granted_s = self._ours_s = -math.inf
        """Time of the grant of authority, while it does not show yet, and the time at which it showed last."""
        self._level: Reading[int] = readings.add(Valid.WHILE_HEARD)
        self._is_rtk_fixed = False
        self._has_rc = True
        self._battery: Battery | None = None
        self._home: GeoPoint | None = None
        self._home_altitude_m: float | None = None
        """Altitude above mean sea level of the ground where the motors started last, at first where the first good fix
        was; None while it is not known.
        """
        self._is_home_set = self._is_home_rejected = False
        self._motor_error = 0
        self._altitude: Reading[float] = readings.add(Valid.WHILE_HEARD)
        self._geoid_m: float | None = None
        self._stamp_s = 0.0

    # --- One method for each topic ------------------------------------------------------------------------------------

    def on_message(self, name: str, message: Message, now_s: float) -> None:
        """Takes the message of a topic that the wrapper alone publishes (`wrappers.Topic.handler`).

        One that a newer one has overtaken is dropped. A report of the state counts from when it was made: after a
        stall of the bridge older reports come.
        """
        stamp = stamp_s(message)
        if not self._ordering.accepts(name, stamp):
            return
        self._taken_s[name] = now_s
        getattr(self, name)(message, self._ordering.state_time_s(stamp, now_s) if name in _OF_STATE else now_s)

    def discard_state(self) -> None:
        """Discards all that may have changed unseen; where the frame lies stays known."""
        self._readings.discard_state()
        self._granted_s = -math.inf
        self.authority.forget()

    def note_granted(self, requested_s: float, now_s: float) -> None:
        """Notes that the wrapper has given us the control authority, for which it was asked at a time.

        Where it is published, it counts before that comes. The display mode of a take-off that begins now may come
        first. With the authority from before it, the mode would be another's. Where it has shown, and is lost again,
        this answer is late.
        """
        self.authority.grant(is_granted=True)
        if self.wrapper.says_authority and self._ours_s < requested_s:
            self._device.set(_OURS, now_s)
            self._granted_s = now_s

    def note_released(self) -> None:
        """Notes that we have given up the control authority."""
        self.authority.grant(is_granted=False)
        self._granted_s = -math.inf

    def on_attitude(self, message: Message, now_s: float) -> None:
        """Takes the rotation from forward, left, up to east, north, up."""
        rotation = quaternion(message["quaternion"])
        if self._plausibility.accepts_rotation(rotation):
            self._orientation.set(rotation.normalized(), now_s)

    def on_velocity(self, message: Message, now_s: float) -> None:
        """Takes the velocity: east, north, up."""
        velocity = vector(message["vector"])
        if self._plausibility.accepts_velocity(velocity):
            self._velocity.set(velocity, now_s)

    def on_rates(self, message: Message, _: float) -> None:
        """Takes the angular velocity about east, north, up; only that about up is used."""
        self._on_angular_velocity(Vector3(0.0, 0.0, number(message["vector"]["z"])))

    def on_body_rates(self, message: Message, _: float) -> None:
        """Takes the angular velocity about the axes of the body."""
        self._on_angular_velocity(vector(message["vector"]))

    def _on_angular_velocity(self, rates: Vector3) -> None:
        if self._plausibility.accepts_rates(rates):
            self._rates = rates

    def on_position(self, message: Message, now_s: float) -> None:
        """Takes the fused position, which makes a pose."""
        latitude_deg, longitude_deg, altitude_m = (number(message[name]) for name in _PLACE)
        if latitude_deg == longitude_deg == 0.0:
            return
        if not self._plausibility.accepts_geo_point(GeoPoint(latitude_deg, longitude_deg, altitude_amsl_m=altitude_m)):
            return
        ellipsoid_m = None
        if self.wrapper.has_sea_level:
            sea_level_m = self._altitude.value
            if sea_level_m is None:
                return
            ellipsoid_m, altitude_m = altitude_m, sea_level_m
            self._geoid_m = ellipsoid_m - altitude_m
        position = self.frame.position(latitude_deg, longitude_deg, altitude_m, now_s, is_good=self._is_good(now_s))
        orientation = self._orientation.sample
        if position is None or orientation is None:
            return
        self.poses_count += 1
        self._pose.set(Pose(position, orientation.value), self._oldest_s(orientation.time_s, now_s))
        self._geo = GeoPoint(latitude_deg, longitude_deg, altitude_amsl_m=altitude_m, altitude_ellipsoid_m=ellipsoid_m)
        self._stamp_s = stamp_s(message)
        if self._home_altitude_m is None:
            self._home_altitude_m = self._ground_altitude_m(altitude_m, now_s)

    def _ground_altitude_m(self, altitude_m: float, now_s: float) -> float | None:
        """Returns the altitude of the ground below an altitude; None while it is not known how high it flies.

        A daemon may be started in the air: heights above home must not count from where it was then.
        """
        if self.flight_status is None or self.is_on_ground:
            return None if self.flight_status is None else altitude_m
        height = self.height.sample
        is_new = height is not None and now_s - height.time_s <= _HEIGHT_S and math.isfinite(height.value)
        return altitude_m - height.value if height is not None and is_new else None

    def _oldest_s(self, attitude_s: float, now_s: float) -> float:
        """Returns when the oldest part of a pose came, of which the position comes now."""
        altitude = self._altitude.sample
        return min(now_s, attitude_s, now_s if altitude is None else altitude.time_s)

    def on_altitude(self, message: Message, now_s: float) -> None:
        """Takes the fused altitude above mean sea level."""
        altitude_m = number(message["data"])
        if self._plausibility.accepts_altitude(altitude_m):
            self._altitude.set(altitude_m, now_s)

    def on_rtk_info(self, message: Message, _: float) -> None:
        """Takes the quality of RTK."""
        self._is_rtk_fixed = message["data"] == _RTK_FIXED_TYPE

    def on_rtk_position(self, message: Message, now_s: float) -> None:
        """Takes the position by RTK."""
        place = number(message["latitude"]), number(message["longitude"])
        self.frame.note_rtk(
            *place, now_s, is_fixed=self._is_rtk_fixed and self._plausibility.accepts_geo_position(*place)
        )

    def on_gps_level(self, message: Message, now_s: float) -> None:
        """Takes how good the position is, 0 to 5."""
        self._level.set(int(number(message["data"])), now_s)

    def on_flight_status(self, message: Message, now_s: float) -> None:
        """Takes whether it stands, runs its motors on the ground, or flies."""
        status = int(number(message.get("flight_status", message.get("data"))))
        if self._status.value == modes.STOPPED and status != modes.STOPPED:
            self._home_altitude_m = None  # as other autopilots set home: it may have been carried to another field
        self._status.set(status, now_s)
        self.authority.note_status(status, now_s)

    def on_display_mode(self, message: Message, now_s: float) -> None:
        """Takes the mode."""
        mode = int(number(message.get("display_mode", message.get("data"))))
        if self._is_still_landing(mode, now_s):
            return
        self._display.set(mode, now_s)
        if not self.wrapper.says_authority:
            follows = self.authority.observe(mode, self.height.value, now_s)
            self._device.set(_OURS if follows else _REMOTE, now_s)

    def _is_still_landing(self, mode: int, now_s: float) -> bool:
        """Returns whether another mode than landing may be an old one, or that of the ground, which another topic
        tells.
        """
        if mode in modes.LANDING or self._shown not in modes.LANDING or self.is_on_ground:
            self._left_landing.discard()
            return False
        left = self._left_landing.sample
        if left is None:
            self._left_landing.set(None, now_s)
        return left is None or now_s - left.time_s < _SKEW_S

    def on_control_mode(self, message: Message, now_s: float) -> None:
        """Takes the controller of the aircraft."""
        is_ours = message["device_mode"] == _OURS and bool(message["control_auth"])
        other = _APP if message["device_mode"] == _APP else _REMOTE
        if is_ours:
            self._granted_s, self._ours_s = -math.inf, now_s
        elif now_s - self._granted_s < _GRANT_SHOWS_S:
            return
        self._device.set(_OURS if is_ours else other, now_s)

    def on_rc_connection(self, message: Message, _: float) -> None:
        """Takes whether the remote controller is connected."""
        self._has_rc = bool(message["air_or_ground_disconnected"])

    def on_battery(self, message: Message, _: float) -> None:
        """Takes the battery; its current is negative while it discharges. What it has not measured is no number."""
        scale = self.wrapper
        found = Battery(
            _known(number(message["percentage"]) * scale.battery_scale * 100.0),
            _known(number(message["voltage"]) * scale.volt_scale),
            _known(-number(message["current"]) * scale.volt_scale),
        )
        if self._plausibility.accepts_battery(found):
            self._battery = None if found == Battery() else found

    def on_height(self, message: Message, now_s: float) -> None:
        """Takes the height above the ground, or above where it took off."""
        self.height.set(number(message["data"]), now_s)

    def on_home(self, message: Message, _: float) -> None:
        """Takes where it would return to, in radians: the wrapper passes DJI's own numbers on."""
        home = GeoPoint(*(math.degrees(number(message[name])) for name in ("latitude", "longitude")))
        is_near = self._plausibility.accepts_geo_point(home) and self._is_near(home)
        self._home = home if is_near else None

    def on_home_status(self, message: Message, _: float) -> None:
        """Takes whether its home is set; what it says of it before counts for nothing."""
        self._is_home_set = bool(message["data"])

    def _is_near(self, home: GeoPoint) -> bool:
        """Returns whether it may have come from there."""
        here, projection = self._geo, self.frame.projection
        if here is None or projection is None:
            return False
        points = (projection.to_local(each.latitude_deg, each.longitude_deg, 0.0) for each in (here, home))
        offset = next(points) - next(points)
        if offset.horizontal_norm() <= _FARTHEST_HOME_M:
            return True
        if not self._is_home_rejected:
            logs.event(_log, logging.WARNING, "home_too_far", distance_m=round(offset.horizontal_norm()))
        self._is_home_rejected = True
        return False

    def on_motor_error(self, message: Message, _: float) -> None:
        """Takes why the motors would not start; 0: they would."""
        self._motor_error = int(number(message["data"]))

    def on_obstacles(self, message: Message, _: float) -> None:
        """Takes the distances of obstacles."""
        names = [name for name in ("front", "left", "back", "right") if message[f"{name}_health"]]
        self.obstacles.distances_m = {name: number(message[name]) for name in names}

    def text_of(self, message: Message) -> str:
        """Returns what the wrapper has logged as a warning or an error; empty if it is neither, or another node's."""
        least = _WARNING_ROS2 if "stamp" in message else _WARNING_ROS1
        is_ours = self.wrapper.logger in str(message.get("name"))
        return str(message["msg"]) if is_ours and int(number(message["level"])) >= least else ""

    def say(self, text: str, now_s: float) -> None:
        """Tells people something for a while: in the status text."""
        self._text = Sample(text, now_s)

    def note_severity(self, message: Message, text: str, now_s: float) -> None:
        """Tells a text of the wrapper that it logs as fatal as a severe one."""
        fatal = _FATAL_ROS2 if "stamp" in message else _FATAL_ROS1
        self.severe_texts.on_text(text, SEVERE if int(number(message["level"])) >= fatal else SEVERE + 1, now_s)

    # --- What they say together ---------------------------------------------------------------------------------------

    @property
    def has_authority(self) -> bool:
        """Whether the aircraft follows us."""
        return self._device.value == _OURS

    @property
    def is_authority_known(self) -> bool:
        """Whether the controller of the aircraft is known."""
        return self._device.sample is not None

    @property
    def mode_s(self) -> float:
        """Time of the older one of display mode and authority."""
        mode = _mode(self._display.sample, self._device.sample)
        return -math.inf if mode is None else mode.time_s

    @property
    def why_authority_lost(self) -> str:
        """Human-readable sign that another program has the control authority; empty: the wrapper shows none."""
        if self.wrapper.says_authority:
            return "" if self.has_authority else "it follows another device"
        return self.authority.why_lost

    @property
    def is_landing(self) -> bool:
        """Whether it lands by itself, and takes a confirmation."""
        return self._shown == modes.AUTO_LANDING

    @property
    def is_descending(self) -> bool:
        """Whether it lands by itself, for whatever reason."""
        return self._shown in modes.LANDING

    @property
    def _shown(self) -> int | None:
        """The display mode."""
        return self._display.value

    @property
    def flight_status(self) -> int | None:
        """Whether it stands, runs its motors on the ground, or flies."""
        return self._status.value

    @property
    def is_on_ground(self) -> bool:
        """Whether it stands on the ground."""
        status = self.flight_status
        return status is not None and status != modes.IN_AIR

    @property
    def why_not_start(self) -> str:
        """Returns why it would not start its motors, human-readable; empty if it does not say."""
        return motor_error_text(self._motor_error)

    def note_setpoint(self, wanted: Vector3, now_s: float) -> str:
        """Notes what was sent. Returns what brakes it, human-readable; empty if nothing seems to."""
        self.authority.note_setpoint(now_s)
        pose, velocity = self._pose.value, self._velocity.value
        if pose is None or velocity is None:
            return ""
        braked = self.obstacles.observe(wanted, velocity, pose.yaw_rad, now_s)
        self._braked = Sample(braked, now_s)
        return braked

    def missing_topics(self, now_s: float) -> tuple[DjiTopic, ...]:
        """Returns the topics on which nothing came for long, and without which it cannot be flown."""
        self._begun_s = min(self._begun_s, now_s)
        taken_s, never_s, oldest_s = self._taken_s, self._begun_s, now_s - _TOPIC_SILENCE_S
        return tuple([topic for topic in self._required if taken_s.get(topic.handler, never_s) < oldest_s])

    def _status_text(self, missing: str, now_s: float) -> str:
        """Returns the most important thing to say now."""
        braked, last_text = self._braked, self._text
        if missing:
            return missing
        if braked is not None and braked.value and now_s - braked.time_s <= _BRAKED_S:
            return braked.value
        return last_text.value if last_text is not None and now_s - last_text.time_s <= _SAID_S else ""

    def snapshot(self, now_s: float, missing: str = "") -> Snapshot:
        """Returns what is known. `missing` says, human-readable, which topics do not come."""
        status, velocity, device = self._status.sample, self._velocity.sample, self._device.sample
        mode = _mode(self._display.sample, device)
        return Snapshot(
            time_s=now_s,
            control=ControlState(
                armed=None if status is None else Sample(status.value != modes.STOPPED, status.time_s),
                landed=None if status is None else Sample(self._landed(status.value), status.time_s),
                mode=mode,
                failsafe=self._failsafe(),
                held_by=None if mode is None or device is None else self._held_by(device.value),
            ),
            motion=MotionState(
                stamp_s=self._stamp_s,
                measured_s=self._stamp_s,
                estimator=self._estimator(missing, now_s),
                pose=self._pose.sample,
                velocity=None if velocity is None else Sample(Twist(velocity.value, self._rates), velocity.time_s),
                position_geo=self._geo,
            ),
            earth=EarthReference(
                projection=self.frame.projection,
                home_altitude_amsl_m=self._home_altitude_m,
                geoid_separation_m=self._geoid_m,
                home_geo=self._home if self._is_home_set else None,
            ),
            condition=Condition(
                battery=self._battery,
                gps=self._gps(),
                status_text=self._status_text(missing, now_s),
                health=self._health(),
                severe_texts=self.severe_texts.fresh(now_s),
            ),
        )

    def _is_good(self, now_s: float) -> bool:
        level = self._level.sample
        return level is not None and level.value >= self._settings.least_gps_level and now_s - level.time_s < _GPS_AGE_S

    def _estimator(self, missing: str, now_s: float) -> Sample[Estimator] | None:
        level, why = self._level.sample, self._why_bad(missing, now_s)
        if level is None and not missing:
            return None
        return Sample(Estimator(not why, why), now_s if missing or level is None else level.time_s)

    def _why_bad(self, missing: str, now_s: float) -> str:
        """Returns why the position is not good, human-readable; empty if it is."""
        if missing:
            return missing
        velocity = self._velocity.sample
        if velocity is None or now_s - velocity.time_s > _VELOCITY_S:
            return f"no velocity comes ({self.wrapper.topic_of('on_velocity')})"
        quality = self._level.value
        least = self._settings.least_gps_level
        return "" if self._is_good(now_s) else f"the quality of the position is {quality} of 5, and {least} is needed"

    def _gps(self) -> GpsInfo | None:
        level = self._level.value
        if level is None:
            return None
        if self._is_rtk_fixed:
            return GpsInfo(GpsFix.RTK_FIXED)
        return GpsInfo(GpsFix.FIX_3D if level >= self._settings.least_gps_level else GpsFix.NONE)

    def _landed(self, status: int) -> LandedState:
        display = self._shown
        if display in modes.TAKING_OFF:
            return LandedState.TAKING_OFF
        if status != modes.IN_AIR:
            return LandedState.ON_GROUND
        return LandedState.LANDING if display in modes.LANDING else LandedState.IN_AIR

    def _failsafe(self) -> Cause | None:
        display = self._shown
        if display == modes.FORCED_LANDING:
            return Cause.FAILSAFE
        return Cause.RC if display == modes.GO_HOME and not self._has_rc else None

    def _held_by(self, device: int) -> Cause | None:
        if device == _OURS:
            return self._failsafe()
        return Cause.GROUND_STATION if device == _APP else self._failsafe() or Cause.SAFETY_PILOT

    def _health(self) -> Health:
        failing = (self.why_not_start,) if self.why_not_start else ()
        return Health(is_ready_to_arm=not failing, failing_checks=failing)


LINK_S = 1.0
"""Seconds without a message after which the link counts as lost."""
_GPS_AGE_S = 3.0
_TOPIC_SILENCE_S = 3.0
"""Seconds without a message after which a topic is named as missing."""
_BRAKED_S, _SAID_S = 1.0, 10.0
"""Seconds for which the cause of a braking is reported, and the wrapper's log lines and findings."""
_VELOCITY_S = 1.0
"""Without a velocity that is younger, nothing may be flown: UAL brakes and judges arrivals by it."""
_HEIGHT_S = 1.5
"""With an older height it is not known how high it flies."""
_FARTHEST_HOME_M = 30_000.0
"""Farther than its batteries reach."""
_GRANT_SHOWS_S = 0.3
"""Seconds within which the published authority may be older than its grant, until it shows as ours."""
_SKEW_S = 0.1
"""Messages of one moment come within this time."""
_OF_STATE = frozenset(("on_flight_status", "on_display_mode", "on_control_mode"))


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _mode(display: Sample[int] | None, device: Sample[int] | None) -> Sample[Mode] | None:
    """Returns the mode, as old as the older one of its two parts."""
    if display is None or device is None:
        return None
    return Sample(_mode_of(display.value, device.value), min(display.time_s, device.time_s))


def _mode_of(display: int, device: int) -> Mode:
    if display == modes.ENGINE_START:  # nobody has chosen it: it shows while the motors start
        display = modes.P_GPS
    name = modes.name(display)
    if display in modes.LANDING:
        return Mode(name, Control.LAND)
    if display in modes.TAKING_OFF and device == _OURS:
        return Mode(name, Control.TAKE_OFF)
    if display in (modes.GO_HOME, modes.HOTPOINT):
        return Mode(name, Control.OTHER, is_autonomous=True)
    if device == _OURS and display not in modes.TAKING_OFF:
        return Mode(f"SDK ({name})" if display != modes.SDK_CONTROL else name, Control.REFERENCES)
    return Mode(f"{'APP' if device == _APP else 'RC'} ({name})", Control.OTHER)
