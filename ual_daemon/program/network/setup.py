"""Reads the settings of ``--network``, and refuses at the start what could not work."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ual.errors import UalError
from ual.network import keys, session, settings
from ual_daemon.program.network import identity
from ual_daemon.server import tls
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from ual.network.settings import NetworkSettings
    from ual_daemon.program.network.publisher import Publisher

_KEY = "network"


def publisher(config: str | None, names: Sequence[str]) -> Publisher | None:
    """Returns what tells the network of a daemon with these UAVs; None where no network is wanted.

    Raises:
        ConfigError: The settings are not valid, the certificate cannot be used or is another's, or the extra is
            not installed.

    """
    if config is None:
        return None
    found, name = _read(config), keys.publisher(names)
    if found.has_certificate:
        identity.require(found, name)
    from ual_daemon.program.network.publisher import Publisher  # imported late: it loads Zenoh

    return Publisher(found, name)


def _read(config: str) -> NetworkSettings:
    try:
        session.require("--network", "ual-daemon[network]")
        found = settings.read(config)
    except UalError as error:
        raise ConfigError(error.message, _KEY) from None
    if found.has_certificate:
        try:
            tls.credentials(str(found.certificate), str(found.key), str(found.authority))
        except ConfigError as error:
            raise ConfigError(error.message, _KEY) from None
    return found
