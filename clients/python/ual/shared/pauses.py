"""Pauses between tries, which grow: a fault that goes on costs little, and one that ends is noticed soon."""

from __future__ import annotations


class GrowingPauses:
    """Growing pauses before a failed attempt is repeated. Times are of any clock that does not jump, in seconds.

    Each pause is twice as long as the one before, up to the longest, and short again once it worked for so long.
    """

    def __init__(self, first_s: float = 0.5, longest_s: float = 8.0) -> None:
        self._first_s, self._longest_s = first_s, longest_s
        self._pause_s = first_s
        self._due_s = float("-inf")

    def is_due(self, now_s: float) -> bool:
        """Returns whether to try now."""
        return now_s >= self._due_s

    def failed(self, now_s: float) -> None:
        """Takes note that a try has failed."""
        has_worked = now_s - self._due_s > self._longest_s
        self._pause_s = self._first_s if has_worked else min(2.0 * self._pause_s, self._longest_s)
        self._due_s = now_s + self._pause_s
