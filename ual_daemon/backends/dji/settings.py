"""Settings of the backend."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from ual_daemon.settings import Positive, Settings

SECTION = "dji"


class DjiSettings(Settings, frozen=True, kw_only=True):
    """The section ``dji`` of the configuration.

    `least_gps_level` is the quality of the position (0 to 5, DJI's own) from which on the aircraft may be flown; DJI
    takes velocities from 3 on. `confirm_landing_below_m` is the height above the ground below which a landing that was
    asked for is confirmed. `response_s` is the time in which the aircraft follows a step of the velocity.
    """

    least_gps_level: Annotated[int, Meta(ge=0, le=5)] = 3
    confirm_landing_below_m: Annotated[float, Meta(gt=0.0, le=3.0)] = 1.0
    response_s: Positive = 0.7
