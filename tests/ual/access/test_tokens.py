"""Tokens: what is stored of them, and the commands that make, list and revoke them."""

from __future__ import annotations

import json
import stat
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from ual.access import roles, tokens
from ual.access.roles import Role
from ual_tools.main import cli

NOW = datetime(2026, 11, 23, 12, 0, tzinfo=timezone.utc)


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, words)


def done(*words: str) -> str:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "tokens.json"


def test_a_token_is_found_by_its_secret_only() -> None:
    secret, token = tokens.make("laptop", Role.PILOT, None, NOW)
    other, _ = tokens.make("laptop", Role.PILOT, None, NOW)
    assert tokens.find([token], secret) is token
    assert tokens.find([token], other) is None
    assert tokens.find([token], token.sha256) is None
    assert tokens.find([token], "") is None


def test_it_is_valid_until_it_expires() -> None:
    _, token = tokens.make("laptop", Role.PILOT, NOW, NOW - timedelta(days=1))
    assert not token.has_expired(NOW - timedelta(seconds=1))
    assert token.has_expired(NOW)


def test_the_file_reads_as_it_was_written_and_has_no_secret() -> None:
    secret, token = tokens.make("laptop", Role.PILOT, NOW + timedelta(days=30), NOW)
    written = tokens.write([token])
    assert tokens.read(written) == (token,)
    assert secret.encode() not in written
    assert secret.removeprefix(tokens.PREFIX).encode() not in written


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff",
        b"[]",
        b"{}",
        b'{"tokens": [1]}',
        b'{"tokens": [{"name": "a"}]}',
        b'{"tokens": [{"name": "../a", "role": "pilot", "sha256": "", "created": "", "expires": null}]}',
        json.dumps(
            {"tokens": [{"name": "a", "role": "king", "sha256": "0" * 64, "created": "", "expires": None}]}
        ).encode(),
        json.dumps(
            {"tokens": [{"name": "a", "role": "pilot", "sha256": "0" * 64, "created": "2026-01-01", "expires": None}]}
        ).encode(),
    ],
)
def test_what_is_no_file_of_tokens_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011  what is said depends on the mistake
        tokens.read(data)


ONE = '{"name": "a", "role": "pilot", "sha256": "' + "0" * 64
ONE += '", "created": "2026-01-01T00:00:00+00:00", "expires": null}'
TWIN = ONE.replace('"name": "a"', '"name": "b"')


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (ONE.replace('"role"', '"role": "commander",\n"role"'), "line 2: .* 'role' is given twice"),
        (ONE.replace('"role"', '"revoked": true, "role"'), "there is no key 'revoked'"),
        (f"{ONE}, {ONE.replace('000', '111')}", "two different tokens have the name 'a'"),
        (f"{ONE}, {ONE.replace('pilot', 'observer')}", "two different tokens have the name 'a'"),
        (f"{ONE}, {TWIN}", "two different tokens have the sha256"),
        ("{", "line 1: it is no file of tokens: Expecting"),
    ],
)
def test_a_token_that_is_there_twice_is_refused(entries: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tokens.read(f'{{"tokens": [{entries}]}}'.encode())


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_the_file_is_read_as_windows_writes_it(encoding: str) -> None:
    [token] = tokens.read(f'{{"tokens": [{ONE}]}}'.replace(" ", "\r\n").encode(encoding))
    assert (token.name, token.role) == ("a", Role.PILOT)


@pytest.mark.parametrize("text", ["", "Pilot", "PILOT", "admin"])
def test_a_role_has_its_name_only(text: str) -> None:
    with pytest.raises(ValueError, match="one of none, observer, pilot, commander"):
        roles.parse(text)


def test_a_new_token_is_printed_once_and_its_file_is_private(file: Path) -> None:
    secret = done("token", "new", "--role", "pilot", "--name", "laptop", "--days", "30", "--file", str(file)).strip()
    [stored] = tokens.read(file.read_bytes())
    assert tokens.find([stored], secret) is stored
    assert (stored.name, stored.role) == ("laptop", Role.PILOT)
    assert stored.expires is not None
    assert stored.expires - stored.created == timedelta(days=30)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert secret not in done("token", "list", "--file", str(file))


def test_a_new_token_is_written_for_its_owner_only_and_nothing_is_overwritten(file: Path, tmp_path: Path) -> None:
    target = tmp_path / "laptop.token"
    words = ("token", "new", "--role", "pilot", "--file", str(file), "--output", str(target), "--name")
    said = done(*words, "laptop")
    secret = target.read_text("ascii").strip()
    assert stat.S_IMODE(target.stat().st_mode) == 0o600
    assert tokens.find(tokens.read(file.read_bytes()), secret) is not None
    assert secret not in said
    result = run(*words, "tablet")
    assert (result.exit_code, "is there already" in result.stderr) == (1, True)
    assert [each.name for each in tokens.read(file.read_bytes())] == ["laptop"]
    assert target.read_text("ascii").strip() == secret


def test_they_are_listed_and_revoked(file: Path) -> None:
    for name in ("laptop", "tablet"):
        done("token", "new", "--role", "observer", "--name", name, "--file", str(file))
    lines = done("--json", "token", "list", "--file", str(file)).splitlines()
    assert [json.loads(line)["name"] for line in lines] == ["laptop", "tablet"]
    assert done("token", "revoke", "laptop", "--file", str(file)) == "revoked laptop\n"
    assert [token.name for token in tokens.read(file.read_bytes())] == ["tablet"]


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["new", "--role", "pilot", "--name", "laptop"], "has a token laptop already"),
        (["new", "--role", "pilot", "--name", "a b"], "is no name"),
        (["revoke", "nobody"], "has no token nobody (it has: laptop)"),
    ],
)
def test_why_it_is_refused_is_reported(file: Path, words: list[str], why: str) -> None:
    done("token", "new", "--role", "pilot", "--name", "laptop", "--file", str(file))
    before = file.read_bytes()
    result = run("token", *words, "--file", str(file))
    assert result.exit_code == 1
    assert why in result.output
    assert file.read_bytes() == before


def test_a_file_that_is_not_there_is_named(file: Path) -> None:
    result = run("token", "list", "--file", str(file))
    assert result.exit_code == 1
    assert f"there is no {file}" in result.output
