"""The motion of many vehicles, stepped together as vectors. `single.Single` moves a single vehicle by the same
equations.

A vehicle responds to a velocity command as a first-order system (`response_s`), within its limits of speed and
acceleration. Its autopilot converts position setpoints to velocity commands by their feed-forward and a proportional
gain. The ground is level, at the height at which the vehicle starts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ual_daemon.backends.light.physics import (
    COMMAND_SPEED_FACTOR,
    GRAVITY_M_S2,
    LANDED_AFTER_S,
    LANDED_DRAIN_SHARE,
    LEAST_LIMIT_VALUE,
    LIFT_OFF_M,
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
from ual_daemon.backends.light.single import Single
from ual_daemon.backends.values import PositionSetpoint, Setpoint

if TYPE_CHECKING:  # numpy.typing takes long to import
    from numpy.typing import NDArray

Floats: TypeAlias = "NDArray[np.float64]"
Bools: TypeAlias = "NDArray[np.bool_]"
Ints: TypeAlias = "NDArray[np.int64]"


_MANUAL, _GUIDED, _HOLD, _LAND = (
    int(mode) for mode in (FlightMode.MANUAL, FlightMode.GUIDED, FlightMode.HOLD, FlightMode.LAND)
)
"""Plain numbers: numpy asks a member of an enumeration for several attributes each time."""
_LEAST_ROWS_COUNT = 4
"""Setpoints from which on it is faster to take them together."""
_ROWS_PER_REPORT = 8
"""Rows that are converted together in the time in which one report is made alone."""


class Fleet:
    """The state of all vehicles of a world, one row for each. Change it only with the world's lock held."""

    def __init__(self, single: Single) -> None:
        """Takes over the first vehicle with its present state."""
        self.count = 0
        self._waiting: dict[int, tuple[Setpoint, float]] = {}
        """Setpoints that came since the last step, and when; of each vehicle the newest."""
        self._reports: list[LightReport] | None = None
        """The reports of the last step, once they were converted."""
        self._asked_count, self._are_many_asked = 0, False
        self.position: Floats = np.zeros((0, 3))
        self.velocity: Floats = np.zeros((0, 3))
        self.yaw: Floats = np.zeros(0)
        self.yaw_rate: Floats = np.zeros(0)
        self.mode: Ints = np.zeros(0, dtype=np.int64)
        self.is_armed: Bools = np.zeros(0, dtype=np.bool_)
        self.is_landed: Bools = np.zeros(0, dtype=np.bool_)
        self.has_flown: Bools = np.zeros(0, dtype=np.bool_)
        self.on_ground_s: Floats = np.zeros(0)
        self.battery_percent: Floats = np.zeros(0)
        # The setpoint of the autopilot, and the pilot's sticks.
        self.by_position: Bools = np.zeros(0, dtype=np.bool_)
        self.setpoint_s: Floats = np.zeros(0)
        self.goal: Floats = np.zeros((0, 3))
        self.goal_velocity: Floats = np.zeros((0, 3))
        self.goal_acceleration: Floats = np.zeros((0, 3))
        self.goal_yaw: Floats = np.zeros(0)
        self.goal_yaw_rate: Floats = np.zeros(0)
        self.hold: Floats = np.zeros((0, 3))
        self.sticks: Floats = np.zeros((0, 4))
        # The vehicle's surroundings and its faults.
        self.ground: Floats = np.zeros(0)
        self.wind: Floats = np.zeros((0, 3))
        self.power: Floats = np.zeros(0)
        self.estimate_offset: Floats = np.zeros((0, 3))
        self.has_position: Bools = np.zeros(0, dtype=np.bool_)
        self.reported_conditions: Ints = np.zeros(0, dtype=np.int64)
        # The vehicle's limits and properties.
        self.horizontal_speed: Floats = np.zeros(0)
        self.vertical_speed: Floats = np.zeros(0)
        self.horizontal_acceleration: Floats = np.zeros(0)
        self.vertical_acceleration: Floats = np.zeros(0)
        self.max_yaw_rate: Floats = np.zeros(0)
        self.response_s: Floats = np.zeros(0)
        self.landing_speed: Floats = np.zeros(0)
        self.disarm_after_s: Floats = np.zeros(0)
        self.endurance_s: Floats = np.zeros(0)

        self._append(single.row())

    def add(self, settings: LightSettings) -> int:
        """Adds a vehicle that stands on the ground, disarmed. Returns its row."""
        self._append(initial_row(settings))
        return self.count - 1

    def _append(self, row: Mapping[str, Any]) -> None:
        for name, array in vars(self).items():
            if isinstance(array, np.ndarray):
                grown = np.concatenate([array, np.zeros((1, *array.shape[1:]), dtype=array.dtype)])
                if name in row:
                    grown[-1] = row[name]
                setattr(self, name, grown)
        self.count += 1
        self._reports = None

    def changed(self) -> set[int]:
        """Returns the vehicles whose mode, armed, landed or has-position has changed since the last call."""
        conditions = self.mode * 8 + self.is_armed * 4 + self.is_landed * 2 + self.has_position
        differs = conditions != self.reported_conditions
        if not differs.any():  # nearly always
            return set()
        self.reported_conditions = conditions
        return set(np.flatnonzero(differs).tolist())

    def report(self, index: int) -> LightReport:
        """Returns what one autopilot reports."""
        return (
            tuple((self.position[index] + self.estimate_offset[index]).tolist()),
            tuple(self.velocity[index].tolist()),
            self.yaw.item(index),
            self.yaw_rate.item(index),
            self.mode.item(index),
            self.is_armed.item(index),
            self.is_landed.item(index),
            self.has_position.item(index),
            self.battery_percent.item(index),
        )

    def report_of_step(self, index: int) -> LightReport:
        """Returns the same as it was after the last step: what has been commanded since shows after the next one.

        Where many are asked, all are converted at once, which takes a fifth for each.
        """
        self._asked_count += 1
        if not self._are_many_asked:
            return self.report(index)
        if self._reports is None:
            columns = self.yaw, self.yaw_rate, self.mode, self.is_armed, self.is_landed, self.has_position
            position = (self.position + self.estimate_offset).tolist()
            others = (each.tolist() for each in (*columns, self.battery_percent))
            self._reports = list(zip(position, self.velocity.tolist(), *others, strict=True))
        return self._reports[index]

    def set_setpoint(self, index: int, setpoint: Setpoint, now_s: float) -> None:
        """Sets the setpoint of one autopilot, from the next step on."""
        self._waiting[index] = (setpoint, now_s)

    def _take_setpoints(self) -> None:
        """Takes the setpoints that came since the last step."""
        waiting, self._waiting = self._waiting, {}
        indices: list[int] = []
        numbers: list[float] = []
        for index, (setpoint, now_s) in waiting.items():
            if len(waiting) < _LEAST_ROWS_COUNT or not isinstance(setpoint, PositionSetpoint):
                self._take_setpoint(index, setpoint, now_s)
                continue
            p, v, a = setpoint.position, setpoint.velocity, setpoint.acceleration
            indices.append(index)
            numbers += (p.x, p.y, p.z, v.x, v.y, v.z, a.x, a.y, a.z, setpoint.yaw_rad, setpoint.yaw_rate_rad_s, now_s)
        if indices:
            is_whole = len(indices) == self.count and indices == list(range(self.count))
            at = slice(None) if is_whole else np.array(indices)  # a slice is faster than indices
            self._take_positions(at, np.array(numbers).reshape(len(indices), -1))

    def _take_positions(self, at: slice | Ints, rows: Floats) -> None:
        """As `_take_setpoint`, for many positions at once."""
        velocity, acceleration, now_s = rows[:, 3:6], rows[:, 6:9], rows[:, 11]
        is_next = self.by_position[at] & (now_s - self.setpoint_s[at] < 1.5 * SIM_STEP_S)
        before = np.where(is_next[:, None], self.goal_acceleration[at], acceleration)
        self.setpoint_s[at] = now_s
        self.by_position[at] = True
        self.goal[at] = rows[:, :3]
        self.goal_acceleration[at] = acceleration
        self.goal_velocity[at] = velocity + (3.0 * acceleration - before) * (self.response_s[at] / 2)[:, None]
        self.goal_yaw[at], self.goal_yaw_rate[at] = rows[:, 9], rows[:, 10]

    def _take_setpoint(self, index: int, setpoint: Setpoint, now_s: float) -> None:
        """Takes one setpoint.

        The first-order response lags by `response_s`: so the velocity is commanded that is wanted after that time. A
        command lasts one step, in which the acceleration is taken to change as it did in the step before.
        """
        is_next = self.by_position.item(index) and now_s - self.setpoint_s.item(index) < 1.5 * SIM_STEP_S
        self.setpoint_s[index] = now_s
        self.goal_yaw_rate[index] = setpoint.yaw_rate_rad_s
        if isinstance(setpoint, PositionSetpoint):
            self.by_position[index] = True
            p, v, a = setpoint.position, setpoint.velocity, setpoint.acceleration
            self.goal[index] = (p.x, p.y, p.z)
            # One vehicle's few numbers are calculated faster without numpy.
            bx, by, bz = self.goal_acceleration[index].tolist() if is_next else (a.x, a.y, a.z)
            half_s = self.response_s.item(index) / 2
            self.goal_acceleration[index] = (a.x, a.y, a.z)
            self.goal_velocity[index] = (
                v.x + (3.0 * a.x - bx) * half_s,
                v.y + (3.0 * a.y - by) * half_s,
                v.z + (3.0 * a.z - bz) * half_s,
            )
            self.goal_yaw[index] = setpoint.yaw_rad
        else:
            self.by_position[index] = False
            self.goal_velocity[index] = tuple(setpoint.velocity)

    def set_mode(self, index: int, mode: FlightMode) -> None:
        """Switches the mode of one autopilot. It holds its position until it gets a setpoint."""
        if (before := self._waiting.pop(index, None)) is not None:
            self._take_setpoint(index, *before)
        self.mode[index] = mode
        self.hold[index] = self.position[index] + self.estimate_offset[index]
        self.sticks[index] = 0.0
        if mode is FlightMode.GUIDED:
            self.by_position[index] = True
            self.goal[index] = self.hold[index]
            self.goal_velocity[index] = 0.0
            self.goal_acceleration[index] = 0.0
            self.goal_yaw[index] = self.yaw[index]
            self.goal_yaw_rate[index] = 0.0

    def step(self, now_s: float) -> None:
        """Moves all vehicles by one step of `SIM_STEP_S`."""
        self._are_many_asked = self._asked_count * _ROWS_PER_REPORT > self.count
        self._asked_count, self._reports = 0, None
        self._take_setpoints()
        lost_setpoints = now_s - self.setpoint_s > SETPOINT_TIMEOUT_S
        if lost_setpoints.any():  # seldom, as the others below: numpy takes the time of many steps for one array
            for index in np.flatnonzero(lost_setpoints & (self.mode == _GUIDED) & ~self.is_landed):
                self.set_mode(int(index), FlightMode.HOLD)
        if not self.has_position.all():
            needs_position = (self.mode == _GUIDED) | (self.mode == _HOLD)
            for index in np.flatnonzero(~self.has_position & self.is_armed & needs_position):
                self.set_mode(int(index), FlightMode.ALTITUDE)
        command, yaw_rate = self._commands()
        place = self.position
        self._accelerate(command)
        turning = np.minimum(np.maximum(yaw_rate, -self.max_yaw_rate), self.max_yaw_rate)
        self.yaw_rate = np.where(self.is_landed, 0.0, turning)
        self.yaw = np.remainder(self.yaw + self.yaw_rate * SIM_STEP_S + math.pi, math.tau) - math.pi
        self._touch_ground(command, place)
        drain = (
            np.where(self.is_landed, LANDED_DRAIN_SHARE, 1.0) * self.is_armed * (100.0 * SIM_STEP_S) / self.endurance_s
        )
        self.battery_percent = np.maximum(0.0, self.battery_percent - drain)

    def _commands(self) -> tuple[Floats, Floats]:
        """Returns the velocities (N, 3) and yaw rates (N,) that the autopilots command."""
        guided, by_position = self.mode == _GUIDED, self.by_position
        estimated = self.position + self.estimate_offset
        yaw_error = np.remainder(self.goal_yaw - self.yaw + math.pi, math.tau) - math.pi
        if (guided & by_position).all():  # as below, without a choice for each
            command = POSITION_GAIN * (self.goal - estimated) + self.goal_velocity
            return command, self.goal_yaw_rate + YAW_GAIN * yaw_error
        target = np.where((guided & by_position)[:, None], self.goal, self.hold)
        keeps_place = (guided & by_position) | (self.mode == _HOLD) | (self.mode == _LAND)
        command = np.where(keeps_place[:, None], POSITION_GAIN * (target - estimated), 0.0)
        command += np.where(guided[:, None], self.goal_velocity, 0.0)
        command[:, 2] = np.where(self.mode == _LAND, -self.landing_speed, command[:, 2])
        yaw_rate = np.where(guided, self.goal_yaw_rate + np.where(by_position, YAW_GAIN * yaw_error, 0.0), 0.0)
        manual = self.mode == _MANUAL
        if manual.any():
            forward, left, up, turn = self.sticks.T
            cos, sin = np.cos(self.yaw), np.sin(self.yaw)
            by_sticks = np.stack(
                [
                    (forward * cos - left * sin) * self.horizontal_speed,
                    (forward * sin + left * cos) * self.horizontal_speed,
                    up * self.vertical_speed,
                ],
                axis=1,
            )
            command = np.where(manual[:, None], by_sticks, command)
            yaw_rate = np.where(manual, turn * self.max_yaw_rate, yaw_rate)
        return command, yaw_rate

    def _accelerate(self, command: Floats) -> None:
        """Applies the first-order response to the velocity commands, within the limits; integrates by the trapezoidal
        rule.
        """
        limit = COMMAND_SPEED_FACTOR
        command = _limited(command, limit * self.horizontal_speed, limit * self.vertical_speed)
        acceleration = (command - self.velocity) / self.response_s[:, None]
        # The limits apply without wind. Against the wind the vehicle can accelerate by as much more as the wind needs.
        horizontal, vertical = self.horizontal_acceleration, self.vertical_acceleration
        push = WIND_DRAG * self.wind if self.wind.any() else None
        if push is not None:
            horizontal, vertical = horizontal + np.hypot(push[:, 0], push[:, 1]), vertical + np.abs(push[:, 2])
        acceleration = _limited(acceleration, self.power * horizontal, self.power * vertical)
        if push is not None:
            acceleration += push
        before = self.velocity
        # Limits the horizontal and the vertical part separately: this gives the nearest velocity within the limits,
        # which needs no more acceleration.
        after = before + acceleration * SIM_STEP_S
        fast = np.hypot(after[:, 0], after[:, 1]) / self.horizontal_speed
        after[:, :2] /= np.maximum(1.0, fast)[:, None]
        after[:, 2] = np.minimum(np.maximum(after[:, 2], -self.vertical_speed), self.vertical_speed)
        is_lifted = self.is_armed & (self.power > 0.0)
        if not is_lifted.all():
            after = np.where(self.is_armed[:, None], after, 0.0)
            falls = ~self.is_landed & ~is_lifted
            after[falls] = before[falls] - (0.0, 0.0, GRAVITY_M_S2 * SIM_STEP_S)
        self.velocity = after
        self.position = self.position + (before + after) * (SIM_STEP_S / 2)

    def _touch_ground(self, command: Floats, place: Floats) -> None:
        """Keeps vehicles above the ground, and those that stand on it at their `place`. Reports a landing after a
        while, and a lift-off at a small height. Stops the motors after a landing.
        """
        is_low = self.position[:, 2] <= self.ground
        if not (is_low.any() or self.is_landed.any()):  # all in the air: as below, where nothing sits
            self.on_ground_s = np.zeros(self.count)
            self.has_flown = (self.has_flown | (self.position[:, 2] > self.ground + LIFT_OFF_M)) & self.is_armed
            return
        stays = is_low & ((command[:, 2] <= 0.0) | ~self.is_armed)
        sits = stays | (self.is_landed & ~self.is_armed)
        self.velocity[sits] = 0.0
        self.position[sits, :2] = place[sits, :2]
        self.position[:, 2] = np.maximum(self.position[:, 2], self.ground)
        self.on_ground_s = np.where(sits, self.on_ground_s + SIM_STEP_S, 0.0)
        up = self.position[:, 2] > self.ground + LIFT_OFF_M
        self.is_landed = (self.is_landed | (self.on_ground_s >= LANDED_AFTER_S)) & ~up
        self.has_flown = (self.has_flown | up) & self.is_armed
        rested = self.is_landed & self.has_flown & (self.on_ground_s >= LANDED_AFTER_S + self.disarm_after_s)
        if rested.any():
            self.is_armed &= ~rested
            self.has_flown &= ~rested
            for index in np.flatnonzero(rested):
                self.set_mode(int(index), FlightMode.HOLD)


def _limited(vectors: Floats, horizontal: Floats, vertical: Floats) -> Floats:
    """Scales vectors (N, 3) down to the limits, and keeps their directions."""
    excess = np.maximum(  # LEAST_LIMIT_VALUE: a limit of 0 (motors without power) would divide by zero
        np.hypot(vectors[:, 0], vectors[:, 1]) / np.maximum(horizontal, LEAST_LIMIT_VALUE),
        np.abs(vectors[:, 2]) / np.maximum(vertical, LEAST_LIMIT_VALUE),
    )
    return vectors / np.maximum(1.0, excess)[:, None]
