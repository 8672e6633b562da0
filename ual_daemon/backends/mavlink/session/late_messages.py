"""Late messages among those that the state needs, so that each is requested by itself. Pure logic."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ual_daemon.backends.engine.readings import Reading
from ual_daemon.backends.values import NEVER_S

LATE_TIME_SHARE = 0.4
"""A message is late once this part of its time has passed: its content is believed for the whole of it."""
REQUEST_S = 0.1
"""Seconds between two requests for late messages. On a link that loses 40 % each way, 14 requests bring one back in
99.9 %.
"""
RECENT_CONTACT_S = 0.5
"""Seconds of silence after which nothing is requested from an autopilot: its link is silent."""


class LateMessages:
    """Decides which messages are requested: those that came, and stay away for long while others come.

    A request for a stream may not have arrived on a bad link, or another program on it has lowered the rate. At its own
    rate of 1 Hz PX4's word on its position is missed after three losses in a row. `limits_s` has the messages by id,
    with what they say and for how long that is believed, in seconds.
    """

    def __init__(self, limits_s: Mapping[int, tuple[Reading[Any], float]]) -> None:
        self._late_s = [(each, reading, LATE_TIME_SHARE * limit_s) for each, (reading, limit_s) in limits_s.items()]
        self._next_s = -math.inf

    def due(self, now_s: float, heard_s: float | None) -> list[int]:
        """Returns the ids of what is to be requested now. `heard_s` is the time of the autopilot's last message."""
        if now_s < self._next_s or heard_s is None or now_s - heard_s > RECENT_CONTACT_S:
            return []
        late = [each for each, reading, late_s in self._late_s if _is_late(reading, late_s, now_s)]
        if late:
            self._next_s = now_s + REQUEST_S
        return late


def _is_late(reading: Reading[Any], late_s: float, now_s: float) -> bool:
    sample = reading.sample
    return sample is not None and sample.time_s != NEVER_S and now_s - sample.time_s > late_s
