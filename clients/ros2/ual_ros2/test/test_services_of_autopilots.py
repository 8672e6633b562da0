"""Data kept by an autopilot, over ROS: missions, the fence, logs.

The autopilot is one of UAL's own tests, so this needs a checkout.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import Processes
from flying import CANCELED, LIMIT_S, Client, waited
from inexpressible import INEXPRESSIBLE, InexpressibleError
from ros_uav import RosUav
from test_autopilots import ROOT, simulated
from ual_msgs import action, msg, srv

import ual
import ual.missions
from ual import conformance
from ual.conformance import Check, Flight, Tolerances, own_corrections, own_fence, own_logs, own_missions

UAL = "/uav_1/ual"
LOG = "001.bin"
TOLERANCES = Tolerances(
    position_m=0.5, wander_m=0.0, heading_rad=0.2, speed_m_s=0.5, line_ratio=0.1, overshoot_ratio=0.1, patience=6.0
)
CHECKS = (
    *own_fence.ON_GROUND,
    *own_missions.ON_GROUND,
    *own_logs.ON_GROUND,
    *own_corrections.ON_GROUND,
    *own_fence.IN_FLIGHT,
    *own_missions.IN_FLIGHT,
)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("logs")


@pytest.fixture(scope="module")
def world(processes: Processes, logs: Path) -> Iterator[ual.Uav]:
    with simulated("px4", "--log", LOG) as port:
        processes.daemon("--url", f"udpout://127.0.0.1:{port}", "--allow-arming", backend="mavlink")
        processes.node("ns:=uav_1", "rate_hz:=100.0", "slow_rate_hz:=20.0", f"log_directory:={logs}")
        with ual.Uav("uav_1") as world:
            world.wait_for(ual.State.LANDED_ARMED, ual.State.LANDED_DISARMED, timeout_s=LIMIT_S)
            waited(lambda: is_placed(world) and bool(world.info().autopilot_version))
            yield world


@pytest.fixture(scope="module")
def flight(client: Client, world: ual.Uav) -> Flight:
    uav = RosUav(client, world.ns, lambda: world.telemetry().stamp_s, is_simulated=False)
    return Flight(uav, TOLERANCES)


def is_placed(world: ual.Uav) -> bool:
    here = world.telemetry().position_geo
    return here is not None and None not in (here.altitude_ellipsoid_m, here.altitude_amsl_m)


def named(check: Check) -> str:
    return check.name


@pytest.mark.parametrize("check", CHECKS, ids=named)
def test_conformance(flight: Flight, check: Check) -> None:
    listed = INEXPRESSIBLE.get(check.name)
    if listed is None:
        conformance.run_check(flight, check)
        return
    with pytest.raises(InexpressibleError, match=listed.says):
        conformance.run_check(flight, check)


@pytest.mark.usefixtures("flight")
def test_no_simulation_is_available(client: Client) -> None:
    offered = [name for name, _ in client.node.get_service_names_and_types()]
    assert f"{UAL}/list_logs" in offered
    assert not [name for name in offered if "simulation" in name]


@pytest.mark.usefixtures("world")
def test_a_cancelled_mission_leaves_the_uav_holding(client: Client, flight: Flight, world: ual.Uav) -> None:
    with flight.observing():
        flight.bring_to((ual.State.FLYING_AUTO,))
    here = world.telemetry().position_geo
    assert here is not None
    place = msg.GeoPoint(latitude=here.latitude_deg + 0.001, longitude=here.longitude_deg)
    item = msg.MissionItem(kind="WAYPOINT", place=place, altitude=10.0)
    assert client.call(srv.UploadMission, f"{UAL}/upload_mission", items=[item]).success
    told: list[action.FlyMission.Feedback] = []
    goal = client.begin(action.FlyMission, f"{UAL}/fly_mission", told.append)
    waited(lambda: [each for each in told if each.mission.item == 1])
    assert client.cancel(goal)
    status, result = client.end_of(goal)
    assert (status, result.reason) == (CANCELED, "TASK_ABORTED")
    world.wait_for(ual.State.FLYING_AUTO, timeout_s=LIMIT_S)
    waited(lambda: world.telemetry().task is None and world.velocity().twist.linear.norm() < 0.3)
    started = client.call(srv.FlyMission, f"{UAL}/fly_mission", first_item=1, on_link_loss="never")
    assert (started.reason, "CONTINUE" in started.message) == ("INVALID_ARGUMENT", True)
    assert client.call(srv.FlyMission, f"{UAL}/fly_mission").success
    assert world.telemetry().task is not None
    assert client.call(srv.Abort, f"{UAL}/abort").success


def test_a_log_is_written_where_the_node_may_write_and_nowhere_else(client: Client, logs: Path) -> None:
    [listed] = client.call(srv.ListLogs, f"{UAL}/list_logs").logs
    told: list[action.DownloadLog.Feedback] = []
    goal = client.begin(action.DownloadLog, f"{UAL}/download_log", told.append, log_id=listed.log_id)
    result = client.end_of(goal)[1]
    assert result.success, result.message
    assert Path(result.file).parent == logs
    assert Path(result.file).stat().st_size == listed.size
    assert [each.name for each in logs.iterdir()] == [Path(result.file).name]
    for wrong in ("../../etc/passwd", "", "/etc/passwd"):
        refused = client.fly(action.DownloadLog, f"{UAL}/download_log", log_id=wrong)[1]
        assert (refused.success, refused.reason) == (False, "INVALID_ARGUMENT")


def test_a_mission_of_a_file_is_planned_uploaded_and_reported(client: Client, world: ual.Uav) -> None:
    text = (ROOT / "tests" / "data" / "routes" / "wpl.waypoints").read_text()
    refused = client.call(srv.UploadMission, f"{UAL}/upload_mission", file="no mission")
    assert (refused.success, refused.reason, refused.metadata[0].value) == (False, "INVALID_ARGUMENT", "file")
    both = client.call(srv.PlanMission, f"{UAL}/plan_mission", file=text, items=[msg.MissionItem(kind="LAND")])
    assert "not both" in both.message
    uploaded = client.call(srv.UploadMission, f"{UAL}/upload_mission", file=text)
    with pytest.raises(ual.UalError) as same:
        world.mission.upload(ual.missions.parse(text.encode(), "file").items)
    assert (uploaded.reason, uploaded.message) == (same.value.reason, same.value.message)
