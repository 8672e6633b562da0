"""Output of `ual certificates network`, with real Zenoh: allowed publishers, allowed listeners, and strangers."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.ports import free_port
from tests.ual.network.samples import report, source, uav
from tests.ual.network.zenoh_net import JOIN_S, saying
from tests.waiting import until
from ual.errors import DaemonUnreachableError
from ual.network import Network, NetworkUav, settings
from ual.network.publishing import Publication
from ual.network.session import RouterSession, open_session
from ual_tools.main import cli

pytest.importorskip("zenoh", reason="ZENOH IS MISSING, the network is NOT TESTED: pip install 'ual-tools[network]'")


SHOW_REFUSED = {"RUST_LOG": "zenoh::net::routing::interceptor::access_control=trace"}
REFUSED = re.compile(r"CertCommonName\(uav_2\)\S* is unauthorized to Put \(ingress\) on ual/farm/uav_1/")


def run(directory: Path, *words: str) -> Result:
    return CliRunner().invoke(cli, ["certificates", *words, "--dir", str(directory)])


def done(directory: Path, *words: str) -> str:
    result = run(directory, *words)
    assert result.exit_code == 0, result.output
    return result.stdout


class Team:
    """A site with two routers, two UAVs and an observer, by its certificates."""

    def __init__(self, directory: Path, stack: ExitStack) -> None:
        self.directory = directory
        self._stack = stack
        done(directory, "authority")
        for name in ("router_1", "router_2", "uav_1", "uav_2"):
            done(directory, "daemon", name, "--host", "127.0.0.1")
        for name in ("tablet", "phone"):
            done(directory, "caller", name)
        routers = [f"--router=router_{number}=127.0.0.1:{free_port()}" for number in (1, 2)]
        self.written = done(
            directory, "network", "farm", *routers, "--uav", "uav_1", "--uav", "uav_2", "--observer", "tablet"
        ).splitlines()

    def start_routers(self) -> None:
        before = Path.cwd()
        os.chdir(self.directory)
        self._stack.callback(os.chdir, before)
        for name in ("router_1", "router_2"):
            self._stack.enter_context(RouterSession(self.directory / f"{name}.router.json5"))

    def settings(self, name: str) -> settings.NetworkSettings:
        return settings.read(self.directory / f"{name}.network.yaml")

    def network(self, name: str) -> Network:
        return self._stack.enter_context(Network(self.settings(name), timeout_s=JOIN_S))

    def publication(self, name: str, publisher: str, instance: int) -> Publication:
        by = source(publisher, instance)
        return self._stack.enter_context(closing(Publication(self.settings(name), by, JOIN_S)))


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Team]:
    with ExitStack() as stack:
        made = Team(tmp_path_factory.mktemp("team"), stack)
        made.start_routers()
        yield made


def test_the_files_name_what_lies_next_to_them_and_keep_keys_out(team: Team) -> None:
    names = [Path(path).name for path in team.written]
    assert names == [
        "router_1.router.json5",
        "router_2.router.json5",
        "uav_1.network.yaml",
        "uav_2.network.yaml",
        "tablet.network.yaml",
    ]
    text = "".join(Path(path).read_text() for path in team.written)
    assert "PRIVATE" not in text
    router = json.loads((team.directory / "router_2.router.json5").read_text())
    first = json.loads((team.directory / "router_1.router.json5").read_text())
    assert first["connect"]["endpoints"] == []
    assert router["connect"]["endpoints"] == [f"tls/127.0.0.1:{first['listen']['endpoints'][0].rpartition(':')[2]}"]
    assert router["access_control"]["default_permission"] == "deny"


def test_each_does_what_its_certificate_allows_and_nothing_else(team: Team) -> None:
    """An observer listens through the other router; a UAV publishes as itself; neither does what the other may."""
    network = team.network("tablet")
    honest = team.publication("uav_1", "uav_1", 1)
    until(network.uavs, between=saying(honest, report()))
    forging = team.publication("uav_2", "uav_1", 2)
    observer = team.publication("tablet", "uav_2", 3)
    witness = team.publication("uav_2", "uav_2", 4)
    spying: list[object] = []
    spy = open_session(team.settings("uav_2"), JOIN_S)
    spy.declare_subscriber("ual/farm/**", spying.append)
    spy.liveliness().declare_subscriber("ual/farm/**", spying.append, history=True)
    forging.put(report(uav(address="6.6.6.6:1"), host="forged"))
    observer.put(report(uav("uav_2", "6.6.6.6:1"), host="forged"))
    until(lambda: len(_present(network)) == 2, between=saying(witness, report(uav("uav_2"))))
    honest.put(report())
    assert [(each.ns, each.teller.host, each.is_contested) for each in _present(network)] == [
        ("uav_1", "a", False),
        ("uav_2", "a", False),
    ]
    assert spying == []
    spy.close()  # type: ignore[no-untyped-call]


def test_a_router_shows_what_it_refuses_where_it_is_requested_to(tmp_path: Path) -> None:
    """Zenoh has a line for it, which nothing shows by itself."""
    with ExitStack() as stack:
        team = Team(tmp_path, stack)
        log = tmp_path / "router.log"
        command = [str(Path(sys.executable).with_name("ual")), "router", str(tmp_path / "router_1.router.json5")]
        out = stack.enter_context(log.open("wb"))
        process = subprocess.Popen(command, env={**os.environ, **SHOW_REFUSED}, stdout=out)
        stack.callback(process.wait)
        stack.callback(process.terminate)
        forging = team.publication("uav_2", "uav_1", 1)
        until(lambda: REFUSED.search(log.read_text()), between=saying(forging, report()), seen=log.read_text)


def _present(network: Network) -> list[NetworkUav]:
    return [each for each in network.uavs() if each.gone_s is None]


def test_a_certificate_that_no_file_names_sees_nothing(team: Team) -> None:
    """It is of the team's authority, but no observer."""
    honest = team.publication("uav_1", "uav_1", 5)
    unnamed = team.directory / "phone.network.yaml"
    unnamed.write_text((team.directory / "tablet.network.yaml").read_text().replace("tablet", "phone"))
    network, known = team.network("phone"), team.network("tablet")
    until(known.uavs, between=saying(honest, report()))
    assert network.uavs() == ()


