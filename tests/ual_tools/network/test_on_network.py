"""`ual --network`: lists, watches and names the UAVs of the network, and keeps a gateway's list."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from tests.ual.network.samples import report, source, uav
from tests.ual.network.zenoh_net import ZenohNet
from tests.waiting import until
from ual.network.publishing import Publication
from ual.network.roster import Roster
from ual.network.values import Report
from ual.types import State
from ual_tools.main import cli
from ual_tools.network import listing
from ual_tools.network.feed import Feed
from ual_tools.network.gateway import Upstreams
from ual_tools.network.joined import label
from ual_tools.watch_board import Board

pytest.importorskip("zenoh", reason="ZENOH IS MISSING, the network is NOT TESTED: pip install 'ual-tools[network]'")


@pytest.fixture(autouse=True)
def nothing_from_outside(monkeypatch: pytest.MonkeyPatch, runtime_dir: Path) -> None:
    del runtime_dir
    for name in ("UAL_NS", "UAL_ADDRESS", "UAL_TLS_CA", "UAL_NETWORK"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def config(tmp_path: Path, net: ZenohNet) -> str:
    file = tmp_path / "network.yaml"
    file.write_text(f"site: {net.site}\nconnect: [{net.endpoint}]\n")
    net.router()
    return str(file)


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, list(words))


def rows(config: str, told: list[tuple[Publication, Report]]) -> list[dict[str, Any]]:
    """Returns the rows of `ual list` once all have reported."""

    def listed() -> list[dict[str, Any]]:
        for publication, once in told:
            publication.put(once)
        result = run("--json", "--network-config", config, "list")
        assert result.exit_code == 0, result.output
        return [json.loads(line) for line in result.stdout.splitlines()]

    found: list[dict[str, Any]] = []

    def are_all_there() -> bool:
        found[:] = listed()
        return len(found) == len(told)

    until(are_all_there, seen=lambda: found)
    return found


class Telling:
    """Tells again and again on a thread, as daemons do."""

    def __init__(self, stack: ExitStack, told: list[tuple[Publication, Report]]) -> None:
        self._told = told
        self._end = threading.Event()
        thread = threading.Thread(target=self._run, daemon=True)
        thread.start()
        stack.callback(thread.join)
        stack.callback(self._end.set)

    def _run(self) -> None:
        while not self._end.wait(0.02):
            for publication, once in self._told:
                publication.put(once)


@pytest.fixture
def telling() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def test_list_shows_what_uavs_tell_and_where_they_are(net: ZenohNet, config: str, telling: ExitStack) -> None:
    told = [(net.publication("uav_1", 1), report(host="field-1")), (net.publication("uav_2", 2), report(uav("uav_2")))]
    Telling(telling, told)
    found = rows(config, told)
    assert [(each["ns"], each["state"], each["host"], each["addresses"]) for each in found] == [
        ("uav_1", "FLYING_AUTO", "field-1", ["10.0.0.1:50051"]),
        ("uav_2", "FLYING_AUTO", "a", ["10.0.0.1:50051"]),
    ]
    assert {each["is_present"] for each in found} == {True}
    assert {each["needed_role"] for each in found} == {"pilot"}


def test_what_is_there_and_not_observed_is_a_result(net: ZenohNet, config: str, telling: ExitStack) -> None:
    """A list without a word of it would pass for all UAVs."""
    Telling(telling, [(net.publication("uav_1", 1), report())])
    net.publication("uav_2", 2)
    until(lambda: "uav_1" in run("--network-config", config, "list").stdout)
    result = run("--json", "--network-config", config, "list")
    assert result.exit_code == 1
    first, last = (json.loads(line) for line in result.stdout.splitlines())
    assert (first["ns"], last["error"]["reason"]) == ("uav_1", "DAEMON_UNREACHABLE")
    why = "not all UAVs of the network are seen: uav_2 shows a sign of life, and has not told of all its UAVs"
    assert last["error"]["message"] == why
    assert why in result.stderr
    every = run("--network-config", config, "--all", "state")  # what asks them, or flies them, says it, too
    assert "ual: network: not all UAVs are seen: uav_2 shows a sign of life" in every.stderr


def test_a_flood_of_signs_of_life_hides_nobody_and_every_end_comes(net: ZenohNet, telling: ExitStack) -> None:
    net.router()
    Telling(telling, [(net.publication(), report())])
    network = net.network()
    flooding = net.publication("uav_2", 2)
    for number in range(1500):
        telling.callback(
            flooding._session.liveliness().declare_token(source("uav_2", number, net.site).alive).undeclare
        )
    until(lambda: any("uav_2 shows more than 8 signs of life" in why for why in network.problems))
    until(lambda: [uav.ns for uav in network.uavs() if uav.gone_s is None] == ["uav_1"])
    network.close()
    later = net.network()
    until(lambda: [uav.ns for uav in later.uavs()] == ["uav_1"])


def test_a_uav_that_listens_only_on_its_own_computer_is_not_executed(
    net: ZenohNet, config: str, telling: ExitStack
) -> None:
    there = report(uav(address="127.0.0.1:50051"), host="field-1")
    Telling(telling, [(net.publication(), there)])
    until(lambda: "uav_1" in run("--network-config", config, "list").stdout)
    result = run("--network-config", config, "--ns", "uav_1", "takeoff", "3")
    assert result.exit_code == 1
    assert "uav_1 can be reached only on its own computer, field-1" in result.stderr


def test_a_name_that_is_not_there_is_reported(net: ZenohNet, config: str) -> None:
    result = run("--network-config", config, "--ns", "uav_9", "land")
    assert result.exit_code == 1
    assert f"no UAV uav_9 is on the network (site {net.site}" in result.stderr


def test_network_and_address_cannot_both_say_where_it_is() -> None:
    result = run("--network", "--address", "127.0.0.1:1", "state")
    assert result.exit_code == 1
    assert "leave out the address, or the network" in result.stderr


@pytest.mark.parametrize("typed", [["--network-config", "{config}"], []], ids=["typed", "named by a variable"])
def test_what_is_typed_goes_before_the_environment(
    net: ZenohNet, config: str, telling: ExitStack, monkeypatch: pytest.MonkeyPatch, typed: list[str]
) -> None:
    """Of two places one must not win without a word: another UAV of this name would be flown."""
    Telling(telling, [(net.publication(), report())])
    monkeypatch.setenv("UAL_ADDRESS", "127.0.0.1:1")
    if not typed:
        monkeypatch.setenv("UAL_NETWORK", config)
    result = run(*(each.format(config=config) for each in typed), "watch", "--once")
    if typed:
        assert result.stdout.startswith("uav_1\tFLYING_AUTO"), result.output
    else:
        assert result.exit_code == 1
        assert "UAL_ADDRESS and UAL_NETWORK both say where the UAV is: unset one of them" in result.stderr


def test_a_node_of_ros_is_not_started_for_uavs_of_the_network(config: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UAL_NETWORK", config)
    result = run("ros2", "--variables")
    assert result.exit_code == 2
    assert "the node does not look on the network" in result.stderr


def test_completion_names_the_uavs_of_the_network(
    net: ZenohNet, config: str, telling: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    Telling(telling, [(net.publication("uav_7"), report(uav("uav_7")))])
    monkeypatch.setenv("UAL_NETWORK", config)
    environment = {"_UAL_COMPLETE": "bash_complete", "COMP_WORDS": "ual --ns ", "COMP_CWORD": "2"}
    found = CliRunner().invoke(cli, [], env=environment, prog_name="ual").stdout
    assert found == "plain,uav_7\n"


def test_without_a_router_a_command_says_so(net: ZenohNet, tmp_path: Path) -> None:
    file = tmp_path / "none.yaml"
    file.write_text(f"connect: [{net.endpoint}]\n")
    result = run("--network-config", str(file), "list")
    assert result.exit_code == 1
    assert "no router of the network answers" in result.stderr


def test_watch_prints_what_uavs_tell(net: ZenohNet, config: str, telling: ExitStack) -> None:
    Telling(telling, [(net.publication(), report())])
    result = run("--network-config", config, "watch", "--once")
    assert result.exit_code == 0, result.output
    assert result.stdout == "uav_1\tFLYING_AUTO\t1.00 2.00 3.00 in map\t\t80 %\n"


def test_a_gateways_list_is_written(net: ZenohNet, config: str, tmp_path: Path, telling: ExitStack) -> None:
    Telling(telling, [(net.publication(), report())])
    upstreams = tmp_path / "uavs.map"
    result = run("--network-config", config, "gateway", str(upstreams), "--once")
    assert result.exit_code == 0, result.output
    assert upstreams.read_text().splitlines()[1:] == ["uav_1 10.0.0.1:50051;"]


def test_a_gateway_without_a_network_is_refused(tmp_path: Path) -> None:
    result = run("gateway", str(tmp_path / "uavs.map"), "--once")
    assert result.exit_code == 1
    assert "give --network or --network-config" in result.stderr


class Case:
    """A roster that is filled by hand."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.roster = Roster(lambda _, why: self.said.append(why))

    def uavs(self) -> tuple[Any, ...]:
        return self.roster.uavs()

    def tell(self, instance: int, address: str = "10.0.0.1:50051", host: str = "a", now_s: float = 1.0) -> None:
        by = source(instance=instance)
        self.roster.on_alive(by, now_s)
        self.roster.on_report(by, report(uav(address=address), host=host, started_s=instance), now_s)


