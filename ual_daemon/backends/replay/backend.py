"""The backend: a UAV that does again what was recorded. Nothing can be flown with it."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from pathlib import Path

from typing_extensions import override

from ual.errors import NotSupportedError
from ual.types import Limits
from ual_daemon.backends import futures
from ual_daemon.backends.base import Backend, BackendOptions, UpdateCallback
from ual_daemon.backends.mavlink.playback import ENCODING, Playback
from ual_daemon.backends.replay import source
from ual_daemon.backends.replay.player import Player, ReplayClock
from ual_daemon.backends.replay.settings import SECTION, ReplaySettings
from ual_daemon.backends.values import Setpoint, SetpointLoss, Snapshot, VehicleInfo
from ual_daemon.settings import ConfigError, convert


class ReplayBackend(Backend):
    """Plays a recording (`--url` FILE) as a UAV. See ``docs/backends/replay.md``."""

    name = SECTION
    clock: ReplayClock
    can_fly = False

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        settings = convert(options.settings, ReplaySettings, SECTION)
        if options.url is None:
            raise ConfigError("the replay backend needs a recording: --url flight.mcap", "url")
        path = Path(options.url)
        contents = source.look(path, options.ns, settings.uav)
        is_decoded = settings.is_decoded and contents.encoding == ENCODING
        if not (is_decoded or contents.has_samples):
            raise ConfigError(f"{path} has no telemetry of {contents.uav}, and no packets that can be decoded", "url")
        self._player = Player(
            partial(source.events, path, contents),
            partial(Playback, options.url, settings.system_id) if is_decoded else None,
            (contents.uav, options.ns),
            speed_factor=settings.speed_factor,
            begin_s=settings.begin_s,
            is_looping=settings.loop,
            has_samples=contents.has_samples,
        )
        self.clock = self._player.clock
        self._known = VehicleInfo()
        self._info = _of_recording(self._known)

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._player.open(partial(self._on_snapshot, on_update))

    @override
    def close(self) -> None:
        self._player.close()

    @override
    def info(self) -> VehicleInfo:
        return self._info

    @override
    def snapshot(self) -> Snapshot:
        return self._player.snapshot.at(self.clock.now_s())

    @override
    def utc_s(self) -> float:
        return self.clock.utc_s

    @override
    def send(self, setpoint: Setpoint) -> None:
        return None

    @override
    def arm(self) -> Future[None]:
        return self._refused("arm")

    @override
    def disarm(self) -> Future[None]:
        return self._refused("disarm")

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        return self._refused("take off")

    @override
    def land(self, limits: Limits) -> Future[None]:
        return self._refused("land")

    @override
    def take_control(self) -> Future[None]:
        return self._refused("take control")

    @override
    def hold(self) -> Future[None]:
        return self._refused("hold")

    def _on_snapshot(self, on_update: UpdateCallback, snapshot: Snapshot) -> None:
        playback = self._player.playback
        if playback is not None:
            self.freshness = playback.freshness
            if playback.info != self._known:  # the same object while nothing is new, so that its users need not compare
                self._known = playback.info
                self._info = _of_recording(self._known)
        on_update(snapshot)

    def _refused(self, what: str) -> Future[None]:
        return futures.failed(NotSupportedError(f"cannot {what}: {self.options.ns} is a recording"))


def _of_recording(known: VehicleInfo) -> VehicleInfo:
    """Returns what is known of the recorded vehicle, without what only a flying one has."""
    return replace(
        known,
        autopilot=known.autopilot or "a recording",
        is_simulation=False,
        capabilities=frozenset(),
        setpoint_loss=SetpointLoss.HOLDS,
        limitation="this is a recording: nothing can be flown",
    )
