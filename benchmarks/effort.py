"""Amount of measurement."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """Repetitions and durations of the measurements."""

    rounds: int
    paced_count: int
    """Setpoints of one way in one round."""
    flood_s: float
    listen_s: float
    start_rounds: int


FULL = Effort(rounds=7, paced_count=400, flood_s=1.5, listen_s=5.0, start_rounds=15)
QUICK = Effort(rounds=2, paced_count=100, flood_s=0.7, listen_s=2.5, start_rounds=5)

RATE_HZ = 50.0
"""The rate of setpoints that most programs use."""
SUBSCRIBERS = (1, 10, 100)
