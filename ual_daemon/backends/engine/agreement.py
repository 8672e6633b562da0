"""Verdicts on a vehicle: on what several samples agree, never against a flight. Pure logic: callers pass the time.

A message may be damaged, another program's, or forged where messages are not signed. So nothing that ends a flight or
lasts (a kind, an identity, an ability, a conflict) follows from one of them.
"""

from __future__ import annotations

import math
from typing import Generic, TypeVar

from ual_daemon.backends.values import LandedState, Sample

T = TypeVar("T")

AGREEING_COUNT, AGREEING_S = 3, 1.0
"""Consecutive samples that make a verdict, and the least seconds that they span. A burst of one program's is
shorter.
"""
SAMPLE_LAPSE_S = 2.5
"""A sample that is older than this agrees with none that comes later. A heartbeat comes each second."""
AGREEING_SAMPLES_COUNT = 2
"""Consecutive samples that replace a verdict whose samples have ended (`ended_s`), however fast they come."""
FIRST_VERDICT_S = 5.0
"""Seconds from its beginning within which a first verdict counts in flight, too: a daemon may begin during a flight."""
OLD_ARMED_SAMPLE_S = 2.5
"""Seconds without a report that it is armed after which a flight is none that a verdict could end."""
FLIGHT_END_S = 1.0
"""Seconds on the ground, or disarmed, after which the flight has ended."""


class AirborneWatch:
    """Whether the vehicle is in the air, as far as verdicts have to wait for that."""

    def __init__(self) -> None:
        self._in_flight_s = -math.inf

    def update(self, armed: Sample[bool] | None, landed: Sample[LandedState] | None, now_s: float) -> None:
        """Takes the newest data; to be called often."""
        is_armed = armed is not None and armed.value and now_s - armed.time_s <= OLD_ARMED_SAMPLE_S
        if is_armed and (landed is None or landed.value is not LandedState.ON_GROUND):
            self._in_flight_s = now_s

    def is_flying(self, now_s: float) -> bool:
        """Returns whether it is in the air, or was a moment ago."""
        return now_s - self._in_flight_s <= FLIGHT_END_S


class Agreement(Generic[T]):
    """One verdict. It begins as an assumption, which the first sample that says the same settles.

    Samples that say something else become the verdict once enough of them agree, with none between them that says what
    the verdict is. In flight they are `pending` until the flight has ended, if they still come then. The
    assumption replaces a verdict that no sample has backed for `ends_s`.
    """

    def __init__(
        self,
        assumed: T,
        value: T | None = None,
        *,
        count: int = AGREEING_COUNT,
        span_s: float = AGREEING_S,
        ends_s: float = math.inf,
        ended_s: float = math.inf,
    ) -> None:
        self.value = assumed if value is None else value
        self.pending: T | None = None
        """Value on which the samples agree, where it must not count yet, as the vehicle flies."""
        self._assumed = assumed
        self._needed_count, self._span_s = count, span_s
        self._ends_s, self._ended_s = ends_s, ended_s
        self._begun_s = math.inf
        self._backed_s = -math.inf
        self._candidate: T | None = None
        self._count = 0
        self._since_s = self._sampled_s = -math.inf

    @property
    def is_open(self) -> bool:
        """Whether a sample has reported something else than the verdict, so that more of them are wanted."""
        return self._candidate is not None

    @property
    def is_backed(self) -> bool:
        """Whether a sample has confirmed the verdict."""
        return self._backed_s > -math.inf

    def note(self, sample: T, now_s: float, *, is_flying: bool) -> bool:
        """Takes a sample. Returns whether the verdict is another one now."""
        self._begun_s = min(self._begun_s, now_s)
        if sample == self.value:
            self._backed_s = now_s
            self._drop()
            return False
        if sample != self._candidate or now_s - self._sampled_s > SAMPLE_LAPSE_S:
            self._drop()
            self._candidate, self._since_s = sample, now_s
        self._count, self._sampled_s = self._count + 1, now_s
        return self._decide(now_s, is_flying=is_flying)

    def tick(self, now_s: float, *, is_flying: bool) -> bool:
        """Does what time does. Returns whether the verdict is another one now."""
        self._begun_s = min(self._begun_s, now_s)
        if now_s - self._sampled_s > SAMPLE_LAPSE_S:
            self._drop()
        if self.value != self._assumed and now_s - self._backed_s > self._ends_s:
            self.value, self._backed_s = self._assumed, -math.inf
            return True
        return self.pending is not None and self._decide(now_s, is_flying=is_flying)

    def _decide(self, now_s: float, *, is_flying: bool) -> bool:
        candidate, has_ended = self._candidate, self.is_backed and now_s - self._backed_s > self._ended_s
        do_agree = self._count >= self._needed_count and now_s - self._since_s >= self._span_s
        if candidate is None or not (do_agree or (has_ended and self._count >= AGREEING_SAMPLES_COUNT)):
            return False
        if is_flying and (self.is_backed or now_s - self._begun_s > FIRST_VERDICT_S):
            self.pending = candidate
            return False
        self.value, self._backed_s = candidate, now_s
        self._drop()
        return True

    def _drop(self) -> None:
        self.pending = self._candidate = None
        self._count = 0
