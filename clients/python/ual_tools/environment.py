"""The environment variables that are read. One with a misspelled name would be ignored, and another UAV flown."""

from __future__ import annotations

from collections.abc import Iterable

import click

from ual_tools.help import close, did_you_mean

_PREFIX = "UAL_"
_OF_TESTS = "UAL_TEST_"
OF_CLIENTS = (
    "UAL_ADDRESS",
    "UAL_NETWORK",
    "UAL_NS",
    "UAL_RUNTIME_DIR",
    "UAL_TLS_CA",
    "UAL_TLS_CERTIFICATE",
    "UAL_TLS_KEY",
    "UAL_TOKEN",
    "UAL_TOKEN_FILE",
)
"""Those of `ual` and of programs that use the client."""
OF_DAEMON = (
    "UAL_ALLOW_ARMING",
    "UAL_AUDIT",
    "UAL_AUTO_ARM",
    "UAL_BACKEND",
    "UAL_CONFIG",
    "UAL_EXTENSION",
    "UAL_FLEET",
    "UAL_FLEET_URL",
    "UAL_INSECURE",
    "UAL_LISTEN",
    "UAL_LOG_FORMAT",
    "UAL_LOG_LEVEL",
    "UAL_NETWORK",
    "UAL_NS",
    "UAL_RECORD",
    "UAL_RECORD_RAW",
    "UAL_ROLES",
    "UAL_SET",
    "UAL_TLS_CERTIFICATE",
    "UAL_TLS_CLIENT_CA",
    "UAL_TLS_KEY",
    "UAL_TOKENS",
    "UAL_TRANSPORT",
    "UAL_URL",
    "UAL_WATCH_ONLY",
    "UAL_WORKERS",
)
"""Those of `ual-daemon`, which may be started from the same shell."""


def refuse_unknown(given: Iterable[str]) -> None:
    """Refuses a variable ``UAL_...`` that neither a client nor the daemon reads.

    Args:
        given: The names of all variables that are set.

    Raises:
        click.UsageError: Names the first one, and those with similar names.

    """
    known = {*OF_CLIENTS, *OF_DAEMON}
    for name in sorted(given):
        if name.startswith(_PREFIX) and name not in known and not name.startswith(_OF_TESTS):
            meant = did_you_mean(close(name, sorted(known))[:1])
            raise click.UsageError(f"{name}: there is no such environment variable.{meant}")
