"""Recent quality of the link."""

from __future__ import annotations

from typing import NamedTuple


class LinkReport(NamedTuple):
    """Recent quality of the link to the autopilot; None for values that a backend does not measure.

    `rate_hz` is the autopilot's messages per second, `loss` the part of them that did not arrive (0 to 1), and
    `round_trip_s` the time of the newest request and answer. `lost_count` is how often the link was lost, and
    `reboots_count` how often the autopilot has rebooted, both since the start.
    """

    rate_hz: float | None = None
    loss: float | None = None
    round_trip_s: float | None = None
    lost_count: int | None = None
    reboots_count: int | None = None
