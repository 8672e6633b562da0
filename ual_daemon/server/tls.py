"""TLS credentials of the server, checked at start: gRPC accepts any bytes, and fails later with each connection."""

from __future__ import annotations

import shlex
import stat
from contextlib import suppress
from pathlib import Path

import grpc

from ual_daemon.server import bounded_file
from ual_daemon.settings import ConfigError


def credentials(certificate: str | None, key: str | None) -> grpc.ServerCredentials | None:
    """Returns credentials from the PEM files of a certificate (chain) and its key, or None where neither is given.

    Raises:
        ConfigError: One of them is missing, unreadable, readable for all, encrypted, or does not belong to the other.

    """
    if certificate is None and key is None:
        return None
    if certificate is None or key is None:
        missing = "tls_certificate" if certificate is None else "tls_key"
        raise ConfigError("a certificate and its key are needed together", missing)
    _require_private(key)
    chain, private = _read(certificate, "tls_certificate"), _read(key, "tls_key")
    import ssl

    def refuse_password() -> str:
        raise ConfigError(f"{key} is encrypted: a daemon cannot ask for the password", "tls_key")

    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, refuse_password)
    except ssl.SSLError as error:
        raise ConfigError(
            f"{certificate} and {key} are no certificate with its key ({error.reason or error})", "tls_certificate"
        ) from None
    return grpc.ssl_server_credentials([(private, chain)])


def _require_private(key: str) -> None:
    """Refuses a key that every user of the computer can read."""
    with suppress(OSError):  # `_read` reports it
        if Path(key).stat().st_mode & stat.S_IRWXO:
            raise ConfigError(
                f"every user of this computer can read or change {key}: run `chmod o-rwx {shlex.quote(key)}`, and "
                "replace the key if it may have been copied",
                "tls_key",
            )


def _read(path: str, setting: str) -> bytes:
    try:
        return bounded_file.read(Path(path))
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}", setting) from None
