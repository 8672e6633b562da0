"""Many UAVs in one daemon: each by itself, though one process and one thread fly them all."""

from __future__ import annotations

import itertools
import resource
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess, StartDaemon, daemon_environment
from tests.ual_daemon.program.refusal import refused
from ual import discovery
from ual.errors import InvalidArgumentError, LinkLostError
from ual.geometry import Pose, PoseStamped, Vector3
from ual.simulation import LinkLost
from ual.types import State, TaskStatus
from ual_daemon.program import fleet
from ual_daemon.settings import ConfigError, VehicleSettings

# --- Names, places, addresses -----------------------------------------------------------------------------------------


def test_a_fleet_counts_on_from_the_number_of_the_namespace() -> None:
    assert fleet.names("uav_1", 3) == ["uav_1", "uav_2", "uav_3"]
    assert fleet.names("north_19", 2) == ["north_19", "north_20"]
    assert fleet.names("uav", 2) == ["uav_1", "uav_2"]


def test_names_that_no_daemon_could_have_are_refused() -> None:
    with pytest.raises(ConfigError, match="longer than 64"):
        fleet.names("u" * 62, 10)


def test_the_positions_are_rows_of_ten_and_do_not_depend_on_how_many_there_are() -> None:
    few, many = fleet.grid_positions([None] * 12, 3.0), fleet.grid_positions([None] * 200, 3.0)
    assert many[:12] == few
    assert few[0] == Vector3()
    assert few[9] == Vector3(27.0, 0.0, 0.0)
    assert few[11] == Vector3(3.0, 3.0, 0.0)
    assert len(set(many)) == 200


def test_vehicles_with_urls_of_their_own_stand_where_they_stand() -> None:
    assert fleet.urls(None, ["radio://1", "radio://2"]) == ["radio://1", "radio://2"]
    assert fleet.urls(3, []) == [None] * 3
    assert fleet.grid_positions(["radio://1", "radio://2"], 3.0) == [Vector3(), Vector3()]


def test_two_urls_of_one_vehicle_are_refused() -> None:
    with pytest.raises(ConfigError, match="A and a lead to the same vehicle: two UAVs cannot be one vehicle"):
        fleet.urls(None, ["A", "b", "a"], str.lower)
    assert fleet.urls(None, ["A", "a"]) == ["A", "a"]


def test_a_home_pose_is_that_of_the_first() -> None:
    placed = fleet.placed(VehicleSettings(home_pose=(1.0, 2.0, 3.0)), Vector3(6.0, 3.0, 0.0))
    assert placed.home_pose == (7.0, 5.0, 3.0)


def test_each_has_an_address_of_its_own() -> None:
    templates = ["127.0.0.1:{port}", "unix:/run/ual/{ns}.sock", "[::1]:0"]
    assert fleet.addresses(templates, "uav_7") == ["127.0.0.1:50057", "unix:/run/ual/uav_7.sock", "[::1]:0"]


def test_an_address_for_all_is_refused() -> None:
    with pytest.raises(ConfigError, match="needs an address of its own"):
        fleet.addresses(["127.0.0.1:50051"], "uav_7")


def test_ports_that_end_are_reported() -> None:
    assert fleet.addresses(["127.0.0.1:{port}"], "uav_15485") == ["127.0.0.1:65535"]
    with pytest.raises(ConfigError, match="uav_15486 has no port"):
        fleet.addresses(["127.0.0.1:{port}"], "uav_15486")


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """A process that may open some files, and many where it asks."""
    limits = {"soft": 256, "hard": 4096}

    def set_limits(_: int, new: tuple[int, int]) -> None:
        limits["soft"], limits["hard"] = new

    monkeypatch.setattr(resource, "getrlimit", lambda _: (limits["soft"], limits["hard"]))
    monkeypatch.setattr(resource, "setrlimit", set_limits)
    return limits


def test_a_fleet_may_open_more_files(limits: dict[str, int]) -> None:
    fleet.allow_files(1000, 1)
    assert limits == {"soft": 4096, "hard": 4096}


def test_a_small_one_needs_no_more(limits: dict[str, int]) -> None:
    fleet.allow_files(5, 1)
    assert limits == {"soft": 256, "hard": 4096}


def test_files_that_it_may_not_open_are_reported_before_it_flies(limits: dict[str, int]) -> None:
    with pytest.raises(ConfigError, match="5000 UAVs need 10064 open files, and this process may have 4096"):
        fleet.allow_files(5000, 1)
    assert limits["soft"] == 256


# --- The process ------------------------------------------------------------------------------------------------------


