"""`ual view`: what would be open to everybody is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from ual.errors import InvalidArgumentError
from ual_tools.view.access import PageAccess, access

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
        ("127.0.0.1", None, None, HERE, "letters and digits, at least 20"),
        ("127.0.0.1", HERE, HERE, HERE, "letters and digits, at least 20"),
    ],
)
def test_refused(host: str, certificate: Path | None, key: Path | None, token_file: Path | None, words: str) -> None:
    with pytest.raises(InvalidArgumentError, match=words):
        access(host, 0, certificate, key, token_file, control=False)


def test_addresses() -> None:
    assert access("::1", 0, None, None, None, control=False).url(8080) == "http://[::1]:8080/"
    assert PageAccess("a.b", 0, "secret").url(1) == "http://a.b:1/?token=secret"


def test_a_page_that_flies_has_a_token_that_is_new_each_time() -> None:
    pages = [access("127.0.0.1", 0, None, None, None, control=True) for _ in range(2)]
    assert all(len(page.token) >= 32 for page in pages)
    assert pages[0].token != pages[1].token
    assert pages[0].guard.refusal("/", {"host": "127.0.0.1:80"})
    assert not pages[0].guard.refusal(f"/?token={pages[0].token}", {"host": "127.0.0.1:80"})
