"""How long a caller would wait."""

from __future__ import annotations

from ual.errors import InvalidArgumentError

_LONGEST_S = 1e9
"""Longer than anybody waits; gRPC cannot count to 2**63 ns after 1970, nor a lock to that many from now."""


def time_limit(timeout_s: float | None) -> float | None:
    """How long a caller would wait; None where he would wait for ever. `InvalidArgumentError` for what is no time."""
    if timeout_s is None:
        return None
    try:
        is_time = timeout_s >= 0.0
    except TypeError:
        is_time = False
    if not is_time:
        raise InvalidArgumentError(f"timeout_s: {timeout_s!r} is no time to wait", {"field": "timeout_s"})
    return timeout_s if timeout_s <= _LONGEST_S else None
