"""AirSim's `simple_flight` as a backend."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.interface import Simulation
from ual.types import Capability, Limits
from ual_daemon.backends import futures
from ual_daemon.backends.airsim.cameras import AirsimCameras, LocalFrameOrigin
from ual_daemon.backends.airsim.clock import SimulatorClock
from ual_daemon.backends.airsim.commands import Action, AirsimCommandQueue
from ual_daemon.backends.airsim.fetching import PictureFetcher
from ual_daemon.backends.airsim.link import Simulator, SimulatorLink
from ual_daemon.backends.airsim.pilot import AirsimPilot
from ual_daemon.backends.airsim.procedures import Procedures
from ual_daemon.backends.airsim.rpc import RpcConnection
from ual_daemon.backends.airsim.session import LINK_S, AirsimRequest, AirsimSession, nothing
from ual_daemon.backends.airsim.setpoints import AirsimSetpointSender
from ual_daemon.backends.airsim.settings import DEFAULT_URL, SECTION, AirsimAddress, AirsimSettings, parse_address
from ual_daemon.backends.airsim.simulation import AirsimSimulation
from ual_daemon.backends.airsim.snapshots import API, HOVER, REMOTE_CONTROL, projection_of
from ual_daemon.backends.base import BackendOptions, SafetyPilot, SimulatedPilot, UpdateCallback
from ual_daemon.backends.engine.backend import EngineBackend
from ual_daemon.backends.engine.command import ARMING, FLYING, Command
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.mailbox import SetpointMailbox
from ual_daemon.backends.values import Freshness, Setpoint, SetpointLoss, Snapshot, Takes, VehicleInfo, VelocityGains
from ual_daemon.settings import convert

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


class AirsimBackend(EngineBackend[AirsimRequest]):
    """One vehicle of a simulator."""

    name = "airsim"
    freshness = Freshness(link_s=LINK_S, pose_s=LINK_S, mode_s=LINK_S, landed_s=LINK_S, estimator_s=LINK_S)
    outlived = True

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self._settings = settings = convert(options.settings, AirsimSettings, SECTION)
        self._address = address = parse_address(options.url or DEFAULT_URL)
        self.clock = clock = SimulatorClock(self._wall_s)
        self._info: tuple[Simulator | None, VehicleInfo | None] = (None, None)
        link = SimulatorLink(address, settings.vehicle_name, settings.rate_hz, self._connect, self._wall_s)
        self._link = link
        self._commands = AirsimCommandQueue(address, f"airsim commands {options.ns}")
        self._sender = AirsimSetpointSender(address, lambda: self._session.vehicle, lambda: self._session.report)
        self._mailbox = SetpointMailbox(self._sender.send, clock, f"airsim setpoints {options.ns}")
        self._session = AirsimSession(link, self._commands, self._mailbox, clock, settings.mass_kg, self._wall_s)
        link.on_connect = self._on_connect
        fetcher = PictureFetcher(address, f"airsim pictures {options.ns}", lambda: self._session.vehicle)
        self._cameras = AirsimCameras(fetcher, self._local_frame_origin, lambda: link.trouble)
        self._session.on_pose = self._cameras.on_report
        self._procedures = Procedures(lambda: self._session.vehicle)
        self._pilot = AirsimPilot(address, lambda: self._session.vehicle, lambda: self._session.report)
        self._offers = (self._cameras,)
        self._loop = self._session.loop
        self._entrance = CommandEntrance(self._loop, clock, self._session.require_runner)

    def _connect(self, address: AirsimAddress) -> RpcConnection:
        return RpcConnection(address)

    def _wall_s(self) -> float:
        """The clock of this computer, by which silences and pauses are assessed."""
        return time.monotonic()

    # --- The backend --------------------------------------------------------------------------------------------------

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._session.loop.on_update = on_update
        self._commands.open()
        self._mailbox.open()
        self._session.thread.open()

    @override
    def close(self) -> None:
        self._session.thread.close(self._link.close)
        self._pilot.let_go()
        self._cameras.close()
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
    def send(self, setpoint: Setpoint) -> None:
        self._session.send(setpoint)

    @override
    def arm(self) -> Future[None]:
        return self._grounded("arm", (self._controlling, self._procedures.start_motors))

    @override
    def disarm(self) -> Future[None]:
        return self._grounded("disarm", (self._controlling, self._procedures.stop_motors))

    @override
    def disarm_landed(self) -> Future[None]:
        procedures = self._procedures
        actions = procedures.require_own_control, procedures.stop_motors
        return self._grounded("disarm", actions, self._session.begin_disarming)

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        del height_m, limits  # UAL's setpoints fly the climb
        return self.take_control()

    @override
    def land(self, limits: Limits) -> Future[None]:
        return futures.refused("Land: UAL's setpoints fly it (VehicleInfo.flies_landing_on_setpoints)")

    @override
    def take_control(self) -> Future[None]:
        actions = (self._procedures.enable, self._procedures.hover) if self._is_off else (self._controlling,)
        request = AirsimRequest(actions, self._session.begin_control)
        return self._order("take control", lambda: Command("take control", request, FLYING, mode=API.name))

    @override
    def hold(self) -> Future[None]:
        self._session.begin_hold()
        request = AirsimRequest((self._procedures.require_own_control, self._procedures.hover))
        return self._order("hold", lambda: Command("hold", request, FLYING, mode=HOVER.name))

    @override
    def safety_pilot(self) -> SafetyPilot:
        return SimulatedPilot(self._is_on_ground, self.simulation().pilot_arm)

    @override
    def simulation(self) -> Simulation:
        return AirsimSimulation(self._session, self._procedures, self._pilot)

    @override
    def utc_s(self) -> float:
        simulated_s = self._session.utc_s
        return time.time() if simulated_s is None else simulated_s

    # --- Its commands -------------------------------------------------------------------------------------------------

    @property
    def _is_off(self) -> bool:
        """Whether callers see that API control is off."""
        mode = self._session.loop.newest.control.mode
        return mode is not None and mode.value is REMOTE_CONTROL

    @property
    def _controlling(self) -> Action:
        """Step before everything that needs API control. It is taken only where the caller saw that it was off.

        Where it was on, the safety pilot may switch it off before the command is executed, and then keeps it off.
        """
        return self._procedures.enable if self._is_off else self._procedures.require_own_control

    def _grounded(self, what: str, actions: tuple[Action, ...], begin: Callable[[], None] = nothing) -> Future[None]:
        """Gives a command for a vehicle on the ground: the simulator would disarm it in the air, too."""
        if not self._is_on_ground():
            return futures.refused(f"{what.capitalize()}: not on the ground")
        command = Command(what, AirsimRequest(actions, begin), ARMING, mode=API.name, waits=self._why_not_on_ground)
        return self._order(what, lambda: command)

    def _why_not_on_ground(self, _: Snapshot) -> str:
        return "" if self._is_on_ground() else "it is not on the ground"

    def _is_on_ground(self) -> bool:
        return self._session.is_on_ground

    # --- On the loop's thread -----------------------------------------------------------------------------------------

    def _on_connect(self, has_booted: bool) -> None:
        """Has the other connections made again, as the link's was: the old ones are lost as well."""
        self._session.on_connect(has_booted)
        self._sender.disconnect()
        assert self._link.simulator is not None
        self._cameras.on_connect(self._link.simulator.cameras, has_booted)

    def _local_frame_origin(self) -> LocalFrameOrigin:
        simulator = self._link.simulator
        return LocalFrameOrigin(self._session.boots_count, None if simulator is None else projection_of(simulator))
