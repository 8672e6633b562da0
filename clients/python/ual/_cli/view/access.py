"""Where the page is served and who may open it, from the options of the command. Refuses what would be open to all."""

from __future__ import annotations

import secrets
import ssl
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from ual._cli.view.guard import Guard, is_loopback
from ual.errors import InvalidArgumentError

_SHORTEST_TOKEN = 20
_TOKEN_BYTES = 32


@dataclass(frozen=True)
class Access:
    """Where the page is served, and to whom."""

    host: str
    port: int
    token: str = ""
    tls: ssl.SSLContext | None = None

    @property
    def guard(self) -> Guard:
        """Judges the requests."""
        return Guard(self.token)

    def url(self, port: int) -> str:
        """Returns the address of the page, with its token: who knows it may open the page."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        token = f"?token={quote(self.token)}" if self.token else ""
        return f"{'http' if self.tls is None else 'https'}://{host}:{port}/{token}"


def access(host: str, port: int, certificate: Path | None, key: Path | None, token_file: Path | None) -> Access:
    """Returns the access that the options say.

    Raises:
        InvalidArgumentError: It would be open to other computers without TLS, or the files are not what is needed.

    """
    if (certificate is None) is not (key is None):
        raise _refused("--tls-certificate and --tls-key: give both or none", "tls_key")
    if certificate is None or key is None:
        if not is_loopback(host):
            raise _refused(f"--host {host} is not loopback: give --tls-certificate and --tls-key, too", "host")
        if token_file is not None:
            raise _refused("--token-file is for a page with TLS: without it, anybody on the way could read it", "token")
        return Access(host, port)
    token = secrets.token_urlsafe(_TOKEN_BYTES) if token_file is None else _read_token(token_file)
    return Access(host, port, token, _context(certificate, key))


def _read_token(file: Path) -> str:
    try:
        token = file.read_text("ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise _refused(f"--token-file {file}: {error}", "token") from None
    if len(token) < _SHORTEST_TOKEN or not token.isalnum():
        raise _refused(f"--token-file {file}: letters and digits, at least {_SHORTEST_TOKEN}", "token")
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
