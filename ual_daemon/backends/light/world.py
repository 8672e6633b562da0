"""The world of the light simulation: time, and the motion of all its vehicles, stepped together in vectors.

A vehicle answers a velocity command with first order (`response_s`), within its limits of speed and acceleration; its
autopilot turns position setpoints into velocity commands by their feed-forward and a proportional gain. The ground is
level, at the height at which the vehicle starts. One thread runs all vehicles of a world; with a speed factor of 0 it
rests, and `step` runs the time.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from ual.errors import InvalidArgumentError, WrongStateError
from ual.geometry import Vector3
from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.backends.values import PositionSetpoint, Setpoint

STEP_S = 0.02
"""The step of simulated time: 50 Hz, as fast as setpoints are useful."""

SETPOINT_TIMEOUT_S = 1.0
"""An autopilot that gets no setpoint for so long while it follows ours holds its position by itself (PX4: 1.2 s)."""

_POSITION_GAIN = 1.5
_YAW_GAIN = 2.0
_WIND_DRAG = 0.1
"""Acceleration by wind, 1/s times its speed; a small multirotor's drag against what its controller must make up."""
_COMMAND_HEADROOM = 1.25
"""How far velocity commands may go beyond the speed limits, so that the limits can be held exactly."""
_LIFT_OFF_M = 0.05
_LANDED_AFTER_S = 0.5
_LATEST_STEPS = 10
_TINY = 1e-9
_NEVER_TOLD = -1
_MAX_STEP_S = 3600.0

if TYPE_CHECKING:  # numpy.typing takes long to import
    from numpy.typing import NDArray

Floats: TypeAlias = "NDArray[np.float64]"
Bools: TypeAlias = "NDArray[np.bool_]"
Ints: TypeAlias = "NDArray[np.int64]"


class FlightMode(IntEnum):
    """The modes of the simulated autopilot."""

    MANUAL = 0
    GUIDED = 1
    HOLD = 2
    LAND = 3
    ALTITUDE = 4
    """Holds the height only: what is left of guided flight and hold without a position."""


