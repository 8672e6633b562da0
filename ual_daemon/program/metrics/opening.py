"""Address of the metrics (``--metrics``), and the packages that serving them needs. Imports prometheus_client only when
used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual.errors import NotSupportedError
from ual.shared import extras
from ual_daemon.server import addresses
from ual_daemon.server.addresses import Address
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from ual_daemon.program.configuration import DaemonSettings
    from ual_daemon.program.metrics.exporter import Exporter


class MetricsError(Exception):
    """The metrics cannot be served."""


def address_of(settings: DaemonSettings) -> Address | None:
    """Returns where the metrics are to be served; None if nowhere.

    Raises:
        ConfigError: It is no address, or other computers could read it.

    """
    if settings.metrics is None:
        return None
    try:
        address = addresses.parse(settings.metrics)
    except ConfigError as error:
        raise ConfigError(error.message, "metrics") from None
    if address.is_unix:
        raise ConfigError(f"{address}: metrics are served on HOST:PORT", "metrics")
    if not address.is_local and not settings.insecure:
        raise ConfigError(
            f"{address} can be read from other computers, without TLS: serve on 127.0.0.1 and let a Prometheus of this "
            "computer read it, or give --insecure where the network is trusted",
            "metrics",
        )
    return address


def exporter(settings: DaemonSettings) -> Exporter | None:
    """Returns what serves the metrics, with its port open; None if none are wanted.

    Raises:
        ConfigError: See `address_of`.
        MetricsError: The port cannot be had, or a package is missing; the message names the extra.

    """
    address = address_of(settings)
    if address is None:
        return None
    try:
        with extras.needs("--metrics", "ual-daemon[metrics]"):
            from ual_daemon.program.metrics.exporter import Exporter
        return Exporter(address)
    except NotSupportedError as error:
        raise MetricsError(str(error)) from None
    except OSError as error:
        raise MetricsError(f"cannot serve metrics on {address}: {error.strerror or error}") from None
