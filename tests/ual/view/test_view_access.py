"""`ual view`: what would be open to everybody is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from ual._cli.view.access import Access, access
from ual.errors import InvalidArgumentError

HERE = Path(__file__)


@pytest.mark.parametrize(
    ("host", "certificate", "key", "token_file", "words"),
    [
        ("0.0.0.0", None, None, None, "--host 0.0.0.0 is not loopback"),
        ("::", None, None, None, "not loopback"),
        ("192.168.1.7", None, None, None, "give --tls-certificate and --tls-key"),
        ("uav.example", None, None, None, "not loopback"),
        ("127.0.0.1", HERE, None, None, "both or none"),
        ("127.0.0.1", None, HERE, None, "both or none"),
        ("127.0.0.1", HERE, HERE, None, "--tls-certificate"),
        ("127.0.0.1", None, None, HERE, "--token-file is for a page with TLS"),
        ("127.0.0.1", HERE, HERE, HERE, "letters and digits, at least 20"),
    ],
)
def test_refused(host: str, certificate: Path | None, key: Path | None, token_file: Path | None, words: str) -> None:
    with pytest.raises(InvalidArgumentError, match=words):
        access(host, 0, certificate, key, token_file)


def test_addresses() -> None:
    assert access("::1", 0, None, None, None).url(8080) == "http://[::1]:8080/"
    assert Access("a.b", 0, "secret").url(1) == "http://a.b:1/?token=secret"
