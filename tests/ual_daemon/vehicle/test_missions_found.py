"""Search of a restarted daemon for the mission that it flew before."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.ual_daemon.stepped import STEP_S, Stepped, stepped
from ual.errors import TaskAbortedError, UalTimeoutError
from ual.geometry import Vector3
from ual.missions import ReturnToLaunch
from ual_daemon.backends import futures
from ual_daemon.backends.chain import done
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission
from ual_daemon.flight.flight import CommandOrigin, Flight
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre
from ual_daemon.flight.tasks import Tasks
from ual_daemon.settings import LimitSettings, VehicleSettings
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import Hold
from ual_daemon.vehicle.mission_file import MissionFile, RunningMission
from ual_daemon.vehicle.missions import DOWNLOAD_RETRY_S, Missions


class Offer:
    """The missions of an autopilot, which it refuses to send, or sends as `kept`."""

    mode, pause_mode = "GUIDED", "BRAKE"

    def __init__(self) -> None:
        self.asked_count = 0
        self.kept: KeptMission | None = None

    def download(self) -> Future[KeptMission]:
        self.asked_count += 1
        if self.kept is not None:
            return done(self.kept)
        return futures.failed(UalTimeoutError("busy with another station"))

    def report(self) -> None:
        """Nothing is reported of it."""


class Restarted:
    """A daemon that was restarted while the autopilot flew its mission."""

    def __init__(self, uav: Stepped, monkeypatch: pytest.MonkeyPatch, path: Path) -> None:
        uav.fly()
        self._uav, self.offer, vehicle = uav, Offer(), uav.vehicle
        backend = self._backend = vehicle.backend
        info, offered = backend.info(), backend.offer

        def offers(kind: type[Any]) -> Any:
            return self.offer if kind is AutopilotMissions else offered(kind)

        monkeypatch.setattr(backend, "offer", offers)
        monkeypatch.setattr(backend, "info", lambda: replace(info, identity="it"))
        self.file = MissionFile(path)
        self.file.write(RunningMission("it", "digest", "mission-1"))
        self.tasks = Tasks(backend.clock)
        self.flight = Flight(backend, CurrentLimits(backend, LimitSettings()), vehicle._flight.geofence)
        self._missions = Missions(
            backend, self.flight, vehicle._resolver, self.tasks, VehicleSettings(), self.file, vehicle.uploads
        )

    def command_and_adopt(self, manoeuvre: Manoeuvre) -> bool:
        """Another thread commands the UAV just before."""
        hold = Hold(Vector3(0.0, 0.0, 3.0), 0.0)
        self.flight.begin_reference(hold, "set_pose", self._backend.snapshot(), CommandOrigin())
        return Flight.adopt(self.flight, manoeuvre)

    def run(self, duration_s: float) -> None:
        """Lets time pass."""
        for _ in range(round(duration_s / STEP_S)):
            self._uav.run(STEP_S)
            self._missions.update(self._backend.snapshot())


@pytest.fixture
def restarted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Restarted]:
    with stepped() as uav:
        yield Restarted(uav, monkeypatch, tmp_path / "uav_1.mission")


def test_a_mission_that_cannot_be_read_is_requested_once_in_a_while(restarted: Restarted) -> None:
    """Else each update would ask, and take the link from the flight and from other stations."""
    restarted.run(3.5 * DOWNLOAD_RETRY_S)
    assert restarted.offer.asked_count == 4


@pytest.mark.parametrize("is_closing", [True, False])
def test_one_that_is_found_too_late_is_no_task_that_runs_for_ever(
    restarted: Restarted, is_closing: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program that waited for it by its old name waited without end, and the file of a flight that was over was
    left.
    """
    if is_closing:
        restarted.flight.prepare_shutdown()
    else:  # by a command in the moment in which it was found
        monkeypatch.setattr(restarted.flight, "adopt", restarted.command_and_adopt)
    restarted.offer.kept = KeptMission((ReturnToLaunch(),), "digest")
    restarted.run(0.2)
    error = restarted.tasks.get("mission-1").future.exception(0.0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == ("shutdown" if is_closing else "set_pose")
    assert (restarted.file.read() is not None) is is_closing


def test_one_that_is_found_after_a_lease_has_begun_is_stopped_for_it(restarted: Restarted) -> None:
    """It was flown on as one of others: the program had been quick to get its lease back."""
    restarted.run(0.2)
    restarted.flight.stop_for_lease("survey has acquired the lease")
    restarted.offer.kept = KeptMission((ReturnToLaunch(),), "digest")
    restarted.run(2 * DOWNLOAD_RETRY_S)
    error = restarted.tasks.get("mission-1").future.exception(0.0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "lease"
    assert restarted.flight.is_stopping_mission
    assert restarted.file.read() is None
