"""Announcements of the daemon in the network, and that it only announces."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import cast

import grimp
import pytest

from tests.ual.network.samples import telemetry
from ual.network.keys import publisher as publisher_of
from ual.network.publishing import Publication
from ual.network.settings import NetworkSettings
from ual.network.values import Report
from ual.types import Telemetry
from ual_daemon.program.network import setup
from ual_daemon.program.network.announcement import UavAnnouncement
from ual_daemon.program.network.publisher import Publisher
from ual_daemon.server.addresses import parse
from ual_daemon.settings import ConfigError

ROOT = Path(__file__).parents[4]


def reported(ns: str, *listen: str) -> UavAnnouncement:
    return UavAnnouncement(ns, "light", [parse(each) for each in listen], lambda: telemetry(ns))


def test_addresses_for_other_computers_come_first_by_the_name_of_the_host() -> None:
    report = reported("uav_1", "127.0.0.1:50051", "unix:/run/uav_1.sock", "0.0.0.0:50052", "10.0.0.1:50053").report(
        "field-1"
    )
    assert report.addresses == ("field-1:50052", "10.0.0.1:50053", "127.0.0.1:50051", "unix:/run/uav_1.sock")
    assert (report.ns, report.backend, report.needed_role, report.has_tls) == ("uav_1", "light", "pilot", False)


def test_where_whoever_reaches_it_may_fly_no_role_is_needed() -> None:
    open_to_all = UavAnnouncement("uav_1", "light", [], telemetry, needs_role=False)
    assert open_to_all.report("a").needed_role == ""


def test_a_large_fleet_learns_of_in_pieces_that_are_sent_at_once() -> None:
    names = [f"uav_{number}" for number in range(1, 301)]
    teller = Publisher(NetworkSettings(), publisher_of(names))
    teller.begin([reported(name) for name in names])
    reports = list(teller.reports(0.01))
    assert [len(each.uavs) for each in reports] == [128, 128, 44]
    assert [uav.ns for each in reports for uav in each.uavs] == names
    assert {each.teller.uav_count for each in reports} == {300}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("connect: [tcp/10.0.0.1:7447]", "leaves this computer"),
        ("certificate: a.pem\nkey: a.key\nauthority: b.pem", "a.key cannot be read|a.pem cannot be read"),
    ],
)
def test_what_could_not_work_is_refused_at_the_start(tmp_path: Path, text: str, why: str) -> None:
    file = tmp_path / "network.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=why) as caught:
        setup.publisher(str(file), ["uav_1"])
    assert caught.value.key == "network"


def test_without_it_nothing_is_reported() -> None:
    assert setup.publisher(None, ["uav_1"]) is None


def test_a_missing_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "zenoh", None)
    with pytest.raises(ConfigError, match=r"--network needs zenoh: .* pip install 'ual-daemon\[network\]'"):
        setup.publisher("loopback", ["uav_1"])


def test_what_publishes_declares_nothing_that_hears() -> None:
    """The daemon has a liveliness token and puts: there is nothing by which the network could reach a flight."""
    source = (ROOT / "clients/python/ual/network/publishing.py").read_text(encoding="utf-8")
    called = {node.attr for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Attribute)}
    assert {"declare_token", "put"} <= called
    assert not called & {"declare_subscriber", "declare_queryable", "get", "declare_querier", "recv"}


def test_zenoh_is_known_where_the_network_is_joined_and_nowhere_else() -> None:
    graph = grimp.build_graph("ual", "ual_tools", "ual_daemon", include_external_packages=True, cache_dir=None)
    importers = graph.find_modules_that_directly_import("zenoh")
    assert importers == {"ual.network.listening", "ual.network.publishing", "ual.network.session"}
    listening = graph.find_shortest_chains("ual_daemon", "ual.network.listening", as_packages=True)
    assert {chain[-2] for chain in listening} <= {"ual.network", "ual.network.membership"}  # when a program asks for it


def test_a_uav_that_cannot_be_reported_silences_no_other() -> None:
    def fail() -> Telemetry:
        raise OverflowError("a stamp beyond all years")

    teller = Publisher(NetworkSettings(), publisher_of(["uav_1", "uav_2", "uav_3"]))
    broken = UavAnnouncement("uav_2", "light", [], fail)
    teller.begin([reported("uav_1"), broken, reported("uav_3")])
    for _ in range(2):
        assert [uav.ns for each in teller.reports(0.01) for uav in each.uavs] == ["uav_1", "uav_3"]


def test_a_session_that_cannot_say_whether_it_is_connected_does_not_end_the_reports() -> None:
    """The thread ended, and its UAVs were gone from the network until a restart."""
    teller = Publisher(NetworkSettings(rate_hz=50.0), publisher_of(["uav_1"]))
    sent: list[Report] = []

    class BrokenOnce:
        @property
        def is_connected(self) -> bool:
            if len(sent) == 1:
                raise OSError("the session is closed")
            return True

        def put(self, report: Report) -> None:
            sent.append(report)
            if len(sent) == 3:
                teller.close()

    teller.begin([reported("uav_1")])
    teller._publish(cast("Publication", BrokenOnce()))
    assert len(sent) == 3
