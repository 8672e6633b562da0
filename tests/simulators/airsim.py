"""One multirotor of a small AirSim: `simple_flight` as it was seen to behave, with its quirks. North, east, down."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from tests.simulators.physics import GRAVITY_M_S2, Agility, Body, Target, Vector, control, plus

STEP_S = 0.02
_GOAL_TIMEOUT_S = 0.06
"""`api_goal_timeout`: so long after the last command it holds its position."""
_HOVER_THROTTLE = 0.61
_TILT_M_S2 = 5.8
_IDLE_N, _PRESSING_N, _RADIANS_PER_ROOT_N = 0.28, 1.25, 328.0
_WIND_DRAG = 0.05
# It follows a horizontal velocity in 1 s, a vertical one in 0.3 s.
_AGILITY = Agility(0.25, 0.25, 1.05, 3.3, 30.0, 6.0, 6.0, 6.0, 5.0, 60.0, 2.5, 2.5)


@dataclass
class Call:
    """A command that lasts: it is answered once it has ended (True), or is replaced (False)."""

    target: Target
    end_s: float
    answer: Any


@dataclass
class Vehicle:
    """One vehicle. `wall_north_m` is a wall across its way."""

    name: str
    home: tuple[float, float, float] = (47.397742, 8.545594, 489.4)
    wall_north_m: float = math.inf
    body: Body = field(default_factory=Body)
    is_armed: bool = True
    """Belief of the firmware; the motors may run all the same."""
    has_api_control: bool = False
    rc: dict[str, Any] = field(default_factory=dict)
    allows_api: bool = True
    keeps_rc: bool = True
    """False: a real remote control overwrites what the API moves."""
    wind: Vector = (0.0, 0.0, 0.0)
    collision: dict[str, Any] = field(default_factory=dict)
    has_collided: bool = False
    _goal: Target | None = None
    _is_stopped: bool = False
    _goal_s: float = 0.0
    _has_flown: bool = False
    _call: Call | None = None
    _thrust_n: float = _IDLE_N
    now_s: float = 0.0

    # --- What the API commands ----------------------------------------------------------------------------------------

    def enable_api_control(self, is_enabled: bool) -> None:
        """Without a command, it then has the remote control's goal: in the air, it falls."""
        if is_enabled and not self.allows_api:
            return
        self.has_api_control = is_enabled
        if is_enabled:
            self._goal = None

    def arm(self) -> bool:
        if not self.has_api_control:
            return False
        self.is_armed, self._is_stopped, self._goal = True, False, None
        return True

    def disarm(self) -> bool:
        """Stops the motors, in the air, too; a velocity that is still flown starts them again."""
        if not self.has_api_control or not self.is_armed:
            return False
        self.is_armed, self._is_stopped, self._goal = False, True, None
        return True

    def move(self, target: Target, duration_s: float, answer: Any) -> None:
        """Begins a command, and ends the one before."""
        self.cancel()
        if duration_s <= 0.0:
            answer(True)
            return
        self._call = Call(target, self.now_s + duration_s, answer)
        self._take(target)

    def cancel(self) -> None:
        if self._call is not None:
            self._call.answer(False)
            self._call = None

    def current_position(self, position: Vector, yaw_rad: float) -> None:
        self.body.position, self.body.yaw_rad = position, yaw_rad
        self.body.velocity = self.body.acceleration = (0.0, 0.0, 0.0)
        self.body.is_on_ground = position[2] >= 0.0

    def _take(self, target: Target) -> None:
        if self.has_api_control:
            self._goal, self._goal_s, self._is_stopped = target, self.now_s, False

    # --- Time ---------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Advances by one step."""
        self.now_s += STEP_S
        if self._call is not None:
            if self.now_s >= self._call.end_s:
                self._call.answer(True)
                self._call = None
            else:
                self._take(self._call.target)
        is_old = self.now_s - self._goal_s > _GOAL_TIMEOUT_S
        if is_old and self.has_api_control and self._has_flown and self._goal and None in self._goal.position:
            self._goal = Target(self.body.position)
        self._move()
        self._touch()

    def _move(self) -> None:
        if self._is_stopped:
            self._thrust_n = 0.0
            self.body.fall(STEP_S)
            if self.body.is_on_ground:
                self._has_flown = False
            return
        acceleration, yaw_rate = self._wanted()
        if self.body.is_on_ground and acceleration[2] >= 0.0:
            self.body.stand()
            self._thrust_n = _IDLE_N if self._goal is None else _PRESSING_N
            return
        self._has_flown = True
        self._thrust_n = (GRAVITY_M_S2 - acceleration[2]) / 4.0
        drag = tuple(_WIND_DRAG * (w - v) for w, v in zip(self.wind, self.body.velocity, strict=True))
        self.body.fly(plus(acceleration, drag), yaw_rate, _AGILITY.jerk_m_s3, STEP_S)  # type: ignore[arg-type]

    def _wanted(self) -> tuple[Vector, float]:
        body = self.body
        if self.has_api_control and self._goal is not None:
            return control(_AGILITY, self._goal, body.position, body.velocity, body.yaw_rad)
        if self.has_api_control or not self.rc.get("is_valid"):
            return (0.0, 0.0, 0.9 * GRAVITY_M_S2), 0.0  # the least throttle
        forward, right = self.rc["pitch"] * _TILT_M_S2, self.rc["roll"] * _TILT_M_S2
        cos, sin = math.cos(body.yaw_rad), math.sin(body.yaw_rad)
        down = GRAVITY_M_S2 * (1.0 - self.rc["throttle"] / _HOVER_THROTTLE)
        return (forward * cos - right * sin, forward * sin + right * cos, down), self.rc["yaw"] * math.pi

    def _touch(self) -> None:
        north, east, down = self.body.position
        if north > self.wall_north_m:
            self.body.position = (self.wall_north_m, east, down)
            self.body.velocity = (0.0, self.body.velocity[1], self.body.velocity[2])
            self.collision = {"time_s": self.now_s, "normal": (-1.0, 0.0, 0.0), "object_name": "Wall"}
            self.has_collided = True

    # --- What it reports ----------------------------------------------------------------------------------------------

    def state(self, epoch_s: float) -> dict[str, Any]:
        body = self.body
        roll, pitch = body.tilt
        rates = (0.0, 0.0, body.yaw_rate_rad_s)
        return {
            "collision": _NO_COLLISION,
            "kinematics_estimated": {
                "position": vector(body.position),
                "orientation": quaternion(roll, pitch, body.yaw_rad),
                "linear_velocity": vector(body.velocity),
                "angular_velocity": vector(rates),
                "linear_acceleration": vector(body.acceleration),
                "angular_acceleration": vector((0.0, 0.0, 0.0)),
            },
            "gps_location": {"latitude": self.home[0], "longitude": self.home[1], "altitude": self.home[2]},
            "timestamp": int((epoch_s + self.now_s) * 1e9),
            "landed_state": int(self._has_flown),
            "rc_data": {"is_valid": bool(self.rc.get("is_valid")), "throttle": 0.0},
        }

    def read_collision(self, epoch_s: float) -> dict[str, Any]:
        """Returns the last collision. `has_collided` says whether it came since this was read last."""
        if not self.collision:
            return _NO_COLLISION
        has_collided, self.has_collided = self.has_collided, False
        return {
            "has_collided": has_collided,
            "time_stamp": int((epoch_s + self.collision["time_s"]) * 1e9),
            "normal": vector(self.collision["normal"]),
            "object_name": self.collision["object_name"],
        }

    def rotors(self) -> dict[str, Any]:
        speed = math.sqrt(max(self._thrust_n, 0.0)) * _RADIANS_PER_ROOT_N
        return {"rotors": [{"thrust": self._thrust_n, "torque_scaler": 0.0, "speed": speed}] * 4, "timestamp": 0}


def vector(values: Vector) -> dict[str, float]:
    return {"x_val": values[0], "y_val": values[1], "z_val": values[2]}


_NO_COLLISION = {"has_collided": False, "time_stamp": 0, "normal": vector((0.0, 0.0, 0.0)), "object_name": ""}
"""Constant answer of ``getMultirotorState`` about collisions."""


def quaternion(roll: float, pitch: float, yaw: float) -> dict[str, float]:
    """Returns the rotation by yaw, then pitch, then roll."""
    cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return {
        "w_val": cr * cp * cy + sr * sp * sy,
        "x_val": sr * cp * cy - cr * sp * sy,
        "y_val": cr * sp * cy + sr * cp * sy,
        "z_val": cr * cp * sy - sr * sp * cy,
    }
