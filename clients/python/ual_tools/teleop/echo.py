"""Measures how late the terminal is: over a slow link, keys arrive long after they were pressed.

Terminals answer the question for their status (DSR 5 of ECMA-48) at once. A terminal that has never answered, such as a
serial one, is taken for a fast one. A multiplexer (tmux, screen, mosh) answers by itself: what lies beyond is not seen.
"""

from __future__ import annotations

QUESTION = "\x1b[5n"
_ANSWER = b"\x1b[0n"
ECHO_PERIOD_S = 0.5
"""From an answer to the next question."""


class Echo:
    """Questions and answers of one terminal. The time is given, in seconds from anywhere."""

    def __init__(self) -> None:
        self._requested_s: float | None = None
        self._next_s = 0.0
        self._lag_s = 0.0
        self._is_answering = False
        self._rest = b""

    @property
    def is_awaited(self) -> bool:
        """Whether an answer is still to come."""
        return self._is_answering and self._requested_s is not None

    def asks(self, now_s: float) -> bool:
        """Returns whether the question is to be sent now, with the next picture."""
        if self._requested_s is not None or now_s < self._next_s:
            return False
        self._requested_s = now_s
        return True

    def filtered(self, read: bytes, now_s: float) -> bytes:
        """Returns what the terminal has sent without the answers. The beginning of one waits for its end."""
        read = self._rest + read
        if _ANSWER in read:
            self._answer(now_s)
        read = read.replace(_ANSWER, b"")
        length = next((n for n in (3, 2, 1) if read.endswith(_ANSWER[:n])), 0)
        self._rest = read[len(read) - length :]
        return read[: len(read) - length]

    def lag_s(self, now_s: float) -> float:
        """Returns how long the last answer took, or the one that is awaited takes already."""
        if not self._is_answering:
            return 0.0
        return max(self._lag_s, 0.0 if self._requested_s is None else now_s - self._requested_s)

    def _answer(self, now_s: float) -> None:
        if self._requested_s is not None:
            self._lag_s = now_s - self._requested_s
        self._is_answering, self._requested_s, self._next_s = True, None, now_s + ECHO_PERIOD_S
