"""Options of the daemon together: each pair of two values is in some start, and each start flies."""

from __future__ import annotations

import itertools
import signal
import urllib.request
from collections.abc import Iterator, Mapping
from datetime import datetime, timezone
from pathlib import Path

import pytest

import ual
from tests.conftest import StartDaemon
from tests.ports import free_port
from tests.waiting import LIMIT_S, until_state
from ual.access import tokens
from ual.access.roles import Role
from ual.shared import whole_file
from ual.types import State
from ual_tools.access import certificates

pytest.importorskip("zenoh", reason="ZENOH IS MISSING, options are NOT TESTED together")
pytest.importorskip("mcap", reason="MCAP IS MISSING, options are NOT TESTED together")
pytest.importorskip("prometheus_client", reason="PROMETHEUS IS MISSING, options are NOT TESTED together")

OPTIONS: Mapping[str, tuple[str, ...]] = {
    "listen": ("port", "socket", "two ports and a socket"),
    "processes": ("one UAV", "fleet", "fleet of workers"),
    "audit": ("none", "written", "required"),
    "tls": ("off", "on"),
    "tokens": ("off", "on"),
    "network": ("off", "on"),
    "metrics": ("off", "on"),
    "record": ("off", "on"),
    "transport": ("core", "aio"),
    "file": ("off", "on"),
}
FLEET_COUNT = 3
MOST_STARTS = 13

Start = dict[str, str]


def pairs(start: Mapping[str, str]) -> set[tuple[tuple[str, str], tuple[str, str]]]:
    return set(itertools.combinations(start.items(), 2))


def starts() -> Iterator[Start]:
    """Starts that have all pairs: each takes, option by option, the value that brings the most new ones."""
    missing = set().union(
        *(
            itertools.product(((one, a) for a in OPTIONS[one]), ((other, b) for b in OPTIONS[other]))
            for one, other in itertools.combinations(OPTIONS, 2)
        )
    )
    while missing:
        (first, second) = min(missing)
        start: Start = {}
        for name, values in OPTIONS.items():
            fixed = {first[0]: first[1], second[0]: second[1]}.get(name)
            start[name] = fixed or max(
                values,
                key=lambda value: (
                    len(missing & pairs({**start, name: value}))
                    + len([pair for pair in missing if (name, value) in pair]) / 1000.0
                ),
            )
        missing -= pairs(start)
        yield start


STARTS = list(starts())


def test_a_dozen_starts_have_each_pair() -> None:
    every = set().union(*(pairs(start) for start in STARTS))
    sizes = [len(values) for values in OPTIONS.values()]
    assert len(every) == sum(a * b for a, b in itertools.combinations(sizes, 2))
    assert len(STARTS) <= MOST_STARTS


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with a certificate, tokens, roles, and a network."""
    directory = tmp_path_factory.mktemp("team")
    certificates.make_authority(directory, "team", 10.0)
    certificates.make_daemon(directory, "uav_1", ["127.0.0.1"], 10.0)
    _, token = tokens.make("planner", Role.PILOT, None, datetime.now(timezone.utc))
    whole_file.create(directory / "tokens.json", tokens.write([token]))
    (directory / "roles.yaml").write_text("tokens: {planner: observer}\n")
    (directory / "roles.yaml").chmod(0o600)
    return directory


class Flags:
    """The flags of a start, and where its traces are."""

    def __init__(self, start: Start, team: Path, directory: Path) -> None:
        self.listen = {
            "port": ["127.0.0.1:0"],
            "socket": [f"unix:{directory}/{{ns}}.sock"],
            "two ports and a socket": ["127.0.0.1:0", "127.0.0.1:0", f"unix:{directory}/{{ns}}.sock"],
        }[start["listen"]]
        self.count = 1 if start["processes"] == "one UAV" else FLEET_COUNT
        self.audit = directory / "audit.jsonl" if start["audit"] != "none" else None
        self.metrics = f"127.0.0.1:{free_port()}" if start["metrics"] == "on" else None
        self.record = directory / "record" if start["record"] == "on" else None
        self.tls_ca = None
        self.flags = ["--auto-arm", "--set", "light.speed_factor=10", "--transport", start["transport"]]
        self.flags += {"one UAV": [], "fleet": ["--fleet", "3"]}.get(
            start["processes"], ["--fleet", "3", "--workers", "2"]
        )
        if start["audit"] == "required":
            self.flags.append("--audit-required")
        if self.audit is not None:
            self.flags += ["--audit", str(self.audit)]
        if start["tls"] == "on":
            pair = certificates.files(team, "uav_1")
            self.flags += ["--tls-certificate", str(pair.certificate), "--tls-key", str(pair.key)]
            self.tls_ca = certificates.files(team, certificates.AUTHORITY).certificate
        if start["tokens"] == "on":
            self.flags += ["--tokens", str(team / "tokens.json"), "--roles", str(team / "roles.yaml")]
        if start["network"] == "on":
            (directory / "network.yaml").write_text(f"site: {directory.name[-20:].replace('.', '_')}\n")
            self.flags += ["--network", str(directory / "network.yaml")]
        if self.metrics is not None:
            self.flags += ["--metrics", self.metrics]
        if self.record is not None:
            self.record.mkdir()
            self.flags += ["--record", str(self.record)]
        if start["file"] == "on":
            (directory / "daemon.yaml").write_text("home_pose: [1.0, 2.0, 3.0]\n")
            self.flags += ["--config", str(directory / "daemon.yaml")]
        for each in self.listen[1:]:
            self.flags += ["--listen", each]


@pytest.mark.parametrize("start", STARTS, ids=[str(number) for number in range(len(STARTS))])
def test_each_start_flies_and_ends(start: Start, team: Path, tmp_path: Path, start_daemon: StartDaemon) -> None:
    made = Flags(start, team, tmp_path)
    daemon = start_daemon(*made.flags, listen=made.listen[0])
    for number in range(1, made.count + 1):
        listening = daemon.wait_for("listening", ns=f"uav_{number}")
        addresses = str(listening["addresses"]).split()
        assert len(addresses) == len(made.listen)
        for address in addresses:
            tls_ca = None if address.startswith("unix:") else made.tls_ca
            with ual.Uav(address=address, tls_ca=tls_ca) as uav:
                assert uav.info().namespace == f"uav_{number}"
                if address == addresses[-1]:
                    until_state(uav, State.LANDED_ARMED)
                    uav.take_off(1.0, timeout_s=LIMIT_S)
    if made.metrics is not None:
        with urllib.request.urlopen(f"http://{made.metrics}/metrics", timeout=LIMIT_S) as answer:
            assert b"ual_" in answer.read()
    daemon.signal(signal.SIGTERM)
    assert daemon.wait() == 0, daemon.stderr
    if made.audit is not None:
        assert made.audit.read_text().count("/TakeOff") >= made.count
    if made.record is not None:
        assert list(made.record.rglob("*.mcap"))
