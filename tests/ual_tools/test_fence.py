"""`ual fence`, the clients and the service, with a real daemon and a simulated PX4: the roles, and the results."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import ual
from tests.conftest import DaemonProcess, StartDaemon
from tests.simulators import flying
from tests.simulators.mission_store import FENCE
from tests.ual_daemon.backends.mavlink.test_autopilot_daemons import Vehicle, vehicle_of
from tests.waiting import until, until_state
from ual.errors import InvalidArgumentError, LeaseHeldError, NotSupportedError, PermissionDeniedError, WrongStateError
from ual.fences import FencePlan, FenceZone, KeptFence
from ual.types import State
from ual_tools.main import cli


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    vehicle = vehicle_of("px4")
    vehicle.autopilot.parameters["GF_ACTION"] = 0
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


def zone(vehicle: Vehicle, half_m: float = 30.0) -> FenceZone:
    corners = ((-half_m, -half_m), (half_m, -half_m), (half_m, half_m), (-half_m, half_m))
    places = (vehicle.autopilot.geo((*each, 0.0)) for each in corners)
    return FenceZone(True, tuple((latitude / 1e7, longitude / 1e7) for latitude, longitude, _ in places))


def plan_file(tmp_path: Path, vehicle: Vehicle, half_m: float = 30.0) -> Path:
    polygon = {"inclusion": True, "polygon": [list(each) for each in zone(vehicle, half_m).points], "version": 1}
    file = tmp_path / "field.plan"
    file.write_text(json.dumps({"fileType": "Plan", "geoFence": {"polygons": [polygon], "circles": []}}))
    return file


def run(daemon: DaemonProcess, *words: str | Path) -> Result:
    return CliRunner().invoke(cli, ["--address", daemon.address, *map(str, words)])


def done(daemon: DaemonProcess, *words: str | Path) -> str:
    result = run(daemon, *words)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_a_fence_of_mission_planner_is_uploaded_and_what_it_is_not_is_named(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    corners = zone(vehicle).points
    back = [(corners[0][0] + corners[2][0]) / 2.0, (corners[0][1] + corners[2][1]) / 2.0]
    file = tmp_path / "field.fen"
    file.write_text("".join(f"{latitude:.7f} {longitude:.7f}\n" for latitude, longitude in (back, *corners)), "utf-16")
    result = run(daemon, "fence", "upload", file)
    assert (result.exit_code, result.stderr) == (0, "left out: line 1: the point to return to\n")
    assert "inclusion polygon of 4 corners" in result.stdout
    file.write_text(file.read_text("utf-16").replace(" ", ", ", 1))
    refused = run(daemon, "fence", "upload", file)
    assert (refused.exit_code, f"{file}: line 1: " in refused.output) == (1, True)


def test_the_command_shows_uploads_replaces_switches_and_clears(
    daemon: DaemonProcess, vehicle: Vehicle, tmp_path: Path
) -> None:
    assert done(daemon, "fence", "show") == "the autopilot has no fence of zones\n"
    uploaded = done(daemon, "fence", "upload", plan_file(tmp_path, vehicle))
    assert "inclusion polygon of 4 corners" in uploaded
    assert uploaded.endswith("the autopilot has 1 zone, and it applies its fence\n")
    assert vehicle.autopilot.parameters["GF_ACTION"] == 2
    other = run(daemon, "fence", "upload", plan_file(tmp_path, vehicle, 40.0))
    assert (other.exit_code, "replace it, if that is meant" in other.output) == (1, True)
    assert "it applies its fence" in done(daemon, "fence", "upload", tmp_path / "field.plan", "--replace")
    shown = json.loads(done(daemon, "--json", "fence", "show"))
    assert shown["zones"][0]["points"] == [list(each) for each in zone(vehicle, 40.0).points]
    assert done(daemon, "fence", "disable").endswith("it does not apply its fence\n")
    assert done(daemon, "fence", "enable").endswith("it applies its fence\n")
    assert done(daemon, "fence", "clear") == "the autopilot has no fence of zones\n"
    assert vehicle.autopilot.missions.lists[FENCE] == []
    unset = run(daemon, "fence", "upload")
    assert (unset.exit_code, "has no polygon" in unset.output) == (1, True)


def test_both_clients_have_the_same_values_and_errors(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    plan = FencePlan((zone(vehicle),))

    async def ask() -> tuple[KeptFence, KeptFence]:
        async with ual.aio.Uav(address=daemon.address) as uav:
            with pytest.raises(InvalidArgumentError, match="from 3 to 255 corners"):
                await uav.fence.upload(FencePlan((FenceZone(True, ((47.0, 8.0),)),)))
            return await uav.fence.upload(plan, enable=False), await uav.fence.get()

    uploaded, read = asyncio.run(ask())
    assert uploaded == read == KeptFence(plan.zones, (), is_enabled=False)
    with ual.Uav(address=daemon.address) as uav:
        assert uav.fence.get() == read


def test_a_lease_and_a_flight_keep_others_from_uploading(daemon: DaemonProcess, vehicle: Vehicle) -> None:
    plan = FencePlan((zone(vehicle),))
    with ual.Uav(address=daemon.address) as holder, ual.Uav(address=daemon.address) as other:
        with holder.lease("holder"):
            with pytest.raises(LeaseHeldError):
                other.fence.upload(plan)
            assert other.fence.get().zones == ()
            assert holder.fence.upload(plan).zones == plan.zones
        assert vehicle.autopilot.pilot_arm()
        until_state(other, State.LANDED_ARMED)
        with pytest.raises(WrongStateError, match="the UAV is armed"):
            other.fence.clear()
        assert other.fence.clear(force=True).zones == ()


def test_a_daemon_that_only_watches_reads_and_does_not_upload(vehicle: Vehicle, start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--url", vehicle.url, "--watch-only", backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        stand(uav)
        assert uav.fence.get().is_enabled is False
        with pytest.raises(PermissionDeniedError):
            uav.fence.upload(FencePlan((zone(vehicle),)))


def test_a_backend_without_it_says_so(start_daemon: StartDaemon) -> None:
    daemon = start_daemon()
    with ual.Uav(address=daemon.address) as uav, pytest.raises(NotSupportedError, match="does not offer them"):
        uav.fence.get()
    assert run(daemon, "fence", "show").exit_code == 1
