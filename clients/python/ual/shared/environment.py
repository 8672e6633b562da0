"""The environment variables that UAL reads. One with a misspelled name would be ignored, and another UAV flown."""

from __future__ import annotations

from collections.abc import Mapping

_PREFIX = "UAL_"
_OF_TESTS = "UAL_TEST_"
_LEAST_ALIKE = 0.75
"""How similar a name has to be to be meant: all begin alike."""
OTHERS_VARIABLE = "UAL_OTHER_VARIABLES"
"""Names, separated by commas, of variables ``UAL_...`` that belong to programs beside UAL."""
OF_CLIENTS = (
    "UAL_ADDRESS",
    "UAL_NETWORK",
    "UAL_NS",
    "UAL_NTRIP_PASSWORD",
    "UAL_NTRIP_USER",
    OTHERS_VARIABLE,
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
"""Those of `ual-daemon`, which may be started from the same shell."""


def mistake_in(given: Mapping[str, str]) -> str:
    """Returns what is wrong with the first variable ``UAL_...`` that neither a client nor the daemon reads.

    Args:
        given: All variables that are set.

    Returns:
        A message that asks which variable was meant; empty where all are known.

    """
    known = {*OF_CLIENTS, *OF_DAEMON}
    others = {name.strip() for name in given.get(OTHERS_VARIABLE, "").split(",")}
    for name in sorted(each for each in given if each.startswith(_PREFIX)):
        if name not in known and name not in others and not name.startswith(_OF_TESTS):
            return f"{name}: UAL reads no environment variable of this name{_did_you_mean(name, known)}"
    return ""


def _did_you_mean(name: str, known: set[str]) -> str:
    import difflib  # imported late: only a mistake needs it

    alike = difflib.get_close_matches(name, sorted(known), n=1, cutoff=_LEAST_ALIKE)
    return f"; did you mean {alike[0]}?" if alike else f"; unset it, or list it in {OTHERS_VARIABLE}"
