"""The round-trip time of the link, measured by TIMESYNC."""

from __future__ import annotations

REQUEST_INTERVAL_S = 1.0
_ANSWER_LIMIT_S = 5.0
"""An answer that is later than this is not a measurement."""


class Timesync:
    """Measures how long a message and its answer take. The times in requests are ours, in nanoseconds."""

    def __init__(self) -> None:
        self.round_trip_s: float | None = None
        """The newest measurement."""
        self._next_s = float("-inf")
        self._requested_ns: dict[int, None] = {}

    def request_ns(self, now_s: float) -> int | None:
        """Returns the time to send in a request when one is due, else None."""
        if now_s < self._next_s:
            return None
        self._next_s = now_s + REQUEST_INTERVAL_S
        requested_ns = max(1, round(now_s * 1e9))
        oldest_ns = requested_ns - round(_ANSWER_LIMIT_S * 1e9)
        self._requested_ns = {
            **{each: None for each in self._requested_ns if each >= oldest_ns},
            requested_ns: None,
        }
        return requested_ns

    def on_answer(self, requested_ns: int, now_s: float) -> None:
        """Takes an answer; one to another program's request, or to one that was answered before, does not count."""
        if requested_ns in self._requested_ns:
            del self._requested_ns[requested_ns]
            self.round_trip_s = max(0.0, now_s - requested_ns / 1e9)
