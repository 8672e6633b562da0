"""AirSim's `simple_flight` as a backend."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager

from typing_extensions import override

from ual.errors import RejectedByAutopilotError
from ual.interface import Simulation
from ual.types import Capability, Limits
from ual_daemon import logs
from ual_daemon.backends import futures
from ual_daemon.backends.airsim.clock import SimulatorClock
from ual_daemon.backends.airsim.collisions import CollisionWatch
from ual_daemon.backends.airsim.commands import Action, CommandQueue
from ual_daemon.backends.airsim.link import Simulator, SimulatorLink
from ual_daemon.backends.airsim.pilot import Pilot
from ual_daemon.backends.airsim.procedures import Procedures
from ual_daemon.backends.airsim.setpoints import SetpointSender
from ual_daemon.backends.airsim.settings import DEFAULT_URL, SECTION, AirsimSettings, parse_address
from ual_daemon.backends.airsim.simulation import AirsimSimulation
from ual_daemon.backends.airsim.snapshots import (
    API,
    COLLISION,
    HOVER,
    REMOTE_CONTROL,
    make_snapshot,
    projection_of,
)
from ual_daemon.backends.airsim.state import Report
from ual_daemon.backends.base import Backend, BackendOptions, SafetyPilot, UpdateCallback
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.mailbox import SetpointMailbox
from ual_daemon.backends.values import (
    Freshness,
    LandedState,
    Mode,
    Setpoint,
    SetpointLoss,
    Snapshot,
    Takes,
    VehicleInfo,
    VelocityGains,
)
from ual_daemon.settings import convert

_log = logging.getLogger(__name__)

_LIMITS = Limits(
    horizontal_speed_m_s=5.0,
    climb_speed_m_s=3.0,
    descent_speed_m_s=2.0,
    horizontal_acceleration_m_s2=1.7,
    vertical_acceleration_m_s2=1.5,
    yaw_rate_rad_s=1.0,
)
_GAINS = VelocityGains(position_per_s=0.9, yaw_per_s=1.5, response_s=0.5)
_CAPABILITIES = frozenset(
    {
        Capability.ARM,
        Capability.TAKE_OFF,
        Capability.LAND,
        Capability.POSITION,
        Capability.VELOCITY,
        Capability.GEO,
        Capability.RECOVER,
    }
)


class _AirsimPilot(SafetyPilot):
    """See `ual_daemon.backends.base.SafetyPilot`: every vehicle of this backend is simulated."""

    def __init__(self, backend: AirsimBackend) -> None:
        self._backend = backend

    @override
    def may_arm(self) -> bool:
        return self._backend.is_ready()

    @override
    def arm(self) -> None:
        self._backend.simulation().pilot_arm()


class AirsimBackend(Backend):
    """One vehicle of a simulator."""

    name = "airsim"
    freshness = Freshness(link_s=2.0, pose_s=2.0, mode_s=2.0, landed_s=2.0, estimator_s=2.0)  # Unreal pauses, too
    outlived = True

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self._settings = convert(options.settings, AirsimSettings, SECTION)
        self._address = parse_address(options.url or DEFAULT_URL)
        self.clock = self._clock = SimulatorClock()
        self._info: tuple[Simulator | None, VehicleInfo | None] = (None, None)
        self._link = SimulatorLink(
            self._address,
            self._settings.vehicle_name,
            self._settings.rate_hz,
            self._renew,
            self._on_report,
            self._update,
        )
        self._commands = CommandQueue(self._address, f"airsim commands {options.ns}")
        self._procedures = Procedures(self._vehicle)
        self._sender = SetpointSender(self._address, self._vehicle, self._newest)
        self._mailbox = SetpointMailbox(self._sender.send, self.clock, f"airsim setpoints {options.ns}")
        self._pilot = Pilot(self._address, self._vehicle, self._newest)
        self._plausibility = Plausibility()
        self._collisions = CollisionWatch()
        self._on_update: UpdateCallback | None = None
        self._report: Report | None = None
        self._snapshot = Snapshot(0.0)
        self._looked_s = 0.0
        self._has_collided = self._is_holding = self._is_silent = self._is_disarming = False
        self._status_text = ""

    # --- The backend --------------------------------------------------------------------------------------------------

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._on_update = on_update
        self._commands.open()
        self._mailbox.open()
        self._link.open()

    @override
    def close(self) -> None:
        self._link.close()
        self._pilot.let_go()
        self._sender.close()
        self._mailbox.close()
        self._commands.close()

    @override
    def info(self) -> VehicleInfo:
        simulator = self._link.simulator
        made_for, info = self._info
        if info is None or made_for is not simulator:  # each setpoint asks three times
            info = self._make_info(simulator)
            self._info = (simulator, info)
        return info

    def _make_info(self, simulator: Simulator | None) -> VehicleInfo:
        identity = "" if simulator is None else f"airsim {self._address} {simulator.vehicle}"
        return VehicleInfo(
            autopilot="AirSim simple_flight",
            autopilot_version="" if simulator is None else simulator.version,
            is_simulation=True,
            capabilities=_CAPABILITIES,
            limits=_LIMITS,
            flies_landing_on_setpoints=True,  # its own took 52 s for 5.4 m, and once ended at 2 m
            takes=Takes.VELOCITY,
            velocity_gains=_GAINS,
            setpoint_rate_hz=self._settings.rate_hz,
            setpoint_loss=SetpointLoss.HOLDS,
            identity=identity,
        )

    @override
    def snapshot(self) -> Snapshot:
        now_s, link = self.clock.now_s(), self._link
        looked_s = self._looked_s if link.is_up else now_s  # while it is down, nothing can come
        snapshot = self._snapshot._replace(time_s=now_s, updated_s=looked_s, link_trouble=link.trouble)
        if link.why_not:  # the simulator answers, but not for our vehicle
            return snapshot._replace(heard_s=now_s, conflict=link.why_not)
        return snapshot

    @override
    def send(self, setpoint: Setpoint) -> None:
        is_free = not (self._has_collided or self._is_holding or self._is_silent or self._is_disarming)
        if self._link.is_up and is_free:
            self._mailbox.put(setpoint)

    @override
    def arm(self) -> Future[None]:
        if not self._is_on_ground():
            return _refusal("Arm: not on the ground")
        return self._command(self._procedures.arm)

    @override
    def disarm(self) -> Future[None]:
        if not self._is_on_ground():
            return _refusal("Disarm: not on the ground")
        return self._command(self._procedures.disarm)

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        del height_m, limits  # UAL's setpoints fly the climb
        return self.take_control()

    @override
    def land(self, limits: Limits) -> Future[None]:
        return _refusal("Land: UAL's setpoints fly it (VehicleInfo.flies_landing_on_setpoints)")

    @override
    def disarm_landed(self) -> Future[None]:
        if not self._is_on_ground():
            return _refusal("Disarm: not on the ground")
        self._is_disarming = True  # a velocity would start the motors again
        self._mailbox.drop()
        return self._command(self._procedures.disarm_landed)

    @override
    def take_control(self) -> Future[None]:
        self._has_collided = self._is_holding = self._is_disarming = False
        return self._command(self._procedures.take_control)

    @override
    def hold(self) -> Future[None]:
        self._is_holding = True
        self._mailbox.drop()
        return self._command(self._procedures.hover)

    @override
    def safety_pilot(self) -> SafetyPilot:
        return _AirsimPilot(self)

    @override
    def simulation(self) -> Simulation:
        return AirsimSimulation(
            self._commands.submit,
            self._procedures,
            self._pilot,
            self._newest,
            self._is_on_ground,
            self._own_speed,
            self._silence,
        )

    @override
    def utc_s(self) -> float:
        report = self._report
        return time.time() if report is None else report.time_s

    def is_ready(self) -> bool:
        """Whether the vehicle stands on the ground and is heard."""
        return self._is_on_ground()

    # --- Data ---------------------------------------------------------------------------------------------------------

    def _vehicle(self) -> str:
        assert self._link.simulator is not None
        return self._link.simulator.vehicle

    @contextmanager
    def _silence(self) -> Iterator[None]:
        """No setpoint is sent until the block ends."""
        self._is_silent = True
        self._mailbox.drop()
        try:
            yield
        finally:
            self._is_silent = False

    def _own_speed(self) -> float:
        simulator = self._link.simulator
        return 1.0 if simulator is None else simulator.clock_speed

    def _newest(self) -> Report | None:
        return self._report if self._link.is_up else None

    def _is_on_ground(self) -> bool:
        report = self._newest()
        return report is not None and report.is_on_ground(self._settings.mass_kg)

    def _renew(self) -> None:
        """Has the other connections made anew, as the link's was: the old ones are lost as well."""
        self._commands.disconnect()
        self._sender.disconnect()

    def _on_report(self, report: Report) -> None:
        """Takes what the simulator reports; runs on the link's thread."""
        assert self._link.simulator is not None
        now_s = self._clock.advance(report.time_s)
        self._report = report
        is_on_ground = report.is_on_ground(self._settings.mass_kg)
        self._note_collision(report, is_on_ground)
        self._is_disarming = self._is_disarming and is_on_ground and report.is_armed
        landed = LandedState.ON_GROUND if is_on_ground else LandedState.IN_AIR
        snapshot = make_snapshot(
            report,
            now_s,
            self._mode(report),
            landed,
            projection_of(self._link.simulator),
            is_plausible=self._plausibility.accepts_motion(report.pose, report.velocity),
        )
        self._snapshot = snapshot._replace(status_text=self._status_text, boots_count=self._link.starts_count)

    def _mode(self, report: Report) -> Mode:
        if not report.has_api_control:
            return REMOTE_CONTROL
        if self._is_holding:
            return HOVER
        return COLLISION if self._has_collided else API

    def _note_collision(self, report: Report, is_on_ground: bool) -> None:
        what = self._collisions.observe(report)
        if what:
            self._status_text = f"collision with {what}"
            logs.event(_log, logging.WARNING, "collision", object=what)
            self._mailbox.drop()
            self._has_collided = not is_on_ground
        elif is_on_ground:
            self._has_collided = self._is_holding = False

    def _update(self) -> None:
        self._looked_s = self.clock.now_s()
        if self._on_update is not None:
            self._on_update(self.snapshot())

    def _command(self, action: Action) -> Future[None]:
        """Has a command executed; while the link is down it is dropped, and its future stays open."""
        return Future() if not self._link.is_up else self._commands.submit(action)


def _refusal(text: str) -> Future[None]:
    return futures.failed(RejectedByAutopilotError(f"refused: {text}", {"text": text}))
