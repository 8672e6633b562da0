"""The light simulation as a backend: one vehicle of a `World`."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import NamedTuple, TypeVar

from typing_extensions import override

from ual.errors import RejectedByAutopilotError
from ual.geometry import IDENTITY, Pose, Quaternion, Twist, Vector3, vector3, wrap_angle
from ual.interface import Simulation
from ual.simulation import Command
from ual.types import Battery, Capability, GpsFix, GpsInfo, Health, Limits
from ual_daemon._version import __version__
from ual_daemon.backends import futures
from ual_daemon.backends.base import Backend, BackendOptions, SafetyPilot, SimulatedPilot, UpdateCallback
from ual_daemon.backends.command_snapshot import command_snapshot
from ual_daemon.backends.engine.contained import ErrorBarrier
from ual_daemon.backends.engine.loop import Loop
from ual_daemon.backends.light import derived
from ual_daemon.backends.light.camera import CameraMoment, LightCameras
from ual_daemon.backends.light.corrections import LightCorrections
from ual_daemon.backends.light.faults import Faults
from ual_daemon.backends.light.gimbal import GimbalMoment, LightGimbals
from ual_daemon.backends.light.physics import POSITION_GAIN, FlightMode, LightReport
from ual_daemon.backends.light.settings import LightSettings
from ual_daemon.backends.light.simulation import LightSimulation
from ual_daemon.backends.light.world import LAG_S, Vehicles, World
from ual_daemon.backends.values import (
    Cause,
    Condition,
    Control,
    ControlState,
    EarthReference,
    Estimator,
    ExternalPose,
    Freshness,
    LandedState,
    Mode,
    MotionState,
    Sample,
    Setpoint,
    Snapshot,
    Takes,
    VehicleInfo,
    VelocityGains,
    VelocityResponse,
    VelocityResponses,
)
from ual_daemon.geodesy import EllipsoidProjection
from ual_daemon.settings import ConfigError, convert

T = TypeVar("T")

_EXTERNAL_POSE_TIMEOUT_S = 0.5
"""Seconds without an external pose after which the position is lost, without satellites."""
_LOWEST_BATTERY_PERCENT = 5.0
_FULL_V, _EMPTY_V = 16.8, 13.2
_STATUS_PERIOD_S = 0.1
"""Between two reports of what has not changed: all but the motion."""
_LINK_S = 0.5
"""Seconds of silence after which the link is lost."""
_ZERO = Vector3()
_STEPS_PER_SEED = 1 << 40
"""Larger than the number of steps in any world, so that no two vehicles use the same seed."""

_CONTROLS = {FlightMode.GUIDED: Control.REFERENCES, FlightMode.LAND: Control.LAND}
_MODES = [
    Mode(mode.name, _CONTROLS.get(mode, Control.OTHER), is_autonomous=mode is FlightMode.HOLD) for mode in FlightMode
]


class _Status(NamedTuple):
    """All but the motion, as it was reported last, when that was, and the values that make the next report urgent."""

    time_s: float = -math.inf
    values: tuple[object, ...] = ()
    control: ControlState = ControlState()
    estimator: Sample[Estimator] | None = None
    condition: Condition = Condition()


class _Stepped:
    """Vehicle as the engine's loop sees it. The world has the thread: while it does not run, simulated time stands
    still.
    """

    is_urgent = False

    def __init__(self, snapshot: Callable[[], Snapshot]) -> None:
        self._newest = snapshot

    def discard(self, now_s: float, pause_s: float) -> None:
        """Nothing has changed in a pause."""

    def tick(self, now_s: float) -> None:
        """Its commands act at once."""

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        """Returns that of the present step."""
        return self._newest()


class LightBackend(Backend):
    """One simulated multirotor. Several of them can share a `World`, which steps them all on one thread."""

    name = "light"
    freshness = Freshness(_LINK_S, _LINK_S, *[_LINK_S + 2 * _STATUS_PERIOD_S] * 3)  # a silent link is one

    def __init__(self, options: BackendOptions, world: World | None = None) -> None:
        super().__init__(options)
        if options.url is not None:
            raise ConfigError(f"{options.url}: a light UAV is simulated: it has no autopilot to connect to", "url")
        settings = convert(options.settings, LightSettings, self.name)
        self.world = World(_speed_factor(settings), skips_lag=settings.skip_lag) if world is None else world
        self.clock = self.world
        self._settings = settings
        self._index = self.world.add(settings)
        projection = EllipsoidProjection(*settings.origin_geo)
        self._earth = EarthReference(
            projection=projection,  # from which the geographic position is computed when it is needed
            home_altitude_amsl_m=projection.altitude_amsl_m,
            geoid_separation_m=settings.geoid_separation_m,
        )
        self._random = random.Random()  # noqa: S311  for noise, not for secrets
        self.set_noise(settings.position_noise_m, settings.velocity_noise_m_s)
        self._faults = Faults(self.world)
        self._open = futures.OpenFutures()
        self._late_acks: list[tuple[float, Future[None]]] = []
        self._status_text = ""
        self._loop: Loop | None = None
        self._info = _vehicle_info(settings)
        self._external_pose: ExternalPose | None = None
        self._applied_pose: ExternalPose | None = None
        self._external_offset = Vector3()
        self._is_faulty = False
        self._holds_by: Cause | None = None
        """The failsafe by which it holds its position."""
        self._corrections = LightCorrections(self.world.now_s)
        self._offers = derived.offers(self.world.now_s, lambda: self._faults.is_link_lost)
        self._snapshot = Snapshot(0.0)
        self._status = _Status()
        self._yaw, self._orientation = 0.0, IDENTITY
        self._gimbals = LightGimbals(settings.gimbals, self._moment)
        self._cameras = LightCameras(
            settings.cameras, settings.seed, self._camera_moment, self.world.painter, self._gimbals.gimbals
        )
        self._contained = ErrorBarrier("its cameras")
        with self.world.lock:
            self._update_snapshot()

    @classmethod
    @override
    def fleet(cls, options: Sequence[BackendOptions], places: Sequence[Vector3], first: int = 0) -> list[Backend]:
        settings = convert(options[0].settings, LightSettings, cls.name)
        origin = EllipsoidProjection(*settings.origin_geo)
        world = World(_speed_factor(settings), skips_lag=settings.skip_lag)
        fleet: list[Backend] = []
        for number, (each, place) in enumerate(zip(options, places, strict=True), first):
            there = origin.to_geo(place)
            own = {
                "origin_geo": [there.latitude_deg, there.longitude_deg, there.altitude_amsl_m],
                "seed": settings.seed + number,
            }
            fleet.append(cls(replace(each, settings={**each.settings, **own}), world))
        return fleet

    # --- The backend --------------------------------------------------------------------------------------------------

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._loop = Loop(_Stepped(lambda: self._snapshot), self.clock, self.world.watch, on_update)
        self.world.listen(self._index, self._after_step, self._is_step_needed)

    @override
    def close(self) -> None:
        self._cameras.close()
        self.world.unlisten(self._index)
        self._open.close()

    @override
    def info(self) -> VehicleInfo:
        return self._info

    @override
    def snapshot(self) -> Snapshot:
        # While time stands still there are no updates, but what the safety pilot does must be visible all the same.
        if self._snapshot_step != self.world.steps or self.world.speed_factor == 0.0:
            with self.world.lock:
                if self._snapshot_step != self.world.steps or self.world.speed_factor == 0.0:
                    self._update_snapshot()
        return self._snapshot

    @override
    def send(self, setpoint: Setpoint) -> None:
        if self._faults.is_link_lost:
            return
        with self.world.lock:
            self.world.fleet.set_setpoint(self._index, setpoint, self.world.now_s())

    @override
    def arm(self) -> Future[None]:
        return self._command(Command.ARM, self._arm)

    @override
    def disarm(self) -> Future[None]:
        return self._command(Command.DISARM, self._disarm)

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        del height_m, limits  # the daemon's setpoints fly the climb
        return self._command(Command.TAKE_OFF, self._guide)

    @override
    def land(self, limits: Limits) -> Future[None]:
        del limits  # it lands at a speed of its own
        return self._command(Command.LAND, lambda fleet: self._switch(fleet, FlightMode.LAND))

    @override
    def take_control(self) -> Future[None]:
        return self._command(Command.TAKE_CONTROL, self._guide)

    @override
    def hold(self) -> Future[None]:
        return self._command(None, lambda fleet: self._switch(fleet, FlightMode.HOLD))

    @override
    def set_external_pose(self, measured: ExternalPose) -> None:
        if not self._faults.is_link_lost:
            self._external_pose = measured

    @override
    def utc_s(self) -> float:
        return self.world.epoch_s + self.world.now_s()

    @override
    def safety_pilot(self) -> SafetyPilot:
        return SimulatedPilot(lambda: True, self.pilot_arm)

    @override
    def offer(self, kind: type[T]) -> T | None:
        offers: tuple[object, ...] = (self._corrections, self._cameras, self._gimbals, *self._offers)
        return next((each for each in offers if isinstance(each, kind)), None)

    @override
    def simulation(self) -> Simulation:
        return LightSimulation(self, self.world, self._index, self._faults)

    # --- Commands of the safety pilot and of the daemon ---------------------------------------------------------------

    def pilot(self, action: Callable[[Vehicles], str | None]) -> None:
        """Does what the safety pilot commands. The pilot's radio is not affected by a lost link or by its faults.

        The snapshot shows the effect once this has returned.

        Raises:
            RejectedByAutopilotError: The autopilot refused.
        """
        with self.world.paused(), self.world.lock:
            refusal = action(self.world.fleet)
            if refusal is not None:
                self._status_text = refusal
            self._update_snapshot()
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
        self.pilot(self._give_back if mode is FlightMode.GUIDED else lambda fleet: self._switch(fleet, mode))

    def trigger_failsafe(self, cause: Cause) -> None:
        """The autopilot leaves GUIDED by a failsafe, and holds its position."""

        def hold(fleet: Vehicles) -> str | None:
            if fleet.mode[self._index] == FlightMode.GUIDED and not fleet.is_landed[self._index]:
                self._holds_by = cause
                fleet.set_mode(self._index, FlightMode.HOLD)
            return None

        self.pilot(hold)

    def place_on_ground(self, position: Vector3, yaw_rad: float) -> None:
        """Puts the vehicle on the ground, which is there at the height of the place."""
        x, y, z = position

        def put(fleet: Vehicles) -> None:
            i = self._index
            fleet.is_armed[i], fleet.has_flown[i], fleet.is_landed[i] = False, False, True
            fleet.position[i], fleet.velocity[i] = (x, y, z), (0.0, 0.0, 0.0)
            fleet.yaw[i], fleet.yaw_rate[i], fleet.ground[i] = wrap_angle(yaw_rad), 0.0, z
            fleet.set_mode(i, FlightMode.HOLD)

        self.pilot(put)

    def set_noise(self, position_m: float, velocity_m_s: float) -> None:
        """Sets the standard deviations of the estimates."""
        self._noise_sigmas = (position_m, velocity_m_s)
        self._is_noisy = any(self._noise_sigmas)

    def _command(self, command: Command | None, action: Callable[[Vehicles], str | None]) -> Future[None]:
        """Does what a command asks, unless a fault prevents it. Returns the acknowledgement."""
        if self._faults.is_link_lost:
            return self._late_ack()
        refusal = None if command is None else self._faults.refusal(command)
        if refusal is None:
            with self.world.lock:
                refusal = self._why_overtaken() or action(self.world.fleet)
        if refusal is not None:
            self._status_text = refusal
        if command is not None and self._faults.is_ack_lost(command):
            return self._late_ack()
        delay_s = 0.0 if command is None else self._faults.ack_delay_s(command)
        if refusal is not None:
            return futures.failed(RejectedByAutopilotError(f"the autopilot refused: {refusal}", {"text": refusal}))
        return futures.done() if delay_s <= 0.0 else self._late_ack(self.world.now_s() + delay_s)

    def _late_ack(self, due_s: float = math.inf) -> Future[None]:
        """Returns the acknowledgement that comes at a time; or never, if that is infinite."""

        def begin(ack: Future[None]) -> None:
            if due_s < math.inf:
                self._late_acks.append((due_s, ack))

        return self._open.give("hear the autopilot's answer", begin)

    def _why_overtaken(self) -> str | None:
        """Returns that the pilot has changed the mode since a command was assessed; None if that did not happen."""
        snapshot, mode = command_snapshot(), FlightMode(int(self.world.fleet.mode[self._index])).name
        is_same = snapshot is None or snapshot.control.settled_mode in ("", mode)
        return None if is_same else f"Mode: it became {mode}"

    def _arm(self, fleet: Vehicles) -> str | None:
        i = self._index
        if not fleet.has_position[i]:
            return "Arm: no position estimate"
        if fleet.battery_percent[i] < _LOWEST_BATTERY_PERCENT:
            return "Arm: battery too low"
        if not fleet.is_landed[i]:
            return "Arm: not landed"
        fleet.is_armed[i] = True
        fleet.has_flown[i] = False
        fleet.set_mode(i, FlightMode(int(fleet.mode[i])))  # forgets the setpoints from before
        return None

    def _disarm(self, fleet: Vehicles) -> str | None:
        if not fleet.is_landed[self._index]:
            return "Disarm: not landed"
        fleet.is_armed[self._index] = False
        return None

    def _guide(self, fleet: Vehicles) -> str | None:
        i = self._index
        if not fleet.is_armed[i]:
            return "Mode: not armed"
        if not fleet.has_position[i]:
            return "Mode: no position estimate"
        fleet.set_mode(i, FlightMode.GUIDED)
        fleet.setpoint_s[i] = self.world.now_s()
        return None

    def _give_back(self, fleet: Vehicles) -> str | None:
        """Changes to GUIDED, and hovers there until setpoints come: the daemon sends none before a command."""
        refusal = self._guide(fleet)
        if refusal is None:
            fleet.setpoint_s[self._index] = math.inf
        return refusal

    def _switch(self, fleet: Vehicles, mode: FlightMode) -> str | None:
        if mode is FlightMode.HOLD and not fleet.has_position[self._index]:
            return "Mode: no position estimate"
        fleet.set_mode(self._index, mode)
        return None

    # --- Data ---------------------------------------------------------------------------------------------------------

    def _is_step_needed(self) -> bool:
        """Returns whether the next step needs an update although the conditions have not changed."""
        if self.is_update_needed() or self._is_faulty:  # first: the rest costs calls
            return True
        return self._faults.any_active or bool(self._late_acks) or self._cameras.is_busy

    def _camera_moment(self) -> CameraMoment:
        """Returns what its cameras see from, and what the autopilot says at the same step."""
        with self.world.lock:
            if self._snapshot_step != self.world.steps or self.world.speed_factor == 0.0:
                self._update_snapshot()
            fleet, i = self.world.fleet, self._index
            body = Pose(Vector3(*map(float, fleet.position[i])), Quaternion.from_yaw(float(fleet.yaw[i])))
            return CameraMoment(
                body, float(fleet.ground[i]), self._snapshot, self.world.steps, self._faults.is_link_lost
            )

    def _moment(self) -> GimbalMoment:
        return GimbalMoment(self.world.now_s(), float(self.world.fleet.yaw[self._index]), self._faults.is_link_lost)

    def _after_step(self) -> None:
        now_s, faults = self.world.now_s(), self._faults
        with self.world.lock:
            if self._is_faulty or faults.any_active:
                faults.step(now_s)
                self._is_faulty = faults.any_active  # applies once more after the last fault has ended
                faults.apply(self.world.fleet, self._index, now_s)
                self._apply_external_pose(now_s)
                self._update_snapshot()
            else:  # what has shown in this step already, perhaps after a command, is newer than the step's report
                is_shown = self._snapshot_step == self.world.steps
                self._update_snapshot(None if is_shown else self.world.fleet.report_of_step(self._index))
        if self._cameras.is_busy:
            self._contained.call(lambda: self._cameras.step(self._camera_moment()))
        if self._late_acks:
            self._acknowledge(now_s)
        if self._loop is not None:
            self._loop.publish(now_s)

    def _acknowledge(self, now_s: float) -> None:
        """Ends the acknowledgements that are due."""
        for due_s, ack in list(self._late_acks):
            if now_s >= due_s:
                self._late_acks.remove((due_s, ack))
                if ack.set_running_or_notify_cancel():
                    ack.set_result(None)

    def _apply_external_pose(self, now_s: float) -> None:
        """Takes the place of the satellites: the estimate is where the newest pose from outside says, while it is new.

        The caller holds the world's lock.
        """
        measured, fleet, i = self._external_pose, self.world.fleet, self._index
        if fleet.has_position[i] or measured is None or now_s - measured.time_s > _EXTERNAL_POSE_TIMEOUT_S:
            return
        fleet.has_position[i] = True
        if measured is not self._applied_pose:
            self._applied_pose = measured
            now = measured.pose.position + Vector3(*fleet.velocity[i]) * (now_s - measured.time_s)
            self._external_offset = now - Vector3(*fleet.position[i])
        x, y, z = self._external_offset
        fleet.estimate_offset[i] = (x, y, z)

    def _noise(self) -> tuple[Vector3, Vector3]:
        """Returns the errors of position and velocity at this step. They depend only on the seed and the step."""
        self._random.seed(self._settings.seed * _STEPS_PER_SEED + self.world.steps)
        position, velocity = (
            Vector3(*(self._random.gauss(0.0, sigma) for _ in range(3))) for sigma in self._noise_sigmas
        )
        return position, velocity

    def _update_snapshot(self, report: LightReport | None = None) -> Snapshot:
        """Sets and returns the snapshot of this step. While the link is lost, only its time changes. The caller holds
        the world's lock. `report` is that of the step; None: as it is now.
        """
        now_s = self.world.now_s()
        self._snapshot_step = self.world.steps
        if self._faults.is_link_lost:
            self._snapshot = self._snapshot._replace(time_s=now_s, updated_s=now_s, sequence=self._snapshot_step)
            return self._snapshot
        place, speed, yaw, yaw_rate, mode, is_armed, is_landed, has_position, percent = (
            report or self.world.fleet.report(self._index)
        )
        (x, y, z), (vx, vy, vz) = place, speed
        position, velocity = vector3(x, y, z), vector3(vx, vy, vz)
        if self._is_noisy:
            position_noise, velocity_noise = self._noise()
            position, velocity = position + position_noise, velocity + velocity_noise
        if yaw != self._yaw:
            self._yaw, self._orientation = yaw, Quaternion.from_yaw(yaw)
        pose = Pose(position, self._orientation)
        twist = Twist(velocity, vector3(0.0, 0.0, yaw_rate) if yaw_rate else _ZERO)
        self._report_status(now_s, mode, is_armed, is_landed, has_position, percent)
        estimator = self._status.estimator
        self._snapshot = Snapshot(
            now_s,
            now_s,
            now_s,
            "",
            self._snapshot_step,
            self._status.control,
            MotionState(estimator, Sample(pose, now_s), Sample(twist, now_s), None, self.world.epoch_s + now_s),
            self._earth,
            self._status.condition,
        )
        return self._snapshot

    def _report_status(
        self, now_s: float, mode: int, is_armed: bool, is_landed: bool, has_position: bool, percent: float
    ) -> None:
        """Reports all but the motion as autopilots do: at once where it has changed, else every `_STATUS_PERIOD_S`."""
        if mode != FlightMode.HOLD:
            self._holds_by = None
        failsafe, holds_by, text, lag_s = self._faults.failsafe, self._holds_by, self._status_text, self.world.lag_s
        is_low, late_s = percent < _LOWEST_BATTERY_PERCENT, lag_s if lag_s > LAG_S else 0.0
        values = mode, is_armed, is_landed, has_position, failsafe, holds_by, text, is_low, late_s
        last = self._status
        if values == last.values and 0.0 <= now_s - last.time_s < _STATUS_PERIOD_S:
            return
        landed = LandedState.ON_GROUND if is_landed else LandedState.IN_AIR
        if mode == FlightMode.LAND and not is_landed:
            landed = LandedState.LANDING
        shown = round(percent, 1)  # no autopilot tells more; so the same value lasts for a while
        battery = Battery(shown, _EMPTY_V + (_FULL_V - _EMPTY_V) * shown / 100.0, 12.0 if is_armed else 0.5)
        if battery == last.condition.battery:
            battery = last.condition.battery
        self._status = _Status(
            now_s,
            values,
            ControlState(
                armed=Sample(is_armed, now_s),
                landed=Sample(landed, now_s),
                mode=Sample(_MODES[mode], now_s),
                failsafe=failsafe,
                held_by=Cause.SAFETY_PILOT if mode == FlightMode.MANUAL else holds_by,
            ),
            Sample(_GOOD if has_position else _LOST, now_s),
            Condition(
                battery=battery,
                gps=_gps(self._corrections.age_s, has_position=has_position),
                status_text=text,
                health=_health(percent, lag_s, has_position=has_position),
            ),
        )


_READY, _BLIND, _EMPTY = Health(True), Health(False, ("position",)), Health(False, ("battery",))


def _health(percent: float, lag_s: float, *, has_position: bool) -> Health:
    found = _READY
    if not has_position:
        found = _BLIND
    elif percent < _LOWEST_BATTERY_PERCENT:
        found = _EMPTY
    if lag_s <= LAG_S:
        return found
    return replace(found, failing_checks=(*found.failing_checks, f"simulated time is {lag_s:.1f} s behind"))


_FIX, _NO_FIX = GpsInfo(GpsFix.FIX_3D, 14, 0.5, 0.8), GpsInfo(GpsFix.NONE)


def _gps(corrections_age_s: float | None, *, has_position: bool) -> GpsInfo:
    fix = _FIX if has_position else _NO_FIX
    return fix if corrections_age_s is None else replace(fix, corrections_age_s=corrections_age_s)


_GOOD = Estimator(True)
_LOST = Estimator(False, "its position is lost (simulated)")


def _speed_factor(settings: LightSettings) -> float:
    return math.inf if settings.speed_factor == "max" else settings.speed_factor


_TAKES = {"all": Takes.ALL, "positions": Takes.POSITION, "velocities": Takes.VELOCITY}


def _vehicle_info(settings: LightSettings) -> VehicleInfo:
    takes = _TAKES[settings.takes]
    return VehicleInfo(
        autopilot="light",
        autopilot_version=__version__,
        is_simulation=True,
        capabilities=frozenset(Capability) - (set() if Takes.VELOCITY in takes else {Capability.VELOCITY}),
        limits=Limits(
            settings.horizontal_speed_m_s,
            settings.vertical_speed_m_s,
            settings.vertical_speed_m_s,
            settings.horizontal_acceleration_m_s2,
            settings.vertical_acceleration_m_s2,
            settings.yaw_rate_rad_s,
        ),
        flies_takeoff_on_setpoints=True,
        takes=takes,
        velocity_gains=VelocityGains(position_per_s=POSITION_GAIN, response_s=settings.response_s),
        velocity_responses=VelocityResponses(
            VelocityResponse(settings.response_s, settings.horizontal_acceleration_m_s2, delay_s=0.0),
            VelocityResponse(settings.response_s, settings.vertical_acceleration_m_s2, delay_s=0.0),
        ),
    )
