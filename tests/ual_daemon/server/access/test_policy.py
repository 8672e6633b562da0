"""Peers on this computer, and files that are read anew."""

from __future__ import annotations

import logging
import os
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest

from ual.access import tokens
from ual.access.roles import Role
from ual.shared import whole_file
from ual_daemon.program import access_files
from ual_daemon.program.access_files import RolesReader
from ual_daemon.program.configuration import DaemonSettings
from ual_daemon.server.access.policy import ANYBODY, Roles, is_this_computer
from ual_daemon.server.access.watched_file import WatchedFile
from ual_daemon.settings import ConfigError

NOW = datetime(2026, 11, 23, tzinfo=timezone.utc)


@pytest.mark.parametrize(
    ("peer", "is_here"),
    [
        ("unix:", True),
        ("unix:/run/ual/uav_1.sock", True),
        ("ipv4:127.0.0.1:40000", True),
        ("ipv4:127.3.2.1:40000", True),
        ("ipv6:[::1]:40000", True),
        ("ipv6:%5B::1%5D:40000", True),
        ("ipv6:%5B::ffff:127.0.0.1%5D:40000", True),
        ("ipv4:192.0.2.2:40000", False),
        ("ipv4:0.0.0.0:40000", False),
        ("ipv6:%5Bfe80::1%25eth0%5D:40000", False),
        ("ipv6:%5B::ffff:192.0.2.2%5D:40000", False),
        ("ipv4:localhost:40000", False),
        ("vsock:2:5", False),
        ("unknown", False),
        ("", False),
    ],
)
def test_who_is_on_this_computer(peer: str, is_here: bool) -> None:
    assert is_this_computer(peer) is is_here


def test_the_roles_file() -> None:
    found = RolesReader().read(
        b"certificates: {laptop: pilot}\ntokens: {ci: observer}\nlocal: pilot\nnobody: observer\n"
    )
    assert found == Roles({"laptop": Role.PILOT}, {"ci": Role.OBSERVER}, Role.PILOT, Role.OBSERVER)
    assert RolesReader().read(b"# as without a file") == Roles()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("certificates: {laptop: king}", "certificates.laptop: there is no role 'king'"),
        ("local: Pilot", "local: there is no role 'Pilot'"),
        ("people: {}", "people"),
        ("certificates: [laptop]", "certificates"),
        ("a: [", "line 1"),
        ("\n", "it is empty"),  # as while it is copied
    ],
)
def test_why_a_roles_file_is_refused_is_reported(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        RolesReader().read(text.encode())


@pytest.mark.parametrize("lost", ["certificates", "tokens", "local", "nobody"])
def test_a_changed_roles_file_that_has_lost_a_key_is_refused(lost: str) -> None:
    lines = {
        "certificates": "certificates: {laptop: pilot}\n",
        "tokens": "tokens: {ci: observer}\n",
        "local": "local: observer\n",
        "nobody": "nobody: none\n",
    }
    reader = RolesReader()
    whole = "".join(lines.values()).encode()
    assert reader.read(whole).local is Role.OBSERVER
    cut = "".join(line for key, line in lines.items() if key != lost).encode()
    for _ in range(2):
        with pytest.raises(ValueError, match=f"it has no {lost} any more, so it may be cut"):
            reader.read(cut)
    assert reader.read(whole).local is Role.OBSERVER


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "number"
    whole_file.create(path, b"1")
    return path


def watched(path: Path, *, is_secret: bool = True, settled_s: float = 0.0) -> WatchedFile[int]:
    return WatchedFile(path, "numbers", int, is_secret=is_secret, period_s=0.0, settled_s=settled_s)


def test_a_file_is_read_anew_when_it_has_changed(file: Path) -> None:
    number = watched(file)
    assert number.value == 1
    whole_file.write(file, b"22")
    assert number.value == 22


def test_a_changed_file_is_read_only_once_it_is_not_written_any_more(file: Path) -> None:
    number = watched(file, settled_s=86400.0)
    file.write_bytes(b"2")  # and more of it will follow
    assert number.value == 1
    file.write_bytes(b"22")
    assert number.value == 1
    os.utime(file, (0.0, 0.0))  # long ago
    assert number.value == 22


@pytest.mark.parametrize("change", ["wrong", "missing", "open to all"])
def test_a_change_that_cannot_be_read_is_reported_and_changes_nothing(
    file: Path, change: str, caplog: pytest.LogCaptureFixture
) -> None:
    number = watched(file)
    if change == "wrong":
        whole_file.write(file, b"no number")
    elif change == "missing":
        file.unlink()
    else:
        file.write_bytes(b"333")
        file.chmod(0o666)
    assert [number.value, number.value] == [1, 1]
    assert [(each.levelno, vars(each)["ual_event"]) for each in caplog.records] == [(logging.ERROR, "not_read_again")]
    file.unlink(missing_ok=True)
    whole_file.create(file, b"4444")
    assert number.value == 4444


@pytest.mark.parametrize(
    ("mode", "is_secret", "is_refused"),
    [
        (0o600, True, False),
        (0o640, True, False),
        (0o644, True, True),
        (0o660, True, True),
        (0o644, False, False),
        (0o664, False, True),
        (0o646, False, True),
    ],
)
def test_a_file_that_others_could_read_or_change_is_refused(
    file: Path, mode: int, is_secret: bool, is_refused: bool
) -> None:
    file.chmod(mode)
    if not is_refused:
        assert watched(file, is_secret=is_secret).value == 1
        return
    with pytest.raises(ConfigError, match=r"other users of this computer can .*: run `chmod"):
        watched(file, is_secret=is_secret)


@pytest.mark.skipif(os.geteuid() != 0, reason="ONLY ROOT can give a file away: NOT TESTED")
def test_a_file_of_another_user_is_refused(file: Path) -> None:
    os.chown(file, 12345, -1)
    with pytest.raises(ConfigError, match="belongs to another user"):
        watched(file)


def test_without_files_and_with_insecure_everybody_is_a_commander(tmp_path: Path) -> None:
    assert access_files.access(DaemonSettings(insecure=True)) is ANYBODY
    assert access_files.access(DaemonSettings()) is not ANYBODY
    made = tmp_path / "tokens.json"
    whole_file.create(made, tokens.write([tokens.make("a", Role.PILOT, NOW + timedelta(1), NOW)[1]]))
    assert access_files.access(DaemonSettings(insecure=True, tokens=str(made))) is not ANYBODY


def test_certificates_need_roles() -> None:
    with pytest.raises(ConfigError, match="give --roles"):
        access_files.access(DaemonSettings(tls_client_ca="authority.pem"))
