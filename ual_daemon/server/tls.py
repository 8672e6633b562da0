"""TLS credentials of the server, checked before they are used: gRPC itself would accept anything and then fail."""

from __future__ import annotations

from pathlib import Path

import grpc

from ual_daemon.settings import ConfigError


def credentials(certificate: str | None, key: str | None) -> grpc.ServerCredentials | None:
    """Credentials from a certificate (chain) and its key, both PEM files; None without. Raises `ConfigError`."""
    if certificate is None and key is None:
        return None
    if certificate is None or key is None:
        missing = "tls_certificate" if certificate is None else "tls_key"
        raise ConfigError("a certificate and its key are needed together", missing)
    chain, private = _read(certificate, "tls_certificate"), _read(key, "tls_key")
    import ssl

    def refuse_password() -> str:
        raise ConfigError(f"{key} is encrypted; a daemon has nobody to ask for the password", "tls_key")

    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, refuse_password)
    except ssl.SSLError as error:
        raise ConfigError(
            f"{certificate} and {key} are no certificate with its key ({error.reason or error})", "tls_certificate"
        ) from None
    return grpc.ssl_server_credentials([(private, chain)])


def _read(path: str, setting: str) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}", setting) from None
