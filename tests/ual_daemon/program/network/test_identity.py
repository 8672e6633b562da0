"""A daemon whose certificate is not for what it tells ends at the start, and says what to do."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest
from cryptography.x509.oid import ExtendedKeyUsageOID

from ual.network.settings import NetworkSettings
from ual_daemon.program.network import identity, setup
from ual_daemon.settings import ConfigError
from ual_tools.access import certificates

Make = Callable[..., NetworkSettings]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Makes a certificate by its name, and the settings with it."""
    certificates.make_authority(tmp_path, "team", 1.0)

    def made(name: str, *, is_caller: bool = False, days: float = 1.0, directory: Path = tmp_path) -> NetworkSettings:
        if is_caller:
            files = certificates.make_caller(directory, name, days)
        else:
            files = certificates.make_daemon(directory, name, ["127.0.0.1"], days)
        authority = certificates.files(tmp_path, certificates.AUTHORITY).certificate
        return NetworkSettings(
            connect=("tls/10.0.0.1:7447",), certificate=files.certificate, key=files.key, authority=authority
        )

    return made


@pytest.mark.parametrize("name", ["uav_1", "uav_1-200"])
def test_its_own_name_is_taken(make: Make, name: str) -> None:
    identity.require(make(name), name)


@pytest.mark.parametrize(
    ("name", "publisher"), [("uav_2", "uav_1"), ("uav_1-200", "uav_1"), ("uav_1", "uav_1-200"), ("uav_1-4", "uav_1-5")]
)
def test_another_name_is_refused_with_what_to_do(make: Make, name: str, publisher: str) -> None:
    with pytest.raises(ConfigError) as caught:
        identity.require(make(name), publisher)
    assert caught.value.key == "network"
    assert f"{name}.pem is the certificate of {name}, but this daemon tells of {publisher}" in str(caught.value)
    assert f"`ual certificates daemon {publisher}`" in str(caught.value)
    assert f"`--uav {publisher}`" in str(caught.value)


def test_an_observers_certificate_is_none_of_a_uav(make: Make) -> None:
    with pytest.raises(ConfigError, match="certificate of tablet, but this daemon tells of uav_1"):
        identity.require(make("tablet", is_caller=True), "uav_1")


def test_a_certificate_of_another_authority_is_refused(make: Make, tmp_path: Path) -> None:
    certificates.make_authority(tmp_path / "other", "others", 1.0)
    with pytest.raises(ConfigError, match=r"authority.pem does not vouch for .*uav_1.pem .*: make it anew"):
        identity.require(make("uav_1", directory=tmp_path / "other"), "uav_1")


def test_one_that_is_only_for_a_server_is_refused(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """As `ual certificates daemon` made them before they were for the network, too."""
    monkeypatch.setattr(ExtendedKeyUsageOID, "CLIENT_AUTH", ExtendedKeyUsageOID.SERVER_AUTH)
    with pytest.raises(ConfigError, match=r"does not vouch for .*purpose"):
        identity.require(make("uav_1"), "uav_1")


def test_a_computer_without_a_clock_starts(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its date may be before the certificate's: the network is joined once the clock is right."""
    monkeypatch.setattr(certificates, "_CLOCKS_DIFFER", timedelta(days=-300))
    identity.require(make("uav_1", days=400.0), "uav_1")


def test_the_daemon_refuses_it_at_the_start(make: Make, tmp_path: Path) -> None:
    pytest.importorskip("zenoh", reason="ZENOH IS MISSING, the network is NOT TESTED")
    settings = make("uav_2")
    file = tmp_path / "uav_2.network.yaml"
    file.write_text(
        f"connect: [tls/10.0.0.1:7447]\ncertificate: {settings.certificate}\nkey: {settings.key}\n"
        f"authority: {settings.authority}\n"
    )
    with pytest.raises(ConfigError, match="certificate of uav_2, but this daemon tells of uav_1"):
        setup.publisher(str(file), ["uav_1"])
    assert setup.publisher(str(file), ["uav_2"]) is not None
