"""The environment variables that UAL reads, for the command and the library alike.

One that is ignored, or has a misspelled name, would have another UAV flown.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TypeVar

from ual.errors import InvalidArgumentError

N = TypeVar("N")

ADDRESS_VARIABLE = "UAL_ADDRESS"
NETWORK_VARIABLE = "UAL_NETWORK"
NS_VARIABLE = "UAL_NS"
CA_VARIABLE = "UAL_TLS_CA"
_PREFIX = "UAL_"
_OF_TESTS = "UAL_TEST_"
_NAME_SIMILARITY = 0.75
"""Least similarity of a name to be proposed: all have the same beginning."""
OTHERS_VARIABLE = "UAL_OTHER_VARIABLES"
"""Names, separated by commas, of variables ``UAL_...`` that belong to programs other than UAL."""
OF_CLIENTS = (
    ADDRESS_VARIABLE,
    NETWORK_VARIABLE,
    NS_VARIABLE,
    "UAL_NTRIP_PASSWORD",
    "UAL_NTRIP_USER",
    OTHERS_VARIABLE,
    "UAL_RUNTIME_DIR",
    CA_VARIABLE,
    "UAL_TLS_CERTIFICATE",
    "UAL_TLS_KEY",
    "UAL_TOKEN",
    "UAL_TOKEN_FILE",
)
"""Variables of `ual` and of programs that use the client."""
OF_DAEMON = (
    "UAL_ALLOW_ARMING",
    "UAL_AUDIT",
    "UAL_AUDIT_REQUIRED",
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
    "UAL_METRICS",
    "UAL_NETWORK",
    "UAL_NS",
    "UAL_RECORD",
    "UAL_RECORD_PICTURES",
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
"""Variables of `ual-daemon`, which may be started from the same shell."""


def value(name: str) -> str | None:
    """Returns what a variable says; None where it is not set, or empty."""
    return os.environ.get(name) or None


def resolve_target(address: str | None, network: N | None) -> tuple[str | None, N | str | None]:
    """Returns the address at which, or else the network on which, a UAV is looked for; neither: on this computer.

    What a program says goes before the environment. An empty text says that neither is meant.

    Args:
        address: The address that the program gives.
        network: The network that it gives.

    Raises:
        InvalidArgumentError: Both are said, by the program or by the environment.

    """
    if address is None and network is None:
        address, network_named = value(ADDRESS_VARIABLE), value(NETWORK_VARIABLE)
        if address and network_named:
            raise InvalidArgumentError(
                f"{ADDRESS_VARIABLE} and {NETWORK_VARIABLE} both say where the UAV is: unset one of them",
                {"field": "environment"},
            )
        return address, network_named
    if address and network:
        raise InvalidArgumentError(
            "address: the network says where it is: leave out the address, or the network", {"field": "address"}
        )
    return address or None, network or None


def require_known() -> None:
    """Refuses an environment with a variable ``UAL_...`` that nothing reads.

    Raises:
        InvalidArgumentError: There is one. The message asks which was meant.

    """
    if mistake := mistake_in(os.environ):
        raise InvalidArgumentError(mistake, {"field": "environment"})


def mistake_in(variables: Mapping[str, str]) -> str:
    """Returns what is wrong with the first variable ``UAL_...`` that neither a client nor the daemon reads.

    Args:
        variables: All variables that are set.

    Returns:
        A message that asks which variable was meant; empty where all are known.

    """
    known = {*OF_CLIENTS, *OF_DAEMON}
    others = {name.strip() for name in variables.get(OTHERS_VARIABLE, "").split(",")}
    for name in sorted(each for each in variables if each.startswith(_PREFIX)):
        if name not in known and name not in others and not name.startswith(_OF_TESTS):
            return f"{name}: UAL reads no environment variable of this name{_did_you_mean(name, known)}"
    return ""


def _did_you_mean(name: str, known: set[str]) -> str:
    import difflib  # imported late: only a mistake needs it

    alike = difflib.get_close_matches(name, sorted(known), n=1, cutoff=_NAME_SIMILARITY)
    return f"; did you mean {alike[0]}?" if alike else f"; unset it, or list it in {OTHERS_VARIABLE}"
