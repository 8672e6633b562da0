"""The motion of a single vehicle, in plain numbers: ten times as fast as vectors with one row, and without numpy."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

from ual_daemon.backends.light.physics import (
    COMMAND_SPEED_FACTOR,
    GRAVITY_M_S2,
    LANDED_AFTER_S,
    LANDED_DRAIN_SHARE,
    LEAST_LIMIT_VALUE,
    LIFT_OFF_M,
    NO_CONDITIONS_CODE,
    POSITION_GAIN,
    SETPOINT_TIMEOUT_S,
    SIM_STEP_S,
    WIND_DRAG,
    YAW_GAIN,
    FlightMode,
    LightReport,
    initial_row,
)
from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.backends.values import PositionSetpoint, Setpoint

Row: TypeAlias = tuple[float, float, float]

_ZERO: Row = (0.0, 0.0, 0.0)


class Single:
    """The state of the only vehicle of a world, in columns with one row. The columns and the equations are the same as
    in `fleet.Fleet`.

    Change it only with the world's lock held.
    """

    def __init__(self) -> None:
        self.count = 0
        self.position = [_ZERO]
        self.velocity = [_ZERO]
        self.yaw = [0.0]
        self.yaw_rate = [0.0]
        self.mode = [0]
        self.is_armed = [False]
        self.is_landed = [False]
        self.has_flown = [False]
        self.on_ground_s = [0.0]
        self.battery_percent = [0.0]
        # The setpoint of the autopilot, and the pilot's sticks.
        self.by_position = [False]
        self.setpoint_s = [0.0]
        self.goal = [_ZERO]
        self.goal_velocity = [_ZERO]
        self.goal_acceleration = [_ZERO]
        self.goal_yaw = [0.0]
        self.goal_yaw_rate = [0.0]
        self.hold = [_ZERO]
        self.sticks = [(0.0, 0.0, 0.0, 0.0)]
        # The vehicle's surroundings and its faults.
        self.ground = [0.0]
        self.wind = [_ZERO]
        self.power = [0.0]
        self.estimate_offset = [_ZERO]
        self.has_position = [False]
        self.reported_conditions = [NO_CONDITIONS_CODE]
        # The vehicle's limits and properties.
        self.horizontal_speed = [0.0]
        self.vertical_speed = [0.0]
        self.horizontal_acceleration = [0.0]
        self.vertical_acceleration = [0.0]
        self.max_yaw_rate = [0.0]
        self.response_s = [0.0]
        self.landing_speed = [0.0]
        self.disarm_after_s = [0.0]
        self.endurance_s = [0.0]

    def add(self, settings: LightSettings) -> int:
        """Adds the vehicle, which stands on the ground, disarmed. Returns its row."""
        for name, value in initial_row(settings).items():
            setattr(self, name, [value])
        self.count = 1
        return 0

    def row(self) -> dict[str, Any]:
        """Returns the whole state of the vehicle by the names of the columns."""
        return {name: column[0] for name, column in vars(self).items() if isinstance(column, list)}

    def changed(self) -> set[int]:
        """Returns the vehicles whose mode, armed, landed or has-position has changed since the last call."""
        conditions = self.mode[0] * 8 + self.is_armed[0] * 4 + self.is_landed[0] * 2 + self.has_position[0]
        if conditions == self.reported_conditions[0]:
            return set()
        self.reported_conditions[0] = conditions
        return {0}

    def report(self, index: int) -> LightReport:
        """Returns what the autopilot reports."""
        return (
            _sum(self.position[0], self.estimate_offset[0]),
            self.velocity[0],
            self.yaw[0],
            self.yaw_rate[0],
            self.mode[0],
            self.is_armed[0],
            self.is_landed[0],
            self.has_position[0],
            self.battery_percent[0],
        )

    def report_of_step(self, index: int) -> LightReport:
        """Returns the same: one vehicle has no columns to convert."""
        return self.report(index)

    def set_setpoint(self, index: int, setpoint: Setpoint, now_s: float) -> None:
        """Sets the setpoint of the autopilot."""
        is_next = self.by_position[0] and now_s - self.setpoint_s[0] < 1.5 * SIM_STEP_S
        self.setpoint_s[0] = now_s
        self.goal_yaw_rate[0] = setpoint.yaw_rate_rad_s
        vx, vy, vz = setpoint.velocity
        if isinstance(setpoint, PositionSetpoint):
            self.by_position[0] = True
            x, y, z = setpoint.position
            self.goal[0] = (x, y, z)
            # See `fleet.Fleet.set_setpoint`.
            ax, ay, az = setpoint.acceleration
            bx, by, bz = self.goal_acceleration[0] if is_next else (ax, ay, az)
            self.goal_acceleration[0] = (ax, ay, az)
            response_s = self.response_s[0]
            self.goal_velocity[0] = (
                vx + (ax + (ax - bx) / 2) * response_s,
                vy + (ay + (ay - by) / 2) * response_s,
                vz + (az + (az - bz) / 2) * response_s,
            )
            self.goal_yaw[0] = setpoint.yaw_rad
        else:
            self.by_position[0] = False
            self.goal_velocity[0] = (vx, vy, vz)

    def set_mode(self, index: int, mode: FlightMode) -> None:
        """Switches the mode of the autopilot. It holds its position until it gets a setpoint."""
        self.mode[0] = int(mode)
        self.hold[0] = _sum(self.position[0], self.estimate_offset[0])
        self.sticks[0] = (0.0, 0.0, 0.0, 0.0)
        if mode is FlightMode.GUIDED:
            self.by_position[0] = True
            self.goal[0] = self.hold[0]
            self.goal_velocity[0] = _ZERO
            self.goal_acceleration[0] = _ZERO
            self.goal_yaw[0] = self.yaw[0]
            self.goal_yaw_rate[0] = 0.0

    def step(self, now_s: float) -> None:
        """Moves the vehicle by one step of `SIM_STEP_S`."""
        lost_setpoints = self.mode[0] == FlightMode.GUIDED and now_s - self.setpoint_s[0] > SETPOINT_TIMEOUT_S
        if lost_setpoints and not self.is_landed[0]:
            self.set_mode(0, FlightMode.HOLD)
        needs_position = self.mode[0] in (FlightMode.GUIDED, FlightMode.HOLD)
        if not self.has_position[0] and self.is_armed[0] and needs_position:
            self.set_mode(0, FlightMode.ALTITUDE)
        command, yaw_rate = self._command()
        place = self.position[0]
        self._accelerate(command)
        limit = self.max_yaw_rate[0]
        self.yaw_rate[0] = 0.0 if self.is_landed[0] else max(-limit, min(limit, yaw_rate))
        self.yaw[0] = (self.yaw[0] + self.yaw_rate[0] * SIM_STEP_S + math.pi) % math.tau - math.pi
        self._touch_ground(command, place)
        if self.is_armed[0]:
            drain = (LANDED_DRAIN_SHARE if self.is_landed[0] else 1.0) * (100.0 * SIM_STEP_S) / self.endurance_s[0]
            self.battery_percent[0] = max(0.0, self.battery_percent[0] - drain)

    def _command(self) -> tuple[Row, float]:
        """Returns the velocity and the yaw rate that the autopilot commands."""
        mode = self.mode[0]
        if mode == FlightMode.MANUAL:
            forward, left, up, turn = self.sticks[0]
            cos, sin, speed = math.cos(self.yaw[0]), math.sin(self.yaw[0]), self.horizontal_speed[0]
            by_sticks = (
                (forward * cos - left * sin) * speed,
                (forward * sin + left * cos) * speed,
                up * self.vertical_speed[0],
            )
            return by_sticks, turn * self.max_yaw_rate[0]
        if mode == FlightMode.ALTITUDE:
            return _ZERO, 0.0
        guided = mode == FlightMode.GUIDED
        x = y = z = 0.0
        if not guided or self.by_position[0]:
            tx, ty, tz = self.goal[0] if guided else self.hold[0]
            ex, ey, ez = _sum(self.position[0], self.estimate_offset[0])
            x, y, z = POSITION_GAIN * (tx - ex), POSITION_GAIN * (ty - ey), POSITION_GAIN * (tz - ez)
        if mode == FlightMode.LAND:
            return (x, y, -self.landing_speed[0]), 0.0
        if not guided:
            return (x, y, z), 0.0
        yaw_rate = self.goal_yaw_rate[0]
        if self.by_position[0]:
            yaw_rate += YAW_GAIN * ((self.goal_yaw[0] - self.yaw[0] + math.pi) % math.tau - math.pi)
        return _sum((x, y, z), self.goal_velocity[0]), yaw_rate

    def _accelerate(self, command: Row) -> None:
        """Applies the first-order response to the velocity command, within the limits; integrates by the trapezoidal
        rule.
        """
        top, climb, response_s = self.horizontal_speed[0], self.vertical_speed[0], self.response_s[0]
        bx, by, bz = self.velocity[0]
        cx, cy, cz = _limited(command, COMMAND_SPEED_FACTOR * top, COMMAND_SPEED_FACTOR * climb)
        # The limits apply without wind. Against the wind the vehicle can accelerate by as much more as the wind needs.
        wx, wy, wz = (WIND_DRAG * each for each in self.wind[0])
        ax, ay, az = _limited(
            ((cx - bx) / response_s, (cy - by) / response_s, (cz - bz) / response_s),
            self.power[0] * (self.horizontal_acceleration[0] + math.hypot(wx, wy)),
            self.power[0] * (self.vertical_acceleration[0] + abs(wz)),
        )
        # Limits the horizontal and the vertical part separately: this gives the nearest velocity within the limits,
        # which needs no more acceleration.
        vx, vy, vz = bx + (ax + wx) * SIM_STEP_S, by + (ay + wy) * SIM_STEP_S, bz + (az + wz) * SIM_STEP_S
        slower = max(1.0, math.hypot(vx, vy) / top)
        vx, vy, vz = vx / slower, vy / slower, max(-climb, min(climb, vz))
        if not (self.is_armed[0] and self.power[0]) and not self.is_landed[0]:  # it falls
            vx, vy, vz = bx, by, bz - GRAVITY_M_S2 * SIM_STEP_S
        elif not self.is_armed[0]:
            vx = vy = vz = 0.0
        self.velocity[0] = (vx, vy, vz)
        half = SIM_STEP_S / 2
        self.position[0] = _sum(self.position[0], ((bx + vx) * half, (by + vy) * half, (bz + vz) * half))

    def _touch_ground(self, command: Row, place: Row) -> None:
        """Keeps the vehicle above the ground, and at its `place` while it stands there. Reports a landing after a
        while, and a lift-off at a small height. Stops the motors after a landing.
        """
        x, y, z = self.position[0]
        ground, is_armed = self.ground[0], self.is_armed[0]
        sits = (z <= ground and (command[2] <= 0.0 or not is_armed)) or (self.is_landed[0] and not is_armed)
        if sits:
            self.velocity[0] = _ZERO
            x, y, _ = place
        self.position[0] = (x, y, max(z, ground))
        self.on_ground_s[0] = self.on_ground_s[0] + SIM_STEP_S if sits else 0.0
        up = z > ground + LIFT_OFF_M
        self.is_landed[0] = (self.is_landed[0] or self.on_ground_s[0] >= LANDED_AFTER_S) and not up
        self.has_flown[0] = (self.has_flown[0] or up) and is_armed
        has_rested = self.on_ground_s[0] >= LANDED_AFTER_S + self.disarm_after_s[0]
        if self.is_landed[0] and self.has_flown[0] and has_rested:
            self.is_armed[0] = False
            self.has_flown[0] = False
            self.set_mode(0, FlightMode.HOLD)


def _sum(a: Row, b: Row) -> Row:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _limited(vector: Row, horizontal: float, vertical: float) -> Row:
    """Scales a vector down to the limits, and keeps its direction."""
    x, y, z = vector
    # LEAST_LIMIT_VALUE: a limit of 0 (motors without power) would divide by zero.
    excess = max(1.0, math.hypot(x, y) / max(horizontal, LEAST_LIMIT_VALUE), abs(z) / max(vertical, LEAST_LIMIT_VALUE))
    return (x / excess, y / excess, z / excess)
