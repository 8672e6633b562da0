from __future__ import annotations

import sys

import pytest

from ual_daemon.program.configuration import DaemonSettings
from ual_daemon.program.metrics import opening
from ual_daemon.server.addresses import Address
from ual_daemon.settings import ConfigError


def test_without_the_flag_there_is_nothing() -> None:
    assert opening.address_of(DaemonSettings()) is None
    assert opening.exporter(DaemonSettings()) is None


@pytest.mark.parametrize("text", ["127.0.0.1:9110", "localhost:9110", "[::1]:9110"])
def test_this_computer_may_read_them(text: str) -> None:
    found = opening.address_of(DaemonSettings(metrics=text))
    assert found is not None
    assert str(found) == text


def test_other_computers_may_read_them_only_where_the_network_is_trusted() -> None:
    with pytest.raises(ConfigError, match=r"0\.0\.0\.0:9110 can be read from other computers") as caught:
        opening.address_of(DaemonSettings(metrics="0.0.0.0:9110", tls_certificate="a.pem", tls_key="a.key"))
    assert caught.value.key == "metrics"
    assert opening.address_of(DaemonSettings(metrics="0.0.0.0:9110", insecure=True)) == Address("0.0.0.0", 9110)


@pytest.mark.parametrize("text", ["9110", "unix:/run/ual.sock", "127.0.0.1:99999"])
def test_what_is_no_host_and_port_is_refused_by_its_key(text: str) -> None:
    with pytest.raises(ConfigError, match=r"expected HOST:PORT|served on HOST:PORT") as caught:
        opening.address_of(DaemonSettings(metrics=text))
    assert caught.value.key == "metrics"


def test_a_missing_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "ual_daemon.program.metrics.exporter", raising=False)
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    with pytest.raises(opening.MetricsError, match=r"install the extra by pip install 'ual-daemon\[metrics\]'"):
        opening.exporter(DaemonSettings(metrics="127.0.0.1:0"))


def test_a_port_in_use_is_reported() -> None:
    first = opening.exporter(DaemonSettings(metrics="127.0.0.1:0"))
    assert first is not None
    try:
        with pytest.raises(opening.MetricsError, match=f"cannot serve metrics on {first.address}: Address already in"):
            opening.exporter(DaemonSettings(metrics=str(first.address)))
    finally:
        first.close()