class Fleet:
    """The state of all vehicles of a world, one row each. Changed only with the world's lock held."""

    def __init__(self) -> None:
        self.count = 0
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
        # What the autopilot was told last.
        self.by_position: Bools = np.zeros(0, dtype=np.bool_)
        self.setpoint_s: Floats = np.zeros(0)
        self.goal: Floats = np.zeros((0, 3))
        self.goal_velocity: Floats = np.zeros((0, 3))
        self.goal_acceleration: Floats = np.zeros((0, 3))
        self.goal_yaw: Floats = np.zeros(0)
        self.goal_yaw_rate: Floats = np.zeros(0)
        self.hold: Floats = np.zeros((0, 3))
        self.sticks: Floats = np.zeros((0, 4))
        # What its world does to it.
        self.ground: Floats = np.zeros(0)
        self.wind: Floats = np.zeros((0, 3))
        self.power: Floats = np.zeros(0)
        self.estimate_offset: Floats = np.zeros((0, 3))
        self.has_position: Bools = np.zeros(0, dtype=np.bool_)
        # What it can.
        self.horizontal_speed: Floats = np.zeros(0)
        self.vertical_speed: Floats = np.zeros(0)
        self.horizontal_acceleration: Floats = np.zeros(0)
        self.vertical_acceleration: Floats = np.zeros(0)
        self.max_yaw_rate: Floats = np.zeros(0)
        self.response_s: Floats = np.zeros(0)
        self.landing_speed: Floats = np.zeros(0)
        self.disarm_after_s: Floats = np.zeros(0)
        self.endurance_s: Floats = np.zeros(0)

    def add(self, settings: LightSettings) -> int:
        """Adds a vehicle, standing on the ground, disarmed. Its row."""
        row = {
            "position": settings.start,
            "yaw": settings.start_yaw_rad,
            "mode": int(FlightMode.HOLD),
            "is_landed": True,
            "battery_percent": settings.battery_percent,
            "setpoint_s": -math.inf,
            "hold": settings.start,
            "ground": settings.start[2],
            "wind": settings.wind_m_s,
            "power": 1.0,
            "has_position": True,
            "horizontal_speed": settings.horizontal_speed_m_s,
            "vertical_speed": settings.vertical_speed_m_s,
            "horizontal_acceleration": settings.horizontal_acceleration_m_s2,
            "vertical_acceleration": settings.vertical_acceleration_m_s2,
            "max_yaw_rate": settings.yaw_rate_rad_s,
            "response_s": settings.response_s,
            "landing_speed": settings.landing_speed_m_s,
            "disarm_after_s": settings.disarm_after_landing_s,
            "endurance_s": settings.battery_endurance_s,
        }
        for name, array in vars(self).items():
            if isinstance(array, np.ndarray):
                grown = np.concatenate([array, np.zeros((1, *array.shape[1:]), dtype=array.dtype)])
                if name in row:
                    grown[-1] = row[name]
                setattr(self, name, grown)
        self.count += 1
        return self.count - 1

    def conditions(self) -> Ints:
        """All of each vehicle that its state follows from, as one number each: where that differs, so may the state."""
        conditions: Ints = self.mode * 8 + self.is_armed * 4 + self.is_landed * 2 + self.has_position
        return conditions

    def tell(self, index: int, setpoint: Setpoint, now_s: float) -> None:
        """Gives a setpoint to one autopilot."""
        is_next = bool(self.by_position[index]) and now_s - self.setpoint_s[index] < 1.5 * STEP_S
        self.setpoint_s[index] = now_s
        self.goal_yaw_rate[index] = setpoint.yaw_rate_rad_s
        if isinstance(setpoint, PositionSetpoint):
            self.by_position[index] = True
            self.goal[index] = tuple(setpoint.position)
            # The first-order response to a velocity command lags by response_s: ask for what it shall be then. A
            # command holds for a step, in which the acceleration goes on to change as it just did.
            acceleration = np.array(tuple(setpoint.acceleration))
            changed = acceleration - self.goal_acceleration[index] if is_next else 0.0
            self.goal_acceleration[index] = acceleration
            self.goal_velocity[index] = tuple(setpoint.velocity)
            self.goal_velocity[index] += (acceleration + changed / 2) * self.response_s[index]
            self.goal_yaw[index] = setpoint.yaw_rad
        else:
            self.by_position[index] = False
            self.goal_velocity[index] = tuple(setpoint.velocity)

    def set_mode(self, index: int, mode: FlightMode) -> None:
        """Switches one autopilot; it holds its place until it is told otherwise."""
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
        """Moves all vehicles on by `STEP_S`."""
        lost_setpoints = (self.mode == FlightMode.GUIDED) & (now_s - self.setpoint_s > SETPOINT_TIMEOUT_S)
        for index in np.flatnonzero(lost_setpoints & ~self.is_landed):
            self.set_mode(int(index), FlightMode.HOLD)
        needs_position = (self.mode == FlightMode.GUIDED) | (self.mode == FlightMode.HOLD)
        for index in np.flatnonzero(~self.has_position & self.is_armed & needs_position):
            self.set_mode(int(index), FlightMode.ALTITUDE)
        command, yaw_rate = self._commands()
        place = self.position
        self._accelerate(command)
        self.yaw_rate = np.where(self.is_landed, 0.0, np.clip(yaw_rate, -self.max_yaw_rate, self.max_yaw_rate))
        self.yaw = np.remainder(self.yaw + self.yaw_rate * STEP_S + math.pi, math.tau) - math.pi
        self._touch_ground(command, place)
        drain = np.where(self.is_landed, 0.05, 1.0) * self.is_armed * (100.0 * STEP_S) / self.endurance_s
        self.battery_percent = np.maximum(0.0, self.battery_percent - drain)

    def _commands(self) -> tuple[Floats, Floats]:
        """Velocity (N, 3) and yaw rate (N,) that the autopilots ask for."""
        guided, by_position = self.mode == FlightMode.GUIDED, self.by_position
        estimated = self.position + self.estimate_offset
        target = np.where((guided & by_position)[:, None], self.goal, self.hold)
        keeps_place = (guided & by_position) | (self.mode == FlightMode.HOLD) | (self.mode == FlightMode.LAND)
        command = np.where(keeps_place[:, None], _POSITION_GAIN * (target - estimated), 0.0)
        command += np.where(guided[:, None], self.goal_velocity, 0.0)
        command[:, 2] = np.where(self.mode == FlightMode.LAND, -self.landing_speed, command[:, 2])
        wanted_turn = np.remainder(self.goal_yaw - self.yaw + math.pi, math.tau) - math.pi
        yaw_rate = np.where(guided, self.goal_yaw_rate + np.where(by_position, _YAW_GAIN * wanted_turn, 0.0), 0.0)
        manual = self.mode == FlightMode.MANUAL
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
        """First-order response to the velocity commands, within the limits; then half-way integration."""
        limit = _COMMAND_HEADROOM
        command = _limited(command, limit * self.horizontal_speed, limit * self.vertical_speed)
        acceleration = (command - self.velocity) / self.response_s[:, None]
        # The limits are those of what it does by itself: against the wind it has as much more as that takes.
        push = _WIND_DRAG * self.wind
        acceleration = _limited(
            acceleration,
            self.power * (self.horizontal_acceleration + np.hypot(push[:, 0], push[:, 1])),
            self.power * (self.vertical_acceleration + np.abs(push[:, 2])),
        )
        acceleration += push
        before = self.velocity
        # Each part by itself: the nearest velocity within the limits, which costs no more acceleration.
        after = before + acceleration * STEP_S
        fast = np.hypot(after[:, 0], after[:, 1]) / self.horizontal_speed
        after[:, :2] /= np.maximum(1.0, fast)[:, None]
        after[:, 2] = np.clip(after[:, 2], -self.vertical_speed, self.vertical_speed)
        after = np.where(self.is_armed[:, None], after, 0.0)
        self.velocity = after
        self.position = self.position + (before + after) * (STEP_S / 2)

    def _touch_ground(self, command: Floats, place: Floats) -> None:
        """The ground carries, and what sits on it stays at its `place`; landing is noticed after a while, lift-off at a
        small height; then motors stop.
        """
        stays = (self.position[:, 2] <= self.ground) & ((command[:, 2] <= 0.0) | ~self.is_armed)
        sits = stays | (self.is_landed & ~self.is_armed)
        self.velocity[sits] = 0.0
        self.position[sits, :2] = place[sits, :2]
        self.position[:, 2] = np.maximum(self.position[:, 2], self.ground)
        self.on_ground_s = np.where(sits, self.on_ground_s + STEP_S, 0.0)
        up = self.position[:, 2] > self.ground + _LIFT_OFF_M
        self.is_landed = (self.is_landed | (self.on_ground_s >= _LANDED_AFTER_S)) & ~up
        self.has_flown = (self.has_flown | up) & self.is_armed
        rested = self.is_landed & self.has_flown & (self.on_ground_s >= _LANDED_AFTER_S + self.disarm_after_s)
        if rested.any():
            self.is_armed &= ~rested
            self.has_flown &= ~rested
            for index in np.flatnonzero(rested):
                self.set_mode(int(index), FlightMode.HOLD)


