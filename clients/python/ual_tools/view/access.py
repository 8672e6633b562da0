"""Address of the page and its access rule, from the options of the command. Refuses settings that would open the page
to everybody.
"""

from __future__ import annotations

import secrets
import ssl
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from ual.errors import InvalidArgumentError
from ual.shared.text import decoded
from ual_tools.view.guard import Guard, is_loopback

_SHORTEST_TOKEN_CHARACTERS = 20
_TOKEN_BYTES = 32


@dataclass(frozen=True)
class PageAccess:
    """Address of the page, and access to it."""

    host: str
    port: int
    token: str = ""
    tls: ssl.SSLContext | None = None

    @property
    def guard(self) -> Guard:
        """Judges the requests."""
        return Guard(self.token, is_tls=self.tls is not None)

    def url(self, port: int) -> str:
        """Returns the address of the page, with its token: its holder may open the page."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        token = f"?token={quote(self.token)}" if self.token else ""
        return f"{'http' if self.tls is None else 'https'}://{host}:{port}/{token}"


def access(
    host: str, port: int, certificate: Path | None, key: Path | None, token_file: Path | None, *, control: bool
) -> PageAccess:
    """Returns the access that the options say.

    A page with `control` has a token on loopback, too: other users of the computer must not fly.

    Raises:
        InvalidArgumentError: It would be open to other computers without TLS, or the files are not what is needed.

    """
    if (certificate is None) is not (key is None):
        raise _refused("--tls-certificate and --tls-key: give both or none", "tls_key")
    if certificate is None or key is None:
        if not is_loopback(host):
            raise _refused(f"--host {host} is not loopback: give --tls-certificate and --tls-key, too", "host")
        needs_token = control or token_file is not None
        return PageAccess(host, port, _token(token_file) if needs_token else "")
    return PageAccess(host, port, _token(token_file), _context(certificate, key))


def _token(file: Path | None) -> str:
    return secrets.token_urlsafe(_TOKEN_BYTES) if file is None else _read_token(file)


def _read_token(file: Path) -> str:
    try:
        token = decoded(file.read_bytes()).strip()
    except (OSError, ValueError) as error:
        raise _refused(f"--token-file {file}: {error}", "token") from None
    if len(token) < _SHORTEST_TOKEN_CHARACTERS or not (token.isascii() and token.isalnum()):
        raise _refused(f"--token-file {file}: letters and digits, at least {_SHORTEST_TOKEN_CHARACTERS}", "token")
    return token


def _context(certificate: Path, key: Path) -> ssl.SSLContext:
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise _refused(f"--tls-certificate {certificate}, --tls-key {key}: {error}", "tls_certificate") from None
    return context


def _refused(message: str, field: str) -> InvalidArgumentError:
    return InvalidArgumentError(message, {"field": field})
