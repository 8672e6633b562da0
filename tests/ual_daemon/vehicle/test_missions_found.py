"""How a restarted daemon looks for the mission that it flew before."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.ual_daemon.stepped import STEP_S, stepped
from ual.errors import UalTimeoutError
from ual_daemon.backends import futures
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission
from ual_daemon.flight.flight import Flight
from ual_daemon.settings import LimitSettings, VehicleSettings
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.vehicle.mission_file import FlownMission, MissionFile
from ual_daemon.vehicle.missions import AGAIN_S, Missions


class Unread:
    """The missions of an autopilot that refuses to send them."""

    mode = "GUIDED"

    def __init__(self) -> None:
        self.asked_count = 0

    def download(self) -> Future[KeptMission]:
        self.asked_count += 1
        return futures.failed(UalTimeoutError("busy with another station"))


def test_a_mission_that_cannot_be_read_is_asked_for_once_in_a_while(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Else each update would ask, and take the link from the flight and from other stations."""
    with stepped() as uav:
        uav.fly()
        vehicle, offer = uav.vehicle, Unread()
        backend, info, offered = vehicle.backend, vehicle.backend.info(), vehicle.backend.offer

        def offers(kind: type[Any]) -> Any:
            return offer if kind is AutopilotMissions else offered(kind)

        monkeypatch.setattr(backend, "offer", offers)
        monkeypatch.setattr(backend, "info", lambda: replace(info, identity="it"))
        file = MissionFile(tmp_path / "uav_1.mission")
        file.write(FlownMission("it", "digest", "mission-1"))
        restarted = Flight(backend, CurrentLimits(backend, LimitSettings()), vehicle._flight.geofence)
        missions = Missions(backend, restarted, vehicle._resolver, vehicle._tasks, VehicleSettings(), file)
        for _ in range(round(3.5 * AGAIN_S / STEP_S)):
            uav.run(STEP_S)
            missions.update(backend.snapshot())
        assert offer.asked_count == 4
