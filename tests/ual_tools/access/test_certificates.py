"""`ual certificates`: what it makes, and why it refuses. That gRPC takes them is tested with the server."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from cryptography import x509

from ual_tools.main import cli


def run(directory: Path, *words: str) -> Result:
    return CliRunner().invoke(cli, ["certificates", *words, "--dir", str(directory)])


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    made = tmp_path / "team"
    assert run(made, "authority").exit_code == 0
    return made


def test_keys_are_private_and_certificates_are_for_everybody(directory: Path) -> None:
    assert run(directory, "daemon", "uav_1", "--host", "uav-1.local", "--host", "10.0.0.11").exit_code == 0
    result = run(directory, "caller", "laptop", "--days", "30")
    assert result.output.splitlines() == [str(directory / "laptop.pem"), str(directory / "laptop.key")]
    for name in ("authority", "uav_1", "laptop"):
        assert stat.S_IMODE((directory / f"{name}.key").stat().st_mode) == 0o600
        assert stat.S_IMODE((directory / f"{name}.pem").stat().st_mode) & 0o044 == 0o044
    daemon = x509.load_pem_x509_certificate((directory / "uav_1.pem").read_bytes())
    names = daemon.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["uav-1.local"]
    assert [str(each) for each in names.get_values_for_type(x509.IPAddress)] == ["10.0.0.11"]
    caller = x509.load_pem_x509_certificate((directory / "laptop.pem").read_bytes())
    assert (caller.not_valid_after_utc - caller.not_valid_before_utc).days == 31
    authority = x509.load_pem_x509_certificate((directory / "authority.pem").read_bytes())
    caller.verify_directly_issued_by(authority)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["authority"], "authority.key is there already"),
        (["caller", "authority"], "is no name"),
        (["caller", "../laptop"], "is no name"),
    ],
)
def test_why_it_is_refused_is_reported(directory: Path, words: list[str], why: str) -> None:
    before = {path.name: path.read_bytes() for path in directory.iterdir()}
    result = run(directory, *words)
    assert result.exit_code == 1
    assert why in result.output
    assert {path.name: path.read_bytes() for path in directory.iterdir()} == before


def test_without_an_authority_it_says_what_makes_one(tmp_path: Path) -> None:
    result = run(tmp_path, "caller", "laptop")
    assert result.exit_code == 1
    assert "`ual certificates authority` makes it" in result.output


def test_without_its_package_it_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "ual_tools.access.certificates", raising=False)
    monkeypatch.delattr("ual_tools.access.certificates", raising=False)
    monkeypatch.setitem(sys.modules, "cryptography", None)
    result = run(tmp_path, "authority")
    assert result.exit_code == 1
    assert "ual-tools[access]" in result.output