def test_a_stranger_is_not_let_in(team: Team, tmp_path: Path) -> None:
    """One with a certificate of another authority, and one without."""
    done(tmp_path, "authority")
    done(tmp_path, "caller", "tablet")
    text = (team.directory / "tablet.network.yaml").read_text()
    file = tmp_path / "tablet.network.yaml"
    file.write_text(text.replace("authority.pem", str(team.directory / "authority.pem")))
    with pytest.raises(DaemonUnreachableError, match="none that knows this certificate"):
        Network(file, timeout_s=1.0)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--router", "router_9=127.0.0.1"], "there is no .*router_9.pem: `ual certificates daemon` makes"),
        (["--router", "router_1=127.0.0.1", "--uav", "router_1"], "'router_1' is given twice|router_1 is given twice"),
        (["--router", "router_1=127.0.0.1", "--uav", "uav.1"], "'uav.1' is no UAV"),
        (["--router", "router_1=127.0.0.1", "--uav", "uav_3"], "there is no .*uav_3.pem"),
    ],
)
def test_why_it_is_refused_is_reported(team: Team, words: list[str], why: str) -> None:
    result = run(team.directory, "network", "farm", *words)
    assert result.exit_code == 1
    assert re.search(why, result.output), result.output


def test_a_router_that_is_none_is_wrong_usage(team: Team) -> None:
    assert run(team.directory, "network", "farm", "--router", "10.0.0.1").exit_code == 2