def _limited(vectors: Floats, horizontal: Floats, vertical: Floats) -> Floats:
    """The vectors (N, 3), shortened where needed, their directions kept."""
    excess = np.maximum(  # a limit of 0 (motors without power) is a very small one
        np.hypot(vectors[:, 0], vectors[:, 1]) / np.maximum(horizontal, _TINY),
        np.abs(vectors[:, 2]) / np.maximum(vertical, _TINY),
    )
    return vectors / np.maximum(1.0, excess)[:, None]


class _Listener(NamedTuple):
    """See `World.listen`."""

    on_step: Callable[[], None]
    is_needed: Callable[[], bool]


class World:
    """Simulated time, and the vehicles that live in it. Is the clock of their backends.

    Callbacks run after a step, on the thread that steps, with no lock held but the one that lets only one thread step
    at a time. A vehicle of which nothing is told and that nobody waits for costs no more than its row in the vectors.
    """

    def __init__(self, speed_factor: float = 1.0) -> None:
        self.lock = threading.Lock()
        self.fleet = Fleet()
        self.epoch_s = time.time()
        self._steps = 0
        self._stepping = threading.RLock()
        self._listeners: dict[int, _Listener] = {}
        self._told: Ints = np.zeros(0, dtype=np.int64)
        self._speed_factor = speed_factor
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def now_s(self) -> float:
        """Simulated seconds since the world began."""
        return self._steps * STEP_S

    @property
    def steps(self) -> int:
        """How many steps were made."""
        return self._steps

    def add(self, settings: LightSettings) -> int:
        """Adds a vehicle; its row in the fleet."""
        with self.lock:
            self._told = np.append(self._told, _NEVER_TOLD)
            return self.fleet.add(settings)

    def wind_to(self, index: int, velocity_m_s: Vector3) -> None:
        """Lets wind blow on one vehicle."""
        with self.lock:
            self.fleet.wind[index] = tuple(velocity_m_s)

    def listen(self, index: int, on_step: Callable[[], None], is_needed: Callable[[], bool] = lambda: True) -> None:
        """From now on calls back after the first step, after each in which the conditions of the vehicle have changed,
        and after each for which `is_needed` says so; the world runs while anyone listens.
        """
        with self._changed:
            self._listeners = {**self._listeners, index: _Listener(on_step, is_needed)}
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="light-world", daemon=True)
                self._thread.start()
            self._changed.notify_all()
        # After that: a step in between would take it as told, and tell nobody.
        with self.lock:
            self._told[index] = _NEVER_TOLD

    def unlisten(self, index: int) -> None:
        """Ends `listen`; no call comes once this returns."""
        with self._changed:
            self._listeners = {other: each for other, each in self._listeners.items() if other != index}
            thread = self._thread
            is_last = not self._listeners
            if is_last:
                self._thread = None
            self._changed.notify_all()
        if threading.current_thread() is thread:
            return  # called back from a step: it ends with it
        if is_last and thread is not None:
            thread.join()
        with self._stepping:
            pass

    @property
    def speed_factor(self) -> float:
        """How fast the time runs against the wall; 0 stands still."""
        return self._speed_factor

    def set_speed_factor(self, speed_factor: float) -> None:
        """Lets the time run at another speed: 0 to 100, or infinity. With 0 it stands still once this returns."""
        if not (0.0 <= speed_factor <= 100.0 or speed_factor == math.inf):
            raise InvalidArgumentError(
                f"speed_factor: {speed_factor:g} is not from 0 to 100, nor infinity", {"field": "speed_factor"}
            )
        with self._changed:
            self._speed_factor = speed_factor
            self._changed.notify_all()
        with self._stepping:
            pass

    def step(self, duration_s: float) -> None:
        """Runs standing time on by a duration (to the nearest step), and returns when that is done."""
        if self._speed_factor != 0.0:
            raise WrongStateError("the simulated time runs by itself; set the speed factor to 0 to step it")
        if not 0.0 < duration_s <= _MAX_STEP_S:
            raise InvalidArgumentError(
                f"duration_s: {duration_s:g} is not above 0 and at most {_MAX_STEP_S:g}", {"field": "duration_s"}
            )
        for _ in range(max(1, round(duration_s / STEP_S))):
            self._step_once()

    @contextmanager
    def standing(self) -> Iterator[None]:
        """No step is made while the block runs."""
        with self._stepping:
            yield

    def _step_once(self) -> None:
        with self._stepping:
            with self.lock:
                self._steps += 1
                self.fleet.step(self.now_s())
                conditions = self.fleet.conditions()
                changed = set(np.flatnonzero(conditions != self._told).tolist())
                self._told = conditions
            for index, listener in self._listeners.items():
                if index in changed or listener.is_needed():
                    listener.on_step()

    def _run(self) -> None:
        due_s = time.monotonic()
        while True:
            with self._changed:
                if self._thread is not threading.current_thread():
                    return
                factor = self._speed_factor
                if factor == 0.0:
                    self._changed.wait()
                    due_s = time.monotonic()
                    continue
                if factor != math.inf:
                    now_s = time.monotonic()
                    if due_s > now_s:
                        self._changed.wait(due_s - now_s)
                        continue
                    # A machine that cannot keep up lets the simulated time fall behind; it does not hurry after it.
                    due_s = max(due_s, now_s - _LATEST_STEPS * STEP_S / factor) + STEP_S / factor
            if factor == math.inf:
                time.sleep(0)  # lets other threads run
            with self._stepping:
                if self._speed_factor != 0.0:
                    self._step_once()
