"""Zenoh's configuration: what leaves this computer, and the rights of each peer of a LAN, with real Zenoh."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.ports import free_port
from tests.ual.network.samples import source
from tests.waiting import until
from ual.network import NetworkSettings, Scouting, configuration
from ual_tools.access import certificates

zenoh = pytest.importorskip("zenoh", reason="ZENOH IS MISSING, the network is NOT TESTED")

TEAM = ("uav_1", "uav_2", "tablet")


def of(settings: NetworkSettings) -> dict[str, object]:
    made: dict[str, object] = json.loads(configuration.of(settings))
    return made


def test_without_a_file_only_loopback_is_listened_on_and_scouted() -> None:
    config = of(NetworkSettings())
    assert config["listen"] == {"endpoints": ["tcp/127.0.0.1:0"]}
    assert config["scouting"] == {
        "multicast": {"enabled": True, "address": "224.0.0.224:7446", "interface": "lo"},
        "gossip": {"enabled": False},
    }


def test_with_routers_nothing_is_listened_on_and_nothing_is_scouted() -> None:
    config = of(NetworkSettings(connect=("tcp/127.0.0.1:7447",)))
    assert config["mode"] == "client"
    assert "listen" not in config
    assert config["scouting"] == {"multicast": {"enabled": False}, "gossip": {"enabled": False}}


def test_with_a_certificate_nothing_goes_without_encryption() -> None:
    files = {name: Path(name) for name in ("certificate", "key", "authority")}
    settings = NetworkSettings(connect=("tls/10.0.0.1:7447",), **files)  # type: ignore[arg-type]
    link = configuration.transport(settings)["link"]
    assert link["protocols"] == ["tls", "quic"]
    assert (link["tls"]["enable_mtls"], link["tls"]["verify_name_on_connect"]) == (True, True)


def test_an_attempt_to_connect_ends_before_tcp_waits_for_seconds() -> None:
    """TCP asks at 0, 1 and 3 s: a peer that comes back at 1.1 s is reached by a new attempt at 2 s."""
    transport = configuration.transport(NetworkSettings())
    assert transport["unicast"] == {"open_timeout": 2000}
    assert (
        json.loads(zenoh.Config.from_json5(json.dumps({"transport": transport})).get_json("transport/unicast"))[
            "open_timeout"
        ]
        == 2000
    )


@pytest.fixture
def team(tmp_path: Path) -> Iterator[dict[str, Any]]:
    """Peers as on a LAN, but on loopback."""
    certificates.make_authority(tmp_path, "team", 1.0)
    port = free_port()
    with ExitStack() as stack:
        sessions = {}
        for name in TEAM:
            files = certificates.make_daemon(tmp_path, name, ["127.0.0.1"], 1.0)
            settings = NetworkSettings(
                "farm",
                scouting=Scouting.LAN,
                scouting_port=port,
                certificate=files.certificate,
                key=files.key,
                authority=certificates.files(tmp_path, certificates.AUTHORITY).certificate,
                publishers=("uav_1", "uav_2"),
            )
            config = json.loads(configuration.of(settings))
            config["listen"] = {"endpoints": ["tls/127.0.0.1:0"]}
            config["scouting"]["multicast"]["interface"] = "lo"
            sessions[name] = stack.enter_context(zenoh.open(zenoh.Config.from_json5(json.dumps(config))))
        yield sessions


def test_on_a_lan_each_uavs_word_is_taken_from_itself_only(team: dict[str, Any]) -> None:
    until(lambda: all(len(each.info.peers_zid()) == len(TEAM) - 1 for each in team.values()))
    channel = zenoh.handlers.FifoChannel(100)
    heard = team["tablet"].declare_subscriber("ual/farm/*/*/telemetry", channel)
    key = source("uav_1").telemetry
    came: list[bytes] = []

    def has_come(data: bytes) -> bool:
        while (sample := heard.try_recv()) is not None:
            came.append(sample.payload.to_bytes())
        return data in came

    until(lambda: team["uav_1"].put(key, b"true") or has_come(b"true"))
    team["uav_2"].put(key, b"forged")
    own = source("uav_2").telemetry
    until(lambda: team["uav_2"].put(own, b"its own") or has_come(b"its own"))  # it comes after what it forged
    assert b"forged" not in came
