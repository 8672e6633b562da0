"""A recorded flight as a UAV: it does again what was recorded. Nothing can be flown with it."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NoReturn, TypeVar

from typing_extensions import override

from ual.errors import LeaseLostError, NotSupportedError
from ual.geometry import Pose
from ual.interface import Simulation
from ual.types import Geofence, Info, LeaseInfo, Route, State, TaskInfo, Telemetry
from ual_daemon._version import __version__
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink.playback import ENCODING, Playback
from ual_daemon.backends.values import Freshness, Snapshot, VehicleInfo
from ual_daemon.flight.policy.geofence import geofence_of
from ual_daemon.flight.policy.jumps import JumpDetector
from ual_daemon.flight.state import Estimate, estimate
from ual_daemon.flight.tasks import Tasks, VehicleTask
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.replay import source
from ual_daemon.replay.moment import ReplayMoment
from ual_daemon.replay.played_frames import PlayedFrames
from ual_daemon.replay.player import Player
from ual_daemon.replay.settings import SECTION, ReplaySettings
from ual_daemon.settings import ConfigError, PayloadSettings, VehicleSettings, convert
from ual_daemon.tracker.limits import smaller
from ual_daemon.vehicle.equipment import PayloadEquipment
from ual_daemon.vehicle.in_map import geofence_in_map
from ual_daemon.vehicle.refusal_log import RefusalLog
from ual_daemon.vehicle.reported import ReportedVehicle
from ual_daemon.vehicle.telemetry import make_telemetry

LIMITATION = "this is a recording: nothing can be flown"
_RECORDING = "a recording"


T = TypeVar("T")


class _Unwatched:
    """Whether the UAV of a recording follows is in its reasons."""

    why = ""


class _NoActivity:
    """Activity of UAL during a replay, which is none; see `ual_daemon.vehicle.telemetry.Doing`."""

    def __init__(self, limitation: str) -> None:
        self.limitation = limitation
        self.following = _Unwatched()
        self.holder = None
        self.is_on_mission = False

    def reference_pose(self) -> Pose | None:
        return None

    def task_info(self) -> TaskInfo | None:
        return None


_RECORDED = _NoActivity("")
_NOT_RECORDED = _NoActivity(LIMITATION)


class PlayedVehicle(ReportedVehicle):
    """Plays a recording as a UAV. Any thread may call any member.

    It has the members of `ual_daemon.vehicle.vehicle.Vehicle` that the class and the server use. Each command raises
    `NotSupportedError`, as `commands` does.
    """

    def __init__(self, options: BackendOptions, settings: VehicleSettings | None = None) -> None:
        """Raises `ConfigError`: the recording cannot be played, or a setting is wrong."""
        settings = settings or VehicleSettings()
        self._player = player = _player(options)
        super().__init__(options.ns, SECTION, player.clock, FrameResolver(options.ns, settings))
        self._url = options.url or ""
        self._frames_played = PlayedFrames(self._resolver.tree, player.clock)
        self._pose_frame_id = settings.pose_frame_id
        self._users_limits = settings.limits
        self._geofence = geofence_of(settings, self._resolver, VehicleInfo().clearance_m)
        self.equipment = PayloadEquipment(PayloadSettings())
        """Nothing is moved by a recording."""
        self._jumps = JumpDetector()
        self._tasks = Tasks(player.clock)
        self._refusals = RefusalLog()

    # --- Lifetime -----------------------------------------------------------------------------------------------------

    def open(self) -> None:
        """Begins to play."""
        self._resolver.open()
        self._player.open(self._on_moment, self._frames_played.take)

    def close(self) -> None:
        """Ends."""
        self._player.close()

    def prepare_shutdown(self) -> Future[None]:
        """Returns a future that has ended: nothing flies."""
        done: Future[None] = Future()
        done.set_result(None)
        return done

    @property
    def is_watch_only(self) -> bool:
        """Whether every command is refused: a recording cannot be flown."""
        return True

    def is_in_control(self) -> bool:
        """Returns False."""
        return False

    # --- What cannot be done ------------------------------------------------------------------------------------------

    @property
    def commands(self) -> NoReturn:
        """There are none: raises `NotSupportedError`."""
        self._refuse()

    @property
    def missions(self) -> NoReturn:
        """There are none: raises `NotSupportedError`."""
        self._refuse()

    @property
    def uploads(self) -> NoReturn:
        """There are none: raises `NotSupportedError`."""
        self._refuse()

    @property
    def gimbals(self) -> NoReturn:
        """There are none: raises `NotSupportedError`."""
        self._refuse()

    @property
    def external_poses(self) -> NoReturn:
        """There is no autopilot that could use them: raises `NotSupportedError`."""
        self._refuse()

    def _refuse(self) -> NoReturn:
        error = NotSupportedError(f"{self.ns} cannot be commanded: {LIMITATION}")
        self._refusals.log_refusal("command", error)
        raise error

    def acquire_lease(self, *_: object, **__: object) -> NoReturn:
        """Raises `NotSupportedError`: a lease is for commands."""
        self._refuse()

    def require_lease(self, *_: object) -> None:
        """Raises `NotSupportedError`: what an extension would move is not there."""
        self._refuse()

    def keep_lease(self, _: str) -> None:
        """Raises `LeaseLostError`: there was none."""
        raise LeaseLostError(f"{self.ns} has no lease: {LIMITATION}")

    def release_lease(self, _: str) -> None:
        """Does nothing: there is none."""

    def lease(self) -> LeaseInfo | None:
        """Returns None."""
        return None

    def safety_pilot(self) -> None:
        """Returns None."""

    def why_not_auto_arm(self) -> str:
        """Returns nothing: there is no safety pilot."""
        return ""

    def payload(self) -> None:
        """Returns None."""

    def offer(self, kind: type[T]) -> T | None:
        """Returns None: nothing can be asked of what was recorded."""
        return None

    def configured_fence(self) -> tuple[tuple[float, float], ...]:
        """Returns no corners: nothing is uploaded to what was recorded."""
        return ()

    def is_armed(self) -> None:
        """Returns None: what is recorded is over."""

    def observe_packets(self, _: object) -> bool:
        """Returns False: what is played is recorded already."""
        return False

    def observe_setpoints(self, _: object) -> None:
        """Does nothing: no setpoint is sent."""

    def route(self) -> Route | None:
        """Returns None: a recording does not have the way that was flown."""
        return None

    def task(self, task_id: str) -> VehicleTask:
        """Raises `InvalidArgumentError`: there is no task that could be waited for."""
        return self._tasks.get(task_id)

    def simulation(self) -> Simulation:
        """Raises `NotSupportedError`: there is no world around it."""
        raise NotSupportedError(f"{self.ns} ({self.backend_name}) is not a simulation of ours")

    # --- What is known ------------------------------------------------------------------------------------------------

    def info(self) -> Info:
        """Returns the identity of the recorded UAV, as far as it is known."""
        playback = self._player.playback
        vehicle = VehicleInfo() if playback is None else playback.info
        return Info(
            namespace=self.ns,
            backend=self.backend_name,
            autopilot=vehicle.autopilot or _RECORDING,
            autopilot_version=vehicle.autopilot_version,
            is_simulation=False,
            capabilities=frozenset(),
            limits=smaller(vehicle.limits, self._users_limits),
            ual_version=__version__,
            is_arming_allowed=False,
            url=self._url,
            has_safety_pilot=vehicle.has_safety_pilot,
        )

    def geofence(self) -> Geofence:
        """Returns where the UAV might fly by the configuration; see `geofence_in_map`, also for what is raised."""
        return geofence_in_map(self._geofence, self._resolver, self._snapshot())

    @override
    def _snapshot(self) -> Snapshot:
        return self._player.moment.snapshot.at(self.clock.now_s())

    @override
    def _estimate(self, snapshot: Snapshot) -> Estimate:
        return self._player.moment.estimate(snapshot, self._freshness)

    @property
    def _freshness(self) -> Freshness:
        playback = self._player.playback
        return Freshness() if playback is None else playback.freshness

    @override
    def _sample(self, snapshot: Snapshot, found: Estimate, *, is_late: bool = False) -> Telemetry:
        _, telemetry, is_whole = self._player.moment
        if telemetry is not None and is_whole:
            return replace(telemetry, sequence=self._sequence)
        doing = _NOT_RECORDED if telemetry is None else _RECORDED
        sample = make_telemetry(snapshot, found, self._resolver, doing, self._pose_frame_id, self._sequence)
        if telemetry is None:
            return sample
        reference = telemetry.reference_pose if telemetry.frame_id == sample.frame_id else sample.reference_pose
        return replace(sample, reference_pose=reference, task=telemetry.task)

    # --- Updates ------------------------------------------------------------------------------------------------------

    def _on_moment(self, moment: ReplayMoment) -> None:
        self._on_update(moment.snapshot)

    @override
    def _update(self, snapshot: Snapshot) -> None:
        self._sequence += 1
        self._resolver.update(snapshot)
        jump = self._jumps.observe(snapshot)
        if jump is not None:
            self._resolver.estimate_jumped(jump.offset)
            self._geofence.estimate_jumped(jump.offset)
        found = self._estimate(snapshot)
        raw, is_taking_off = estimate(snapshot, self._freshness), found.state is State.TAKING_OFF
        self._geofence.observe(snapshot, raw, is_taking_off=is_taking_off)
        self._publish(snapshot, found)


def _player(options: BackendOptions) -> Player:
    """Returns what plays the recording that the options name. Raises `ConfigError`."""
    settings = convert(options.settings, ReplaySettings, SECTION)
    if options.url is None:
        raise ConfigError("the replay backend needs a recording: --url flight.mcap", "url")
    path = Path(options.url)
    contents = source.contents_of(path, options.ns, settings.uav)
    is_decoded = settings.is_decoded and contents.encoding == ENCODING
    if not (is_decoded or contents.has_samples):
        raise ConfigError(f"{path} has no telemetry of {contents.uav}, and no packets that can be decoded", "url")
    return Player(
        partial(source.events, path, contents),
        partial(Playback, options.url, settings.system_id) if is_decoded else None,
        (contents.uav, options.ns),
        speed_factor=settings.speed_factor,
        begin_s=settings.begin_s,
        is_looping=settings.loop,
        has_samples=contents.has_samples,
    )
