"""Credentials that a client shows to a daemon."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ual.errors import InvalidArgumentError
from ual.shared import environment

if TYPE_CHECKING:
    from pathlib import Path

TOKEN_VARIABLE = "UAL_TOKEN"  # noqa: S105  a name
TOKEN_FILE_VARIABLE = "UAL_TOKEN_FILE"  # noqa: S105  a name
CERTIFICATE_VARIABLE = "UAL_TLS_CERTIFICATE"
KEY_VARIABLE = "UAL_TLS_KEY"


@dataclass(frozen=True)
class Credentials:
    """A token, or the certificate of this program with its key (PEM files), or both.

    Args:
        token: As `ual token new` has printed it. It is never sent without TLS beyond this computer.
        tls_certificate: The certificate, with those between it and its authority.
        tls_key: Its private key.

    Example:
        >>> laptop = ual.Credentials(token=Path("laptop.token").read_text())
        >>> uav = ual.Uav(address="uav-1.local:50051", tls_ca="authority.pem", credentials=laptop)

    """

    token: str | None = field(default=None, repr=False)
    tls_certificate: str | Path | None = None
    tls_key: str | Path | None = None

    def __post_init__(self) -> None:
        if (self.tls_certificate is None) != (self.tls_key is None):
            raise InvalidArgumentError("a certificate and its key are needed together", {"field": "tls_certificate"})
        if self.token is not None and not isinstance(self.token, str):
            text = f"token: it is of type {type(self.token).__name__}; pass text, as Path(...).read_text() returns it"
            raise InvalidArgumentError(text, {"field": "token"})
        if self.token is not None and not (self.token.strip().isascii() and self.token.strip().isprintable()):
            raise InvalidArgumentError(
                "token: it is no token: one line of text, as `ual token new` prints it (--token-file, UAL_TOKEN)",
                {"field": "token"},
            )

    @classmethod
    def from_environment(
        cls,
        token_file: str | Path | None = None,
        tls_certificate: str | Path | None = None,
        tls_key: str | Path | None = None,
    ) -> Credentials:
        """Returns those of the environment: UAL_TOKEN or UAL_TOKEN_FILE, UAL_TLS_CERTIFICATE and UAL_TLS_KEY.

        Args:
            token_file: A file with a token, instead of that of the environment.
            tls_certificate: A certificate, instead of that of the environment.
            tls_key: Its private key.

        Raises:
            InvalidArgumentError: A file cannot be read.

        """
        if token_file is not None:
            token: str | None = read_token(token_file, "token_file")
        elif (token := environment.value(TOKEN_VARIABLE)) is None and (file := environment.value(TOKEN_FILE_VARIABLE)):
            token = read_token(file, TOKEN_FILE_VARIABLE)
        return cls(
            token,
            tls_certificate or environment.value(CERTIFICATE_VARIABLE),
            tls_key or environment.value(KEY_VARIABLE),
        )

    def metadata(self, address: str, *, has_tls: bool) -> tuple[tuple[str, str], ...]:
        """Returns what each request to an address carries.

        Raises:
            InvalidArgumentError: The token would cross a network that others can read.

        """
        if self.token is None:
            return ()
        if not has_tls and not is_this_computer(address):
            raise InvalidArgumentError(
                f"token: it is not sent to {address} without TLS: say which certificate to trust (tls_ca, --tls-ca)",
                {"field": "token"},
            )
        return (("authorization", f"Bearer {self.token.strip()}"),)


def is_this_computer(address: str) -> bool:
    """Returns whether an address, ``host:port`` or ``unix:path``, is on this computer."""
    if address.startswith("unix:"):
        return True
    import ipaddress  # imported late, as below: `import ual` has credentials, and few programs use any

    host = address.rpartition(":")[0].strip("[]")
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def read_token(file: str | Path, field_name: str) -> str:
    """Returns the token in a file, as Windows writes it, too.

    Raises:
        InvalidArgumentError: It cannot be read, or is no text.

    """
    from ual.shared.text import decoded

    content = read(file, field_name)
    try:
        return decoded(content).strip()
    except ValueError as error:
        raise InvalidArgumentError(f"{field_name}: {file} {error}", {"field": field_name}) from None


def read(file: str | Path, field_name: str) -> bytes:
    """Returns the content of a file.

    Raises:
        InvalidArgumentError: It cannot be read.

    """
    try:
        with open(file, "rb") as opened:  # noqa: PTH123  without pathlib
            return opened.read()
    except OSError as error:
        raise InvalidArgumentError(
            f"{field_name}: cannot read {file}: {error.strerror}", {"field": field_name}
        ) from None
