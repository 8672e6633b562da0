"""The file of the network: what it may say, and that nothing leaves this computer without certificates."""

from __future__ import annotations

from pathlib import Path

import pytest

from ual.errors import InvalidArgumentError
from ual.network import settings
from ual.network.settings import NetworkSettings, Scouting
from ual.shared.exposure import exposed

WHOLE = """\
site: farm
connect: [tls/router-1.local:7447, "quic/[fe80::1]:7448"]
certificate: uav_1.pem
key: keys/uav_1.key
authority: /etc/ual/authority.pem
host: uav-1.local
rate_hz: 2
"""


def read(tmp_path: Path, text: str) -> NetworkSettings:
    file = tmp_path / "network.yaml"
    file.write_text(text)
    return settings.read(file)


def test_a_file_says_all_and_its_paths_begin_at_its_directory(tmp_path: Path) -> None:
    assert read(tmp_path, WHOLE) == NetworkSettings(
        site="farm",
        connect=("tls/router-1.local:7447", "quic/[fe80::1]:7448"),
        certificate=tmp_path / "uav_1.pem",
        key=tmp_path / "keys" / "uav_1.key",
        authority=Path("/etc/ual/authority.pem"),
        host="uav-1.local",
        rate_hz=2.0,
    )


def test_without_a_file_it_is_this_computer_only() -> None:
    found = settings.read("loopback")
    assert (found.site, found.connect, found.means, found.has_certificate) == ("local", (), Scouting.LOOPBACK, False)


def test_with_routers_nothing_is_scouted() -> None:
    assert NetworkSettings(connect=("tcp/127.0.0.1:7447",)).means is Scouting.NONE


@pytest.mark.parametrize(
    "text",
    [
        "connect: [tcp/10.0.0.1:7447]",
        "connect: [tls/10.0.0.1:7447]",
        "connect: [tcp/127.0.0.1:7447, tls/router.local:7447]",
        "connect: [tcp/0.0.0.0:7447]",
        "connect: [tcp/localhost.evil.example:7447]",
        "scouting: lan",
        "scouting: lan\npublishers: [uav_1]",
        "connect: [tcp/10.0.0.1:7447]\ncertificate: a\nkey: b\nauthority: c",
    ],
)
def test_what_leaves_this_computer_needs_certificates(tmp_path: Path, text: str) -> None:
    with pytest.raises(InvalidArgumentError, match=r"leaves this computer.*ual certificates network"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    "text", ["connect: [tcp/127.0.0.1:7447]", "connect: ['tcp/[::1]:7447', tcp/localhost:1]", "{}"]
)
def test_what_stays_on_this_computer_needs_none(tmp_path: Path, text: str) -> None:
    assert not read(tmp_path, text).has_certificate


def test_one_rule_says_what_other_computers_get_to() -> None:
    addresses = [
        "127.0.0.1:1",
        "localhost:1",
        "[::1]:1",
        "unix:/run/ual.sock",
        "10.0.0.1:1",
        "0.0.0.0:1",
        "[::]:1",
        "a:1",
    ]
    assert exposed(addresses) == ["10.0.0.1:1", "0.0.0.0:1", "[::]:1", "a:1"]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("sight: farm", "there is no key 'sight': site, connect"),
        ("site: a/b", "site: 'a/b' is no name"),
        ("site: '*'", "site: '\\*' is no name"),
        ("site: 7", "site: expected text, got 7"),
        ("rate_hz: 0", "rate_hz: 0.0 is not between 0 and 50"),
        ("rate_hz: .nan", "rate_hz: nan is not between"),
        ("rate_hz: fast", "rate_hz: expected a number"),
        ("rate_hz: true", "rate_hz: expected a number"),
        ("connect: tls/a:1", "connect: expected a list"),
        ("connect: [10.0.0.1]", "connect: '10.0.0.1' is no router"),
        ("connect: [tcp/127.0.0.1:99999]", "is no router"),
        ("connect: ['tcp/127.0.0.1:1#iface=eth0']", "is no router"),
        ("connect: ['udp/127.0.0.1:1']", "is no router"),
        ("scouting: everywhere", "scouting: 'everywhere' is none of none, loopback, lan"),
        ("scouting: none", "connect: no router, and no scouting"),
        ("scouting: loopback\nconnect: [tcp/127.0.0.1:1]", "scouting: with routers"),
        ("scouting: lan\ncertificate: a\nkey: b\nauthority: c", "publishers: .* list the UAVs"),
        ("publishers: ['uav_*']", "publishers: 'uav_\\*' is no UAV"),
        ("certificate: a.pem", "key: certificate, key and authority are needed together"),
        ("scouting_port: 0", "scouting_port: 0 is no port"),
        ("host: 'a b'", "host: 'a b' is no host"),
        ("- a", "expected settings as 'key: value' lines"),
        ("site: [", "line 1"),
    ],
)
def test_a_mistake_names_its_file_and_key(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(InvalidArgumentError, match=why) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'network.yaml'}: ")


def test_a_file_that_is_not_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgumentError, match="cannot be read: No such file"):
        settings.read(tmp_path / "none.yaml")
