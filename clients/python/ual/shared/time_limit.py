"""Time limits of a caller's waits."""

from __future__ import annotations

from ual.errors import InvalidArgumentError

_LONGEST_LOCK_TIMEOUT_S = 1e9
"""Longer times count as no limit: gRPC's deadlines end 2**63 ns after 1970, and those of locks 2**63 ns from now."""


def time_limit(timeout_s: float | None) -> float | None:
    """Returns how long a caller waits; None if it waits without a limit.

    Raises:
        InvalidArgumentError: The value is not a time to wait.
    """
    if timeout_s is None:
        return None
    try:
        is_time = timeout_s >= 0.0
    except TypeError:
        is_time = False
    if not is_time:
        raise InvalidArgumentError(f"timeout_s: {timeout_s!r} is no time to wait", {"field": "timeout_s"})
    return timeout_s if timeout_s <= _LONGEST_LOCK_TIMEOUT_S else None
