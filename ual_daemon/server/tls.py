"""TLS credentials of the server, checked at start: gRPC accepts any bytes, and fails later with each connection.

The files are read again when they have changed, at the next handshake: a certificate is renewed without a restart.
"""

from __future__ import annotations

import logging
import shlex
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias, cast

import grpc

from ual.shared import bounded_file
from ual_daemon import logs
from ual_daemon.server.transport.base import MakeCredentials
from ual_daemon.settings import ConfigError

_Signature: TypeAlias = tuple[tuple[int, int, int], ...]

_log = logging.getLogger(__name__)


def credentials(certificate: str | None, key: str | None, client_ca: str | None = None) -> MakeCredentials | None:
    """Returns what makes credentials from the PEM files of a certificate (chain) and its key, or None where neither is
    given. Each address that is opened needs credentials of its own: gRPC takes those that are read again only once.

    With `client_ca`, PEM, callers have to show a certificate that this authority has signed.

    Raises:
        ConfigError: One of them is missing, unreadable, readable for all, encrypted, or does not belong to the other.

    """
    if certificate is None and key is None:
        if client_ca is not None:
            raise ConfigError(
                "callers show certificates only by TLS: give --tls-certificate and --tls-key, too", "tls_client_ca"
            )
        return None
    if certificate is None or key is None:
        missing = "tls_certificate" if certificate is None else "tls_key"
        raise ConfigError("a certificate and its key are needed together", missing)
    _Files(certificate, key, client_ca).read()

    def make() -> grpc.ServerCredentials:
        files = _Files(certificate, key, client_ca)
        # gRPC's types do not know that None means no change.
        changed = cast("Callable[[], grpc.ServerCertificateConfiguration]", files.changed)
        return grpc.dynamic_ssl_server_credentials(files.read(), changed, client_ca is not None)

    return make


class _Files:
    """The files of a server's credentials."""

    def __init__(self, certificate: str, key: str, client_ca: str | None) -> None:
        self._certificate, self._key, self._client_ca = certificate, key, client_ca
        self._signature = self._read_signature()

    def read(self) -> grpc.ServerCertificateConfiguration:
        """Reads them.

        Raises:
            ConfigError: See `credentials`.

        """
        _require_private(self._key)
        chain, private = _read(self._certificate, "tls_certificate"), _read(self._key, "tls_key")
        _require_pair(self._certificate, self._key)
        roots = None if self._client_ca is None else _read_authority(self._client_ca)
        return grpc.ssl_server_certificate_configuration([(private, chain)], roots)

    def changed(self) -> grpc.ServerCertificateConfiguration | None:
        """Returns what the files say now if they have changed, else None; gRPC asks at each handshake.

        Where they cannot be used, what they said before stays.
        """
        signature = self._read_signature()
        if signature == self._signature:
            return None
        self._signature = signature
        try:
            read = self.read()
        except ConfigError as error:
            logs.event(_log, logging.ERROR, "not_read_again", setting=error.key, why=error.message)
            return None
        logs.event(_log, logging.INFO, "read_again", setting="tls_certificate", file=self._certificate)
        return read

    def _read_signature(self) -> _Signature:
        found = []
        for path in filter(None, (self._certificate, self._key, self._client_ca)):
            with suppress(OSError):
                status = Path(path).stat()
                found.append((status.st_mtime_ns, status.st_ino, status.st_size))
        return tuple(found)


def _require_pair(certificate: str, key: str) -> None:
    import ssl

    def refuse_password() -> str:
        raise ConfigError(f"{key} is encrypted: a daemon cannot ask for the password", "tls_key")

    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key, refuse_password)
    except ssl.SSLError as error:
        raise ConfigError(
            f"{certificate} and {key} are no certificate with its key ({error.reason or error})", "tls_certificate"
        ) from None


def _read_authority(path: str) -> bytes:
    import ssl

    data = _read(path, "tls_client_ca")
    try:
        ssl.create_default_context(cadata=data.decode("ascii"))
    except (ssl.SSLError, ValueError) as error:
        raise ConfigError(f"{path} has no certificate of an authority ({error})", "tls_client_ca") from None
    return data


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