def test_a_gateway_keeps_the_uav_that_was_there_first() -> None:
    case = Case()
    said: list[str] = []
    upstreams = Upstreams(said.append)
    case.tell(1)
    assert upstreams.update(case.uavs())
    assert not upstreams.update(case.uavs())
    case.tell(2, "10.0.0.2:50051", "b")
    assert not upstreams.update(case.uavs())
    assert upstreams.addresses == {"uav_1": "10.0.0.1:50051"}
    assert len(said) == 2
    assert all("several UAVs have the name uav_1" in each for each in said)
    case.roster.on_gone(source(instance=1), 9.0)
    case.roster.on_gone(source(instance=2), 9.0)
    assert not upstreams.update(case.uavs())  # gone from the network, and perhaps still in the air


def test_of_two_uavs_that_come_together_a_gateway_takes_none() -> None:
    case = Case()
    case.tell(1)
    case.tell(2, "10.0.0.2:50051", "b")
    upstreams = Upstreams(lambda _: None)
    assert not upstreams.update(case.uavs())
    assert upstreams.addresses == {}


def test_a_gateway_takes_addresses_that_nginx_needs_not_resolve() -> None:
    case = Case()
    said: list[str] = []
    upstreams = Upstreams(said.append)
    case.tell(1, "field-1:50051")
    assert not upstreams.update(case.uavs())
    assert said == ["uav_1 is at field-1:50051: nginx wants an IP address: set `host` in its network's file"]