@contextmanager
def clients(daemon: DaemonProcess, count: int) -> Iterator[list[ual.Uav]]:
    """A client of each UAV of the fleet, found by its namespace."""
    for number in range(1, count + 1):
        daemon.wait_for("state", ns=f"uav_{number}", new="LANDED_ARMED")
    with ExitStack() as stack:
        yield [stack.enter_context(ual.Uav(f"uav_{number}")) for number in range(1, count + 1)]


def test_each_uav_of_a_fleet_has_its_namespace_address_position_and_state(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--fleet", "12", "--auto-arm", "--set", "light.speed_factor=10")
    with clients(daemon, 12) as uavs:
        registered = discovery.list_daemons()
        assert [each.ns for each in registered] == [f"uav_{number}" for number in range(1, 13)]
        assert len({each.address for each in registered}) == 12
        assert {each.pid for each in registered} == {daemon.pid}
        places = set()
        for number, uav in enumerate(uavs, 1):
            assert uav.info().namespace == f"uav_{number}"
            assert uav.state() is State.LANDED_ARMED
            telemetry = uav.telemetry()
            assert telemetry.pose is not None
            assert telemetry.transform is not None
            assert telemetry.position_geo is not None
            assert telemetry.pose.position == Vector3()  # in its own odom
            place = telemetry.transform.translation  # in the map
            assert tuple(place) == pytest.approx(((number - 1) % 10 * 3.0, (number - 1) // 10 * 3.0, 0.0))
            places.add((telemetry.position_geo.latitude_deg, telemetry.position_geo.longitude_deg))
        assert len(places) == 12  # on Earth, too


def test_one_flies_while_the_others_stay(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--fleet", "5", "--auto-arm", "--set", "light.speed_factor=10")
    with clients(daemon, 5) as uavs:
        uavs[2].take_off(2.0, timeout_s=LIMIT_S)
        going = uavs[2].go_to_waypoint(PoseStamped(Pose.at(1000.0, 0.0, 2.0)), blocking=False)
        uavs[2].simulation.set_speed_factor(0.0)  # it is on its way until the others were looked at
        assert [uav.state() for uav in uavs] == [
            State.FLYING_AUTO if uav is uavs[2] else State.LANDED_ARMED for uav in uavs
        ]
        assert going.info().status is TaskStatus.RUNNING
        with pytest.raises(InvalidArgumentError, match=r"there is no task .*; its daemon may have been restarted"):
            uavs[3].task(going.id).info()
        for uav in uavs:
            if uav is not uavs[2]:
                assert uav.pose().pose.position == Vector3()
        uavs[2].simulation.set_speed_factor(10.0)
        going.cancel()


def test_several_fly_at_once_each_to_its_own_goal(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--fleet", "6", "--auto-arm", "--set", "light.speed_factor=10")
    with clients(daemon, 6) as uavs:
        for task in [uav.take_off(2.0, blocking=False) for uav in uavs]:
            task.wait(LIMIT_S)
        goals = [Vector3(float(number), -1.0, 2.0 + number) for number in range(6)]
        tasks = [uav.go_to_waypoint(Pose.at(*goal), blocking=False) for uav, goal in zip(uavs, goals, strict=True)]
        for task, uav, goal in zip(tasks, uavs, goals, strict=True):
            task.wait(LIMIT_S)
            assert (uav.pose().pose.position - goal).norm() <= 0.5


def test_a_fault_of_one_is_no_fault_of_the_others(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--fleet", "5", "--auto-arm", "--set", "light.speed_factor=10")
    with clients(daemon, 5) as uavs:
        uavs[0].simulation.begin_fault(LinkLost())
        daemon.wait_for("state", ns="uav_1", new="UNINITIALIZED")
        assert [uav.state() for uav in uavs[1:]] == [State.LANDED_ARMED] * 4
        with pytest.raises(LinkLostError):
            uavs[0].take_off(2.0)
        assert all(not uav.simulation.faults() for uav in uavs[1:])
        uavs[0].simulation.end_fault()
        daemon.wait_for("state", ns="uav_1", old="UNINITIALIZED", new="LANDED_ARMED")


def test_unix_sockets_for_all(start_daemon: StartDaemon, tmp_path: Path) -> None:
    daemon = start_daemon("--fleet", "3", listen=f"unix:{tmp_path}/{{ns}}.sock", ns="spot")
    daemon.wait_for("state", ns="spot_3")
    assert discovery.find("spot_2") == f"unix:{tmp_path}/spot_2.sock"
    with ual.Uav(address=f"unix:{tmp_path}/spot_2.sock") as uav:
        assert uav.info().namespace == "spot_2"


def test_an_idle_uav_tells_what_is_and_streams_each_update(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--fleet", "2", "--auto-arm", "--set", "light.speed_factor=10")
    with clients(daemon, 2) as uavs:
        first, later = uavs[0].telemetry(), uavs[0].telemetry()
        while later.sequence == first.sequence:
            later = uavs[0].telemetry()
        assert later.stamp_s > first.stamp_s
        stream = uavs[1]._connection.stream_telemetry(0.0).read()
        told = [next(stream) for _ in range(5)]
        counted = [(sample.telemetry.sequence, sample.missed_count) for sample in told]
        for (before, _), (after, missed) in itertools.pairwise(counted):
            assert after - before == 1 + missed


def test_the_fleet_ends_by_one_signal_after_all_are_safe(start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--fleet", "8", "--auto-arm", "--set", "light.speed_factor=10")
    with clients(daemon, 8) as uavs:
        for task in [uav.take_off(2.0, blocking=False) for uav in uavs[:4]]:
            task.wait(LIMIT_S)
        daemon.signal(signal.SIGTERM)
        assert daemon.wait() == 0
    held = [event["ns"] for event in daemon.events if event.get("event") == "hold_by_autopilot"]
    assert sorted(held) == ["uav_1", "uav_2", "uav_3", "uav_4"]
    assert daemon.events[-1]["event"] == "ended"
    assert not discovery.list_daemons()


def test_a_namespace_of_the_fleet_flies_once_on_a_computer(start_daemon: StartDaemon) -> None:
    first = start_daemon("--fleet", "4")
    first.wait_for("state", ns="uav_4")
    address = discovery.find("uav_3")
    second = start_daemon(ns="uav_3")
    assert second.wait() == 1
    assert f"uav_3 is already flown by pid {first.pid} at {address}" in second.stderr
    other = start_daemon("--fleet", "3", ns="uav_4")
    assert other.wait() == 1
    assert "uav_4 is already flown by" in other.stderr
    third = start_daemon("--fleet", "2", ns="uav_5")  # what the refused one had taken is free again
    third.wait_for("state", ns="uav_6")


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        (
            ["--backend", "mavlink", "--fleet", "3"],
            "ual-daemon: --fleet: a fleet of autopilots needs a --fleet-url for each",
        ),
        (["--fleet", "0"], "ual-daemon: --fleet: expected a whole number of at least 1"),
        (
            ["--fleet", "2", "--url", "sim"],
            "ual-daemon: --url: a fleet needs a URL for each vehicle: give --fleet-url for each",
        ),
        (["--url", "sim"], "ual-daemon: --url: sim: a light UAV is simulated: it has no autopilot to connect to"),
        (
            ["--fleet-url", "a", "--fleet-url", "b"],
            "ual-daemon: --fleet-url: a: a light UAV is simulated: it has no autopilot to connect to",
        ),
        (
            ["--fleet-url", "a", "--fleet-url", "a"],
            "ual-daemon: --fleet-url: a is given twice: two UAVs cannot be one vehicle",
        ),
        (
            ["--backend", "crazyflie", "--fleet-url", "udp://localhost:19850", "--fleet-url", "udp://127.0.0.1:19850/"],
            "ual-daemon: --fleet-url: udp://localhost:19850 and udp://127.0.0.1:19850/ lead to the same vehicle",
        ),
        (
            ["--backend", "mavlink", "--fleet-url", "udp://:14550?system_id=2,3", "--fleet-url", "udp://:14550"],
            "ual-daemon: --fleet-url: udp://:14550: other vehicles are on this link, so say which",
        ),
        (
            ["--backend", "mavlink", "--fleet-url", "udp://:14550?system_id=2,2"],
            "ual-daemon: --fleet-url: udp://:14550?system_id=2 is given twice: two UAVs cannot be one vehicle",
        ),
        (
            ["--backend", "mavlink", "--fleet-url", "udp://:14550?system_id=all"],
            "ual-daemon: --fleet-url: 'udp://:14550?system_id=all' cannot be used: its system ids are not numbers",
        ),
        (["--fleet", "3", "--fleet-url", "a"], "ual-daemon: --fleet: 3 UAVs, but 1 --fleet-url: leave out --fleet"),
        (
            ["--fleet", "2", "--listen", "127.0.0.1:50051"],
            "ual-daemon: --listen: 127.0.0.1:50051: each UAV of a fleet needs an address of its own",
        ),
        (["--fleet", "2", "--listen", "0.0.0.0:{port}"], "ual-daemon: --listen: 0.0.0.0:50051 can be reached"),
        (["--fleet", "20000"], "ual-daemon: --fleet: uav_15486 has no port"),
    ],
)
def test_what_a_fleet_cannot_be_is_reported_in_one_message(flags: list[str], expected: str, tmp_path: Path) -> None:
    assert refused(tuple(flags), daemon_environment(tmp_path)).startswith(expected)
