"""The light simulation as a backend: one vehicle of a `World`."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

import numpy as np

from ual.errors import RejectedByAutopilotError
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.interface import Simulation
from ual.simulation import Command
from ual.types import Battery, Capability, GeoPoint, GpsFix, GpsInfo, Limits
from ual_daemon.backends.base import Backend, BackendOptions, UpdateCallback
from ual_daemon.backends.light.faults import Faults
from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.backends.light.simulation import LightSimulation
from ual_daemon.backends.light.world import Fleet, FlightMode, Floats, World
from ual_daemon.backends.values import (
    Control,
    Estimator,
    Freshness,
    LandedState,
    Mode,
    Sample,
    Setpoint,
    Snapshot,
    VehicleInfo,
)
from ual_daemon.geodesy import EllipsoidProjection
from ual_daemon.settings import convert
from ual_daemon.version import __version__

_LOWEST_BATTERY_PERCENT = 5.0
_FULL_V, _EMPTY_V = 16.8, 13.2
_NO_NOISE = np.zeros((2, 3))

_MODES = {
    mode: Mode(
        mode.name,
        {FlightMode.GUIDED: Control.REFERENCES, FlightMode.LAND: Control.LAND}.get(mode, Control.OTHER),
    )
    for mode in FlightMode
}


class LightBackend(Backend):
    """One simulated multirotor. Several can share a `World`: one thread then runs them all."""

    name = "light"
    freshness = Freshness(link_s=0.5, pose_s=0.5, mode_s=0.5, landed_s=0.5, estimator_s=0.5)

    def __init__(self, options: BackendOptions, world: World | None = None) -> None:
        super().__init__(options)
        settings = convert(options.settings, LightSettings, self.name)
        factor = math.inf if settings.speed_factor == "max" else settings.speed_factor
        self.world = World(factor) if world is None else world
        self.clock = self.world
        self._settings = settings
        self._index = self.world.add(settings)
        self._projection = EllipsoidProjection(*settings.origin_geo)
        # Python's own generator: numpy's takes a third of the start-up time of this backend to import.
        self._random = random.Random(settings.seed)  # noqa: S311  noise, no secret
        self._noise_sigmas = (settings.position_noise_m, settings.velocity_noise_m_s)
        self._noise = self._draw_noise()
        self._faults = Faults(self.world)
        self._late_acks: list[tuple[float, Future[None]]] = []
        self._status_text = ""
        self._on_update: UpdateCallback | None = None
        self._info = _vehicle_info(settings)
        self._snapshot = self._look()

    # --- The backend --------------------------------------------------------------------------------------------------

    def open(self, on_update: UpdateCallback) -> None:
        self._on_update = on_update
        self.world.listen(self._index, self._after_step)

    def close(self) -> None:
        self.world.unlisten(self._index)

    def info(self) -> VehicleInfo:
        return self._info

    def snapshot(self) -> Snapshot:
        # Standing time does not update: what the safety pilot did meanwhile must show all the same.
        if self.world.speed_factor == 0.0:
            self._snapshot = self._look()
        return self._snapshot

    def send(self, setpoint: Setpoint) -> None:
        if self._faults.is_link_lost:
            return
        with self.world.lock:
            self.world.fleet.tell(self._index, setpoint, self.world.now_s())

    def arm(self) -> Future[None]:
        return self._command(Command.ARM, self._arm)

    def disarm(self) -> Future[None]:
        return self._command(Command.DISARM, self._disarm)

    def take_off(self, height_m: float) -> Future[None]:
        del height_m  # flown on setpoints
        return self._command(Command.TAKE_OFF, self._guide)

    def land(self) -> Future[None]:
        return self._command(Command.LAND, lambda fleet: self._switch(fleet, FlightMode.LAND))

    def take_control(self) -> Future[None]:
        return self._command(Command.TAKE_CONTROL, self._guide)

    def hold(self) -> Future[None]:
        return self._command(None, lambda fleet: self._switch(fleet, FlightMode.HOLD))

    def simulation(self) -> Simulation:
        return LightSimulation(self, self.world, self._index, self._faults)

    # --- The safety pilot's commands, and ours ------------------------------------------------------------------------

    def pilot(self, action: Callable[[Fleet], str | None]) -> None:
        """Something the safety pilot does, by his own radio: neither a lost link nor its faults concern him.

        It shows in the data once this returns.
        """
        with self.world.standing():
            with self.world.lock:
                refusal = action(self.world.fleet)
            if refusal is not None:
                self._status_text = refusal
            self._snapshot = self._look()
        if refusal is not None:
            raise RejectedByAutopilotError(f"the autopilot refused the safety pilot: {refusal}")

    def pilot_arm(self) -> None:
        """The safety pilot arms."""
        self.pilot(self._arm)

    def pilot_disarm(self) -> None:
        """The safety pilot disarms."""
        self.pilot(self._disarm)

    def pilot_switch(self, mode: FlightMode) -> None:
        """The safety pilot switches the mode."""
        self.pilot(self._guide if mode is FlightMode.GUIDED else lambda fleet: self._switch(fleet, mode))

    def set_noise(self, position_m: float, velocity_m_s: float) -> None:
        """Standard deviations of the estimates from now on."""
        self._noise_sigmas = (position_m, velocity_m_s)

    def _command(self, command: Command | None, action: Callable[[Fleet], str | None]) -> Future[None]:
        """Does what a command asks, unless a fault is in the way; the acknowledgement."""
        ack: Future[None] = Future()
        if self._faults.is_link_lost:
            return ack
        refusal = None if command is None else self._faults.refusal(command)
        if refusal is None:
            with self.world.lock:
                refusal = action(self.world.fleet)
        if refusal is not None:
            self._status_text = refusal
        if command is not None and self._faults.is_ack_lost(command):
            return ack
        delay_s = 0.0 if command is None else self._faults.ack_delay_s(command)
        if refusal is not None:
            ack.set_exception(RejectedByAutopilotError(f"the autopilot refused: {refusal}", {"text": refusal}))
        elif delay_s > 0.0:
            self._late_acks.append((self.world.now_s() + delay_s, ack))
        else:
            ack.set_result(None)
        return ack

    def _arm(self, fleet: Fleet) -> str | None:
        i = self._index
        if not fleet.has_position[i]:
            return "Arm: no position estimate"
        if fleet.battery_percent[i] < _LOWEST_BATTERY_PERCENT:
            return "Arm: battery too low"
        if not fleet.is_landed[i]:
            return "Arm: not landed"
        fleet.is_armed[i] = True
        fleet.has_flown[i] = False
        fleet.set_mode(i, FlightMode(int(fleet.mode[i])))  # what it was told before it stood disarmed is over
        return None

    def _disarm(self, fleet: Fleet) -> str | None:
        if not fleet.is_landed[self._index]:
            return "Disarm: not landed"
        fleet.is_armed[self._index] = False
        return None

    def _guide(self, fleet: Fleet) -> str | None:
        i = self._index
        if not fleet.is_armed[i]:
            return "Mode: not armed"
        if not fleet.has_position[i]:
            return "Mode: no position estimate"
        fleet.set_mode(i, FlightMode.GUIDED)
        fleet.setpoint_s[i] = self.world.now_s()
        return None

    def _switch(self, fleet: Fleet, mode: FlightMode) -> str | None:
        if mode is FlightMode.HOLD and not fleet.has_position[self._index]:
            return "Mode: no position estimate"
        fleet.set_mode(self._index, mode)
        return None

    # --- Data ---------------------------------------------------------------------------------------------------------

    def _after_step(self) -> None:
        now_s = self.world.now_s()
        self._faults.step(now_s)
        with self.world.lock:
            self._faults.apply(self.world.fleet, self._index, now_s)
        for due_s, ack in list(self._late_acks):
            if now_s >= due_s:
                self._late_acks.remove((due_s, ack))
                if ack.set_running_or_notify_cancel():
                    ack.set_result(None)
        self._noise = self._draw_noise()
        self._snapshot = self._look()
        if self._on_update is not None:
            self._on_update(self._snapshot)

    def _draw_noise(self) -> Floats:
        """The errors of position and velocity until the next step: whoever looks at a moment sees the same ones."""
        if not any(self._noise_sigmas):
            return _NO_NOISE
        return np.array([[self._random.gauss(0.0, sigma) for _ in range(3)] for sigma in self._noise_sigmas])

    def _look(self) -> Snapshot:
        """What the autopilot says now. While the link is lost: what it said last."""
        now_s = self.world.now_s()
        if self._faults.is_link_lost:
            return replace(self._snapshot, time_s=now_s)
        i, fleet = self._index, self.world.fleet
        with self.world.lock:
            position = fleet.position[i] + fleet.estimate_offset[i]
            velocity, yaw, yaw_rate = fleet.velocity[i].copy(), float(fleet.yaw[i]), float(fleet.yaw_rate[i])
            mode = FlightMode(int(fleet.mode[i]))
            is_armed, is_landed = bool(fleet.is_armed[i]), bool(fleet.is_landed[i])
            has_position, percent = bool(fleet.has_position[i]), float(fleet.battery_percent[i])
        position_noise, velocity_noise = self._noise
        position += position_noise
        velocity += velocity_noise
        local = Vector3(*position.tolist())
        landed = LandedState.ON_GROUND if is_landed else LandedState.IN_AIR
        if mode is FlightMode.LAND and not is_landed:
            landed = LandedState.LANDING
        return Snapshot(
            time_s=now_s,
            heard_s=now_s,
            stamp_s=self.world.epoch_s + now_s,
            armed=Sample(is_armed, now_s),
            landed=Sample(landed, now_s),
            mode=Sample(_MODES[mode], now_s),
            estimator=Sample(_GOOD if has_position else _LOST, now_s),
            pose=Sample(Pose(local, Quaternion.from_yaw(yaw)), now_s),
            velocity=Sample(Twist(Vector3(*velocity.tolist()), Vector3(0.0, 0.0, yaw_rate)), now_s),
            position_geo=self._geo(local) if has_position else None,
            projection=self._projection,
            home_altitude_amsl_m=self._projection.altitude_amsl_m,
            geoid_separation_m=self._settings.geoid_separation_m,
            battery=Battery(percent, _EMPTY_V + (_FULL_V - _EMPTY_V) * percent / 100.0, 12.0 if is_armed else 0.5),
            gps=GpsInfo(GpsFix.FIX_3D, 14, 0.5, 0.8) if has_position else GpsInfo(GpsFix.NONE),
            status_text=self._status_text,
        )

    def _geo(self, local: Vector3) -> GeoPoint:
        point = self._projection.to_geo(local)
        assert point.altitude_amsl_m is not None
        return GeoPoint(
            point.latitude_deg,
            point.longitude_deg,
            point.altitude_amsl_m,
            point.altitude_amsl_m - self._projection.altitude_amsl_m,
            point.altitude_amsl_m + self._settings.geoid_separation_m,
        )


_GOOD = Estimator(True)
_LOST = Estimator(False, "its position is lost (simulated)")


def _vehicle_info(settings: LightSettings) -> VehicleInfo:
    return VehicleInfo(
        autopilot="light",
        autopilot_version=__version__,
        is_simulation=True,
        capabilities=frozenset(Capability),
        limits=Limits(
            settings.horizontal_speed_m_s,
            settings.vertical_speed_m_s,
            settings.vertical_speed_m_s,
            settings.horizontal_acceleration_m_s2,
            settings.vertical_acceleration_m_s2,
            settings.yaw_rate_rad_s,
        ),
        flies_takeoff_on_setpoints=True,
    )
