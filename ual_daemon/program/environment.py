"""The environment variables that are read. One with a misspelled name would be ignored, and another UAV flown."""

from __future__ import annotations

from collections.abc import Iterable

from ual_daemon.program.configuration import ConfigurationError
from ual_daemon.settings import did_you_mean

_PREFIX = "UAL_"
_OF_CLIENTS = ("UAL_ADDRESS", "UAL_RUNTIME_DIR", "UAL_TLS_CA", "UAL_TOKEN", "UAL_TOKEN_FILE")
_OF_TESTS = "UAL_TEST_"


def refuse_unknown(given: Iterable[str], options: Iterable[str]) -> None:
    """Refuses a variable ``UAL_...`` that neither the daemon nor a client reads.

    Args:
        given: The names of all variables that are set.
        options: The names of the daemon's options that a variable can set, as ``fleet_url``.

    Raises:
        ConfigurationError: Names the first one, and those with similar names.

    """
    known = {*_OF_CLIENTS, *(f"{_PREFIX}{name.upper()}" for name in options)}
    for name in sorted(given):
        if name.startswith(_PREFIX) and name not in known and not name.startswith(_OF_TESTS):
            raise ConfigurationError(f"{name}: there is no such environment variable{did_you_mean(name, known)}")
