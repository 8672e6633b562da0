"""`ual mission`, the clients and the service, with a real daemon and a simulated PX4 that flies missions by itself."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon
from tests.simulators import flying
from tests.ual_daemon.backends.mavlink.test_autopilot_daemons import Vehicle, vehicle_of
from tests.waiting import until, until_state
from ual.errors import InvalidArgumentError, LeaseHeldError, NotSupportedError, PermissionDeniedError, WrongStateError
from ual.missions import Item, Land, MissionStage, StoredMission, TakeOff, Waypoint
from ual.types import AltitudeReference, State, TaskKind, TaskStatus
from ual_tools.main import cli


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    vehicle = vehicle_of("px4", of_loss_s=LIMIT_S)
    with flying(vehicle.autopilot):
        yield vehicle


@pytest.fixture
def daemon(vehicle: Vehicle, start_daemon: StartDaemon) -> DaemonProcess:
    daemon = start_daemon("--url", vehicle.url, backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        stand(uav)
    return daemon


def stand(uav: ual.Uav) -> None:
    until_state(uav, State.LANDED_DISARMED)
    until(lambda: uav.telemetry().position_geo is not None, "its place on Earth")
    until(lambda: uav.info().autopilot_version != "", "its version")


def current_position(vehicle: Vehicle, north_m: float, east_m: float) -> tuple[float, float]:
    latitude, longitude, _ = vehicle.autopilot.geo((north_m, east_m, 0.0))
    return latitude / 1e7, longitude / 1e7


def far(vehicle: Vehicle) -> list[Item]:
    """A mission that takes longer than a test."""
    here = current_position(vehicle, 0.0, 0.0)
    way = Waypoint(*current_position(vehicle, 60.0, 0.0), 3.0)
    return [TakeOff(3.0, AltitudeReference.HOME, *here), way, Land(*here)]


def written(tmp_path: Path, items: list[Item]) -> Path:
    """A plan in QGroundControl's form, of a take-off, waypoints and a landing."""
    numbers = {TakeOff: 22, Waypoint: 16, Land: 21}
    rows = [
        {
            "type": "SimpleItem",
            "autoContinue": True,
            "command": numbers[type(each)],
            "doJumpId": index,
            "frame": 3,
            "params": [0, 0, 0, None, *_coordinates(each)],
        }
        for index, each in enumerate(items, 1)
    ]
    mission = {
        "version": 2,
        "firmwareType": 12,
        "vehicleType": 2,
        "items": rows,
        "plannedHomePosition": [47.0, 8.0, 0.0],
    }
    file = tmp_path / "survey.plan"
    file.write_text(
        json.dumps({"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "mission": mission})
    )
    return file


def _coordinates(item: Item) -> list[float]:
    if isinstance(item, TakeOff):
        return [0.0, 0.0, item.altitude_m]
    assert isinstance(item, Waypoint | Land)
    return [item.latitude_deg, item.longitude_deg, getattr(item, "altitude_m", 0.0)]


def run(daemon: DaemonProcess, *words: str | Path) -> Result:
    return CliRunner().invoke(cli, ["--address", daemon.address, *map(str, words)])


def done(daemon: DaemonProcess, *words: str | Path) -> str:
    result = run(daemon, *words)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_command_uploads_flies_pauses_jumps_and_ends(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    file = written(tmp_path, far(vehicle))
    assert done(daemon, "mission", "download") == "the autopilot has no mission\n"
    assert "3 items, from 3.0 to 3.0 m" in done(daemon, "mission", "plan", file)
    assert done(daemon, "mission", "upload", file) == "3 items are on the autopilot, and were read back\n"
    rows = [json.loads(line) for line in done(daemon, "--json", "mission", "download").splitlines()]
    assert [row["altitude_m"] for row in rows[:2]] == [3.0, 3.0]
    unarmed = run(daemon, "mission", "start")
    assert (unarmed.exit_code, "LANDED_DISARMED" in unarmed.output) == (1, True)
    with ual.Uav(address=daemon.address) as uav:
        assert vehicle.autopilot.pilot_arm()
        until_state(uav, State.LANDED_ARMED)
        done(daemon, "mission", "start")
        until(lambda: uav.mission.progress().item == 2, "the way to the waypoint")
        until(lambda: "flies our mission: item 2 of 3" in uav.telemetry().state_reason, "its words")
        assert ", task " in done(daemon, "mission", "status")
        assert run(daemon, "mission", "upload", file).exit_code == 1  # not while it is flown
        done(daemon, "mission", "pause")
        until(lambda: "holds on our mission" in uav.telemetry().state_reason, "the pause")
        done(daemon, "mission", "resume")
        until(lambda: "flies our mission" in uav.telemetry().state_reason, "the rest of it")
        until(lambda: run(daemon, "mission", "jump", "3").exit_code == 0, "the mode of missions")
        until(lambda: uav.mission.progress().item == 3, "the landing")
        task = uav.telemetry().task
        assert task is not None
        assert task.kind is TaskKind.MISSION
        assert uav.task(task.id).wait(LIMIT_S).status is TaskStatus.SUCCEEDED
        until_state(uav, State.LANDED_DISARMED)
    assert done(daemon, "mission", "clear") == "the autopilot has no mission\n"


def test_both_clients_have_the_same_values_and_errors(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    items = far(vehicle)

    async def ask() -> tuple[StoredMission, StoredMission]:
        async with ual.aio.Uav(address=daemon.address) as uav:
            with pytest.raises(InvalidArgumentError, match="the mission has none"):
                await uav.mission.upload([])
            uploaded = await uav.mission.upload(items)
            async for each in uav.mission.watch():
                if each.stage is MissionStage.NOT_STARTED:
                    break
            return uploaded, await uav.mission.download()

    uploaded, read = asyncio.run(ask())
    assert uploaded == read
    assert list(read.items) == items
    with ual.Uav(address=daemon.address) as uav:
        assert uav.mission.download() == read
        assert uav.mission.progress().task_id == ""
        watched = uav.mission.watch()
        assert next(watched).stage is MissionStage.NOT_STARTED
        uav.mission.clear()
        assert next(watched).stage is MissionStage.NONE


def test_a_lease_keeps_others_from_changing_it(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    with ual.Uav(address=daemon.address) as holder, ual.Uav(address=daemon.address) as other, holder.lease("holder"):
        with pytest.raises(LeaseHeldError):
            other.mission.upload(far(vehicle))
        assert other.mission.download().items == ()
        holder.mission.upload(far(vehicle))
        with pytest.raises(LeaseHeldError):
            other.mission.clear()
        with pytest.raises(LeaseHeldError):
            other.mission.start()


def test_a_daemon_that_only_watches_reads_and_does_not_upload(vehicle: Vehicle, start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--url", vehicle.url, "--watch-only", backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        stand(uav)
        assert uav.mission.download().items == ()
        with pytest.raises(PermissionDeniedError):
            uav.mission.upload(far(vehicle))


def test_what_was_not_uploaded_here_is_not_started(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    aside = [TakeOff(3.0, AltitudeReference.HOME, *current_position(vehicle, 20.0, 0.0)), *far(vehicle)[1:]]
    with ual.Uav(address=daemon.address) as uav:
        assert vehicle.autopilot.pilot_arm()
        until_state(uav, State.LANDED_ARMED)
        with pytest.raises(WrongStateError, match="has no mission"):
            uav.mission.start()
        uav.mission.upload(aside)
        with pytest.raises(WrongStateError, match="its take-off leads 20 m aside"):
            uav.mission.start()
        assert uav.state() is State.LANDED_ARMED


def test_a_backend_without_it_says_so(start_daemon: StartDaemon) -> None:
    daemon = start_daemon()
    with ual.Uav(address=daemon.address) as uav, pytest.raises(NotSupportedError, match="does not offer them"):
        uav.mission.download()
    assert run(daemon, "mission", "download").exit_code == 1
