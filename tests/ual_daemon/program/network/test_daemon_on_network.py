"""A real daemon on the network: found, flown, lost and found again; and nothing from there reaches its flight."""

from __future__ import annotations

import random
import signal
from pathlib import Path

import pytest

import ual
from tests.conftest import StartDaemon
from tests.ual.network.zenoh_net import ZenohNet
from tests.waiting import LIMIT_S, until, until_state
from ual.network import Network
from ual.network.session import open_session
from ual.types import State

pytest.importorskip("zenoh", reason="ZENOH IS MISSING, the network is NOT TESTED: pip install 'ual-daemon[network]'")

FUZZED_COUNT = 2_000  # benchmarks/network sends 10^5


@pytest.fixture
def config(tmp_path: Path, net: ZenohNet) -> str:
    file = tmp_path / "network.yaml"
    file.write_text(f"site: {net.site}\nconnect: [{net.endpoint}]\nrate_hz: 20\n")
    return str(file)


def present(network: Network) -> list[str]:
    return [each.ns for each in network.uavs() if each.gone_s is None]


def test_a_uav_is_executed_by_its_name(net: ZenohNet, config: str, start_daemon: StartDaemon) -> None:
    net.router()
    daemon = start_daemon("--auto-arm", "--set", "light.speed_factor=10", "--network", config, ns="uav_7")
    network = net.network()
    until(lambda: present(network) == ["uav_7"])
    found = network.find("uav_7")
    assert found.addresses == (daemon.address,)
    assert (found.publisher, found.report.backend, found.report.needed_role) == ("uav_7", "light", "pilot")
    with ual.Uav("uav_7", network=network) as uav:
        assert uav.address == daemon.address
        until_state(uav, State.LANDED_ARMED)
        uav.take_off(3.0)
    until(lambda: network.find("uav_7").telemetry.state is State.FLYING_AUTO)
    place = network.find("uav_7").telemetry.transform
    assert place is not None
    assert place.translation.z == pytest.approx(3.0, abs=0.2)


def test_a_daemon_that_is_killed_or_stopped_is_gone_and_comes_back(
    net: ZenohNet, config: str, start_daemon: StartDaemon
) -> None:
    net.router()
    network = net.network()
    daemon = start_daemon("--network", config)
    until(lambda: present(network) == ["uav_1"])
    with daemon.frozen():
        until(lambda: present(network) == [])
    until(lambda: present(network) == ["uav_1"])
    daemon.process.kill()
    until(lambda: network.find("uav_1").gone_s is not None)


def test_a_daemon_ends_its_presence_by_itself(net: ZenohNet, config: str, start_daemon: StartDaemon) -> None:
    net.router()
    network = net.network()
    daemon = start_daemon("--network", config)
    until(lambda: present(network) == ["uav_1"])
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0
    until(lambda: present(network) == [])


def test_a_router_that_comes_later_is_joined(net: ZenohNet, config: str, start_daemon: StartDaemon) -> None:
    daemon = start_daemon("--network", config)
    lost = daemon.wait_for("network_lost")
    assert lost["site"] == net.site
    assert net.endpoint in str(lost["why"])
    with ual.Uav(address=daemon.address) as uav:
        until(lambda: uav.state() is State.LANDED_DISARMED)  # it serves meanwhile
    net.router()
    joined = daemon.wait_for("network_joined")
    assert joined["publisher"] == "uav_1"
    until(lambda: present(net.network()) == ["uav_1"])


def test_the_processes_of_a_fleet_learn_of_one_by_one(net: ZenohNet, config: str, start_daemon: StartDaemon) -> None:
    net.router()
    network = net.network()
    start_daemon("--fleet", "4", "--workers", "2", "--network", config, ns="uav_1")
    until(lambda: present(network) == ["uav_1", "uav_2", "uav_3", "uav_4"], seen=lambda: present(network))
    assert {each.publisher for each in network.uavs()} == {"uav_1-4"}
    assert len({each.instance for each in network.uavs()}) == 2
    assert network.problems == {}


def test_nothing_that_is_sent_over_the_network_reaches_a_flight(
    net: ZenohNet, config: str, start_daemon: StartDaemon
) -> None:
    """Puts, deletions, queries and tokens under the daemon's own keys, with bytes of its own reports and others."""
    net.router()
    daemon = start_daemon("--auto-arm", "--set", "light.speed_factor=10", "--network", config)
    network = net.network()
    with ual.Uav(address=daemon.address) as uav:
        until_state(uav, State.LANDED_ARMED)
        uav.take_off(3.0)
        until(lambda: present(network) == ["uav_1"])
        before, count_before = uav.telemetry(), len(daemon.events)
        _fuzz(net, network.find("uav_1").instance)
        after = uav.telemetry()
        assert (after.state, after.task, after.reference_pose) == (State.FLYING_AUTO, None, before.reference_pose)
        uav.land()
    assert [each["event"] for each in daemon.events[count_before:] if each["level"] in ("WARNING", "ERROR")] == []


def _fuzz(net: ZenohNet, instance: str) -> None:
    drawn = random.Random(1)
    own = f"ual/{net.site}/uav_1/{instance}"
    keys = [f"{own}/telemetry", f"{own}/alive", f"{own}/command", "ual/**", f"ual/{net.site}/uav_1/take_off", "@/**"]
    session = open_session(net.settings, LIMIT_S)
    try:
        for number in range(FUZZED_COUNT):
            key = drawn.choice(keys)
            data = drawn.randbytes(drawn.randrange(300))
            kind = number % 4
            if kind == 0:
                session.get(key, lambda _: None, payload=data, timeout=0.1)
            elif kind == 1:
                session.delete(key)
            else:
                session.put(key, data)
    finally:
        session.close()  # type: ignore[no-untyped-call]
