"""The files with the rights of callers: ``--roles`` and ``--tokens``. They are read again when they have changed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ual.access import roles as role_names
from ual.access import tokens
from ual.access.roles import Role
from ual_daemon.program.configuration import ConfigurationError, DaemonSettings
from ual_daemon.server.access.policy import ANYBODY, Access, Roles
from ual_daemon.server.access.watched_file import WatchedFile
from ual_daemon.settings import ConfigError, Settings, convert


class _RolesFile(Settings, frozen=True, kw_only=True):
    """Content of the roles file, described in `docs/evidence/security.md`."""

    certificates: Mapping[str, str] = {}
    tokens: Mapping[str, str] = {}
    local: str = Role.COMMANDER.text
    nobody: str = Role.NONE.text


def access(settings: DaemonSettings) -> Access:
    """Returns the rights of callers of a daemon with these settings.

    Raises:
        ConfigError: A file cannot be read, others could change it, or it is wrong.

    """
    if settings.tls_client_ca is not None and settings.roles is None:
        raise ConfigError("certificates get their roles by a file: give --roles, too", "tls_client_ca")
    if settings.tokens is None and settings.roles is None:
        return ANYBODY if settings.insecure else Access()
    known_tokens = None
    if settings.tokens is not None:
        known_tokens = WatchedFile(Path(settings.tokens), "tokens", tokens.read, is_secret=True)
    if settings.roles is None:
        return Access(known_tokens=known_tokens)
    found = WatchedFile(Path(settings.roles), "roles", RolesReader().read, is_secret=False)
    return Access(lambda: found.value, known_tokens)


class RolesReader:
    """Reads a roles file, each time that it has changed. One that has lost a key is refused: it may be cut, and local
    callers would become commanders.
    """

    def __init__(self) -> None:
        self._keys: frozenset[str] = frozenset()

    def read(self, data: bytes) -> Roles:
        """Reads the file.

        Raises:
            ValueError: It is none; the message says where it is wrong.

        """
        from ual_daemon.program import configuration_yaml  # imported late: most daemons need no YAML

        if not data.strip():  # as while it is copied
            raise ValueError("it is empty")
        try:
            values = configuration_yaml.read_text(data)
            roles = _roles(convert(values, _RolesFile))
        except (ConfigurationError, ConfigError) as error:
            raise ValueError(str(error)) from None
        lost = sorted(self._keys - values.keys())
        if lost:
            raise ValueError(f"it has no {lost[0]} any more, so it may be cut: write that key as well, or restart")
        self._keys = frozenset(values)
        return roles


def _roles(file: _RolesFile) -> Roles:
    return Roles(
        certificates=_named(file.certificates, "certificates"),
        tokens=_named(file.tokens, "tokens"),
        local=_role(file.local, "local"),
        nobody=_role(file.nobody, "nobody"),
    )


def _named(names: Mapping[str, str], section: str) -> dict[str, Role]:
    return {name: _role(text, f"{section}.{name}") for name, text in names.items()}


def _role(text: str, key: str) -> Role:
    try:
        return role_names.parse(text)
    except ValueError as error:
        raise ConfigError(str(error), key) from None
