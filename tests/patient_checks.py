"""The conformance checks as tests, which a busy computer must not fail: what was not seen is looked at again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise

from typing_extensions import override

from ual import conformance
from ual.conformance import Check, CheckFailedError, Flight
from ual.types import Telemetry

_LONGEST_GAP_S = 0.5
"""Samples come 50 times a second of the vehicle's time. With a longer gap, a check judged what it did not see."""
_ATTEMPTS = 5


class PatientFlight(Flight):
    """A flight that knows whether its last check saw enough of the vehicle."""

    was_starved = False

    @override
    @contextmanager
    def observing(self) -> Iterator[None]:
        with super().observing():
            assert self._observer is not None
            samples = self._observer.samples
            try:
                yield
            finally:
                self.was_starved = _longest_gap_s(samples) > _LONGEST_GAP_S


def run_check(flight: PatientFlight, check: Check) -> None:
    """Runs a check; runs it again if it failed while this computer was too busy to receive what the vehicle sent."""
    for _ in range(_ATTEMPTS - 1):
        try:
            return conformance.run_check(flight, check)
        except CheckFailedError:
            if not flight.was_starved:
                raise
    return conformance.run_check(flight, check)


def _longest_gap_s(samples: Sequence[Telemetry]) -> float:
    return max((later.stamp_s - earlier.stamp_s for earlier, later in pairwise(list(samples))), default=0.0)
