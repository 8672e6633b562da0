"""A DJI aircraft: its rules of control, take-off and landing, and the two ROS wrappers in front of it.

It follows velocities of an SDK only with control authority. The pilot's mode switch or pause button takes that away.
The built-in take-off climbs to 1.2 m; a landing stops at 0.7 m above the ground until it is confirmed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from typing_extensions import override

from tests.simulators.dji_cameras import CameraModule, GimbalModule
from tests.simulators.physics import Agility, Body, Target, Vector, control
from tests.simulators.rosbridge import Message, RefusedError, Service
from ual.geometry import Vector3
from ual_daemon.geodesy import EllipsoidProjection

STEP_S = 0.02
ORIGIN = (55.0, 12.0, 30.0)
_AGILITY = Agility(1.0, 1.0, 1.6, 3.0, 12.0, 4.0, 3.0, 5.0, 4.0, 40.0, 2.0, 2.0)
_STALE_S = 0.5
"""A velocity that is older is not flown: it brakes and hovers."""
_TAKE_OFF_M, _TAKE_OFF_M_S = 1.2, 0.6
_CONFIRM_M, _LAND_M_S, _TOUCH_M_S = 0.7, 1.0, 0.4
_BEGIN_S = 1.8e9
RC, APP, SDK = 0, 1, 4
P_GPS, AUTO_TAKE_OFF, AUTO_LANDING, GO_HOME, SDK_CONTROL, ENGINE_START = 6, 11, 12, 15, 17, 41


class Aircraft:
    """The aircraft itself. Axes are north, east, down inside."""

    def __init__(self) -> None:
        self.body = Body()
        self.now_s = 0.0
        self.device = RC
        self.display = P_GPS
        self.has_motors = False
        self.refusal = ""
        """Why it refuses to start its motors and to give authority; empty: it does not."""
        self.gps_level = 5
        self.motor_error = 0
        self.has_rtk = False
        self.obstacle_front_m = math.inf
        self.percentage = 0.9
        self.needs_confirmation = True
        self.protects_landing = False
        """Whether velocities lead it no lower than where a landing waits for its confirmation."""
        self.home_deg = ORIGIN[:2]
        self.is_home_set = True
        self.setpoints: list[tuple[float, Vector, float]] = []
        """All velocities that came, with their times: north, east, down, and yaw rate to the right."""
        self.sticks: Vector = (0.0, 0.0, 0.0)
        self.log: list[str] = []
        self.confirmations_count = 0
        self._confirmed = False
        self._hold: Vector | None = None
        self._projection = EllipsoidProjection(*ORIGIN)
        self._placed_at: Vector | None = None

    # --- Commands -----------------------------------------------------------------------------------------------------

    def obtain(self) -> None:
        self._check_refusal()
        self.device = SDK

    def release(self) -> None:
        if self.device == SDK:
            self.device = RC

    def start_motors(self) -> None:
        self._check_sdk()
        self._check_refusal()
        self.has_motors = True

    def stop_motors(self) -> None:
        self._check_sdk()
        if not self.body.is_on_ground:
            self._fail("motors cannot be stopped in the air")
        self.has_motors, self.display = False, P_GPS

    def take_off(self) -> None:
        self.start_motors()
        if not self.body.is_on_ground:
            self._fail("it is in the air already")
        self.display, self._hold = AUTO_TAKE_OFF, None

    def land(self) -> None:
        self._check_sdk()
        if self.body.is_on_ground:
            self._fail("it is on the ground")
        self.display, self._confirmed, self._hold = AUTO_LANDING, not self.needs_confirmation, None

    def confirm_landing(self) -> None:
        self.confirmations_count += 1
        self._check_sdk()
        if self.display != AUTO_LANDING:
            self._fail("it is not landing")
        self._confirmed = True

    def command(self, velocity: Vector, yaw_rate_rad_s: float) -> None:
        self.setpoints.append((self.now_s, velocity, yaw_rate_rad_s))

    def pilot_takes_over(self) -> None:
        """The pilot's mode switch, or pause button."""
        self.device, self._hold, self.display = RC, None, P_GPS

    def _check_sdk(self) -> None:
        if self.device != SDK:
            self._fail("no control authority. Error code is: 17")

    def _check_refusal(self) -> None:
        if self.refusal:
            self._fail(self.refusal)

    def _fail(self, words: str) -> None:
        self.log.append(words)
        raise RefusedError(words)

    # --- Flight -------------------------------------------------------------------------------------------------------

    @property
    def height_m(self) -> float:
        return self.body.ground_z_m - self.body.position[2]

    @property
    def status(self) -> int:
        if not self.body.is_on_ground:
            return 2
        return 1 if self.has_motors else 0

    def step(self) -> None:
        self.now_s += STEP_S
        if not self.has_motors:
            self.body.fall(STEP_S)
            return
        target = self._target()
        if target is None:
            return
        body = self.body
        wanted, yaw_rate = control(_AGILITY, target, body.position, body.velocity, body.yaw_rad)
        body.fly(wanted, yaw_rate, _AGILITY.jerk_m_s3, STEP_S)
        if body.is_on_ground and self.display == AUTO_LANDING:
            self.has_motors, self.display = False, P_GPS

    def _target(self) -> Target | None:
        if self.display == AUTO_TAKE_OFF:
            if self.height_m < _TAKE_OFF_M:
                return Target(velocity=(0.0, 0.0, -_TAKE_OFF_M_S))
            self.display = P_GPS
        if self.body.is_on_ground and self.display != AUTO_LANDING:
            return self._lift_off()
        if self.display == AUTO_LANDING:
            return self._landing()
        newest = self.setpoints[-1] if self.setpoints else None
        if self.device == SDK and newest is not None and self.now_s - newest[0] < _STALE_S:
            self.display, self._hold = SDK_CONTROL, None
            return Target(velocity=self._protected(self._braked(newest[1])), yaw_rate_rad_s=newest[2])
        if self.device == RC and any(self.sticks):
            self._hold = None
            return Target(velocity=self.sticks)
        if self._hold is None:
            self._hold = self.body.position
        return Target(self._hold)

    def _lift_off(self) -> Target | None:
        """It stands with idle motors; the pilot's throttle makes it fly."""
        return Target(velocity=self.sticks) if self.device == RC and self.sticks[2] < 0.0 else None

    def _landing(self) -> Target:
        is_near = self.height_m <= _CONFIRM_M
        if is_near and not self._confirmed:
            return Target()
        return Target(velocity=(0.0, 0.0, _TOUCH_M_S if is_near else _LAND_M_S))

    def _braked(self, velocity: Vector) -> Vector:
        forward = velocity[0] * math.cos(self.body.yaw_rad) + velocity[1] * math.sin(self.body.yaw_rad)
        is_near = self.obstacle_front_m < 5.0 and forward > 0.0
        return (0.0, 0.0, velocity[2]) if is_near else velocity

    def _protected(self, velocity: Vector) -> Vector:
        is_held = self.protects_landing and self.height_m <= _CONFIRM_M and velocity[2] > 0.0
        return (velocity[0], velocity[1], 0.0) if is_held else velocity

    # --- Messages that both wrappers have -----------------------------------------------------------------------------

    def stamped(self, **fields: Any) -> Message:
        whole = int(self.now_s)
        return {
            "header": {"stamp": {"sec": int(_BEGIN_S) + whole, "nanosec": int((self.now_s - whole) * 1e9)}},
            **fields,
        }

    def attitude(self) -> Message:
        half = (math.pi / 2.0 - self.body.yaw_rad) / 2.0
        return self.stamped(quaternion={"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)})

    def velocity(self) -> Message:
        north, east, down = self.body.velocity
        return self.stamped(vector={"x": east, "y": north, "z": -down})

    def current_position(self, altitude_offset_m: float = 0.0) -> Message:
        if self._placed_at != self.body.position:  # several topics have it, and to convert it takes long
            self._placed_at = north, east, down = self.body.position
            self._place = self._projection.to_geo(Vector3(east, north, -down))
        geo = self._place
        assert geo.altitude_amsl_m is not None
        altitude_m = geo.altitude_amsl_m + altitude_offset_m
        fields = {"latitude": geo.latitude_deg, "longitude": geo.longitude_deg, "altitude": altitude_m}
        return self.stamped(**fields, position_covariance=(0.0,) * 9)


def _one(value: float) -> Message:
    return {"data": value}


class Front:
    """A wrapper in front of an aircraft, as a node. `kinds` are the type, rate in Hz and content of each topic."""

    prefix = ""

    def __init__(self, aircraft: Aircraft, kinds: Mapping[str, tuple[str, float, Callable[[], Message]]]) -> None:
        self.aircraft = aircraft
        self._kinds = {f"{self.prefix}{name}": kind for name, kind in kinds.items()}
        self._due_s = dict.fromkeys(self._kinds, 0.0)

    @property
    def topics(self) -> Mapping[str, str]:
        return {topic: kind for topic, (kind, _, _) in self._kinds.items()}

    @property
    def subscriptions(self) -> Mapping[str, tuple[str, Callable[[Message], None]]]:
        return {}

    @property
    def services(self) -> Mapping[str, Service]:
        raise NotImplementedError

    def step(self, now_s: float) -> Iterator[tuple[str, Message]]:
        while self.aircraft.now_s + STEP_S <= now_s + 1e-9:
            self.aircraft.step()
            for topic, (_, rate_hz, make) in self._kinds.items():
                if self.aircraft.now_s >= self._due_s[topic] - 1e-9:
                    self._due_s[topic] = self.aircraft.now_s + 1.0 / rate_hz
                    yield topic, make()
            yield from self._logged()

    def _logged(self) -> Iterator[tuple[str, Message]]:
        raise NotImplementedError

    def joy(self, message: Message) -> None:
        """Takes east, north, up, and the yaw rate to the left."""
        east, north, up, yaw_rate = message["axes"]
        self.aircraft.command((north, east, -up), -yaw_rate)


class Psdk(Front):
    """psdk_ros2. Its services say whether they succeeded, and only its log says why not."""

    prefix = "/psdk_ros2/"

    def __init__(
        self,
        aircraft: Aircraft,
        state_rate_hz: float = 50.0,
        authority_rate_hz: float | None = None,
        authority_after_s: float = 0.0,
    ) -> None:
        """`authority_after_s` is when the authority is published first: its topic is not in step with the others."""
        a, one = aircraft, _one
        self.camera_module, self.gimbal_module = CameraModule(), GimbalModule()
        super().__init__(
            aircraft,
            {
                "attitude": ("geometry_msgs/QuaternionStamped", 50.0, a.attitude),
                "velocity_ground_fused": ("geometry_msgs/Vector3Stamped", 50.0, a.velocity),
                "angular_rate_ground_fused": ("geometry_msgs/Vector3Stamped", 50.0, self._rates),
                "altitude_sea_level": ("std_msgs/Float32", 50.0, lambda: one(a.current_position()["altitude"])),
                "gps_position_fused": ("sensor_msgs/NavSatFix", 50.0, lambda: a.current_position(40.0)),
                "rtk_position": ("sensor_msgs/NavSatFix", 5.0, a.current_position),
                "rtk_position_info": ("std_msgs/UInt8", 5.0, lambda: one(50 if a.has_rtk else 0)),
                "gps_control_level": ("std_msgs/UInt8", 5.0, lambda: one(a.gps_level)),
                "flight_status": ("psdk_interfaces/FlightStatus", state_rate_hz, self._status),
                "display_mode": ("psdk_interfaces/DisplayMode", state_rate_hz, self._display),
                "control_mode": ("psdk_interfaces/ControlMode", authority_rate_hz or state_rate_hz, self._control),
                "rc_connection_status": ("psdk_interfaces/RCConnectionStatus", 1.0, self._rc),
                "battery": ("sensor_msgs/BatteryState", 1.0, self._battery),
                "height_above_ground": ("std_msgs/Float32", 50.0, lambda: one(a.height_m)),
                "home_point": ("sensor_msgs/NavSatFix", 1.0, self._home),
                "home_point_status": ("std_msgs/Bool", 1.0, lambda: one(a.is_home_set)),
                "motor_start_error": ("std_msgs/UInt16", 1.0, lambda: one(a.motor_error)),
                "relative_obstacle_info": ("psdk_interfaces/RelativeObstacleInfo", 10.0, self._obstacles),
                "gimbal_angles": ("geometry_msgs/Vector3Stamped", 10.0, self._gimbal_angles),
                "gimbal_status": ("psdk_interfaces/GimbalStatus", 1.0, self._gimbal_status),
            },
        )
        self._due_s[f"{self.prefix}control_mode"] = authority_after_s

    @property
    def subscriptions(self) -> Mapping[str, tuple[str, Callable[[Message], None]]]:
        own = {"/psdk_ros2/flight_control_setpoint_ENUvelocity_yawrate": ("sensor_msgs/Joy", self.joy)}
        return {**own, **self.gimbal_module.subscriptions}

    @property
    def services(self) -> Mapping[str, Service]:
        a = self.aircraft
        actions = {
            "obtain_ctrl_authority": a.obtain,
            "release_ctrl_authority": a.release,
            "turn_on_motors": a.start_motors,
            "turn_off_motors": a.stop_motors,
            "takeoff": a.take_off,
            "land": a.land,
            "start_confirm_landing": a.confirm_landing,
        }
        own = {f"/psdk_ros2/{name}": _triggered(action) for name, action in actions.items()}
        return {**own, **self.camera_module.services, **self.gimbal_module.services}

    @override
    def _logged(self) -> Iterator[tuple[str, Message]]:
        """Logs why something was refused. Its answer comes before this."""
        log, self.aircraft.log = self.aircraft.log, []
        for words in log:
            yield "/rosout", self._log_message(words)

    def _log_message(self, words: str) -> Message:
        return {
            "stamp": {"sec": 0, "nanosec": 0},
            "level": 40,
            "name": "flight_control_node",
            "msg": words,
            "topics": [""],
        }

    def _rates(self) -> Message:
        return self.aircraft.stamped(vector={"x": 0.0, "y": 0.0, "z": -self.aircraft.body.yaw_rate_rad_s})

    def _gimbal_angles(self) -> Message:
        return self.aircraft.stamped(**self.gimbal_module.angles())

    def _gimbal_status(self) -> Message:
        return self.aircraft.stamped(**self.gimbal_module.status())

    def _status(self) -> Message:
        return self.aircraft.stamped(flight_status=self.aircraft.status)

    def _display(self) -> Message:
        return self.aircraft.stamped(display_mode=self.aircraft.display)

    def _control(self) -> Message:
        device = self.aircraft.device
        return self.aircraft.stamped(control_mode=0, device_mode=device, control_auth=int(device == SDK))

    def _rc(self) -> Message:
        return self.aircraft.stamped(
            air_connection=1, ground_connection=1, app_connection=0, air_or_ground_disconnected=1
        )

    def _battery(self) -> Message:
        return self.aircraft.stamped(percentage=self.aircraft.percentage, voltage=44.4, current=-10.0)

    def _home(self) -> Message:
        """In radians, as DJI has it: the wrapper does not convert it."""
        latitude, longitude = map(math.radians, self.aircraft.home_deg)
        return self.aircraft.stamped(latitude=latitude, longitude=longitude, altitude=0.0)

    def _obstacles(self) -> Message:
        names = ("down", "front", "right", "back", "left", "up")
        distances = {name: self.aircraft.obstacle_front_m if name == "front" else 60.0 for name in names}
        health = {f"{name}_health": int(math.isfinite(distances[name])) for name in names}
        return self.aircraft.stamped(**distances, **health, reserved=0)


class _Osdk(Front):
    """Topics of both nodes of dji_osdk_ros. Nothing reports the holder of the control authority."""

    prefix = "/dji_osdk_ros/"

    def __init__(self, aircraft: Aircraft) -> None:
        a, one = aircraft, _one
        super().__init__(
            aircraft,
            {
                "attitude": ("geometry_msgs/QuaternionStamped", 50.0, a.attitude),
                "velocity": ("geometry_msgs/Vector3Stamped", 50.0, a.velocity),
                "angular_velocity_fused": ("geometry_msgs/Vector3Stamped", 50.0, self._rates),
                "gps_position": ("sensor_msgs/NavSatFix", 50.0, a.current_position),
                "gps_health": ("std_msgs/UInt8", 50.0, lambda: one(a.gps_level)),
                "flight_status": ("std_msgs/UInt8", 50.0, lambda: one(a.status)),
                "display_mode": ("std_msgs/UInt8", 50.0, lambda: one(a.display)),
                "battery_state": ("sensor_msgs/BatteryState", 5.0, self._battery),
                "height_above_takeoff": ("std_msgs/Float32", 50.0, lambda: one(a.height_m)),
            },
        )

    @override
    def _logged(self) -> Iterator[tuple[str, Message]]:
        """Logs nothing: what DJI's SDK says of a refusal (DERROR) is on the console of the node only."""
        self.aircraft.log.clear()
        yield from ()

    def _rates(self) -> Message:
        return self.aircraft.stamped(vector={"x": 0.0, "y": 0.0, "z": -self.aircraft.body.yaw_rate_rad_s})

    def _battery(self) -> Message:
        return self.aircraft.stamped(percentage=100.0 * self.aircraft.percentage, voltage=44400.0, current=-10000.0)


class OsdkSdkNode(_Osdk):
    """The older node: velocities on a topic, services with DJI's answer. It lands without a confirmation."""

    def __init__(self, aircraft: Aircraft) -> None:
        super().__init__(aircraft)
        aircraft.needs_confirmation = False

    @property
    def subscriptions(self) -> Mapping[str, tuple[str, Callable[[Message], None]]]:
        return {"/dji_osdk_ros/flight_control_setpoint_ENUvelocity_yawrate": ("sensor_msgs/Joy", self.joy)}

    @property
    def services(self) -> Mapping[str, Service]:
        a = self.aircraft
        return {
            "/dji_osdk_ros/sdk_control_authority": _chosen("control_enable", {1: a.obtain, 0: a.release}),
            "/dji_osdk_ros/drone_arm_control": _chosen("arm", {1: a.start_motors, 0: a.stop_motors}),
            "/dji_osdk_ros/drone_task_control": _chosen("task", {4: a.take_off, 6: a.land}),
        }


class OsdkVehicleNode(_Osdk):
    """The newer node: everything is a service, and one that fails has no values."""

    @property
    def services(self) -> Mapping[str, Service]:
        a = self.aircraft
        tasks = {4: a.take_off, 6: a.land, 7: a.start_motors, 8: a.stop_motors, 30: a.confirm_landing}
        return {
            "/obtain_release_control_authority": _chosen("enable_obtain", {1: a.obtain, 0: a.release}, fails=True),
            "/flight_task_control": _chosen("task", tasks, fails=True),
            "/set_joystick_mode": lambda _: {"result": True},
            "/joystick_action": self._joystick,
        }

    def _joystick(self, arguments: Message) -> Message:
        command = arguments["joystickCommand"]
        self.aircraft.command((command["x"], command["y"], -command["z"]), math.radians(command["yaw"]))
        return {"result": True}


def _triggered(action: Callable[[], None]) -> Service:
    def call(_: Message) -> Message:
        try:
            action()
        except RefusedError:
            return {"success": False, "message": ""}
        return {"success": True, "message": ""}

    return call


def _chosen(name: str, actions: Mapping[int, Callable[[], None]], *, fails: bool = False) -> Service:
    def call(arguments: Message) -> Message:
        try:
            actions[int(arguments[name])]()
        except RefusedError as error:
            if fails:
                raise RefusedError("service responded with an error: b''") from error
            return {"result": False, "cmd_set": 1, "cmd_id": 0, "ack_data": 1}
        return {"result": True} if fails else {"result": True, "cmd_set": 1, "cmd_id": 0, "ack_data": 2}

    return call