def test_a_board_shows_what_is_reported_and_since_when_it_is_gone() -> None:
    case = Case()
    said: list[str] = []
    board = Board([], 1.0, 600.0)
    feed = Feed(case, board, said.append)  # type: ignore[arg-type]
    case.tell(1)
    feed.update()
    seen = board.watched_uavs()["uav_1"]
    assert seen.telemetry is not None
    assert (seen.telemetry.state, seen.why) == (State.FLYING_AUTO, "")
    case.roster.on_gone(source(instance=1), 2.0)
    feed.update()
    feed.update()
    assert "gone from the network since" in board.watched_uavs()["uav_1"].why
    assert len(said) == 1
    case.tell(1, now_s=3.0)
    feed.update()
    assert board.watched_uavs()["uav_1"].why == ""


def test_two_of_one_name_have_a_row_each() -> None:
    case = Case()
    board = Board([], 1.0)
    feed = Feed(case, board, case.said.append)  # type: ignore[arg-type]
    case.tell(1)
    feed.update()
    case.tell(2, "10.0.0.2:50051", "b")
    feed.update()
    seen = board.watched_uavs()
    assert list(seen) == ["uav_1@10.0.0.1:50051", "uav_1@10.0.0.2:50051"], "and none says that a daemon has ended"
    assert all("another UAV has the name uav_1" in each.why for each in seen.values())


def test_what_is_listed_says_what_is_wrong() -> None:
    case = Case()
    case.tell(1)
    [fresh] = case.uavs()
    assert listing.trouble(fresh, 2.0) == ""
    assert listing.trouble(fresh, 8.0) == "no telemetry for 7 s, it was FLYING_AUTO"
    case.roster.on_gone(source(instance=1), 10.0)
    [gone] = case.uavs()
    assert listing.trouble(gone, 40.0) == "gone from the network for 30 s, it was FLYING_AUTO"
    assert label(gone) == "uav_1"
