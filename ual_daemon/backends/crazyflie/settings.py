"""The settings of the backend (section ``crazyflie`` of the configuration)."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, field

from ual_daemon.settings import Positive, Settings, TurnRate

SECTION = "crazyflie"


class CrazyflieSettings(Settings, frozen=True, kw_only=True):
    """The section ``crazyflie`` of the configuration.

    `url` is where the Crazyflie is (None: the only one that a scan finds). `pose_rate_hz` is the rate at which its pose
    is logged; the firmware takes whole multiples of 10 ms. `largest_position_std_m` is the standard deviation of its
    estimated position above which the position does not count. With `hovers_by_itself` a Crazyflie that is to stay
    where it is hovers by its own high-level commander, which the end of the daemon does not stop. `yaw_rate_rad_s` is
    the fastest turn. With `sends_orientation` poses from outside have their orientation, else only the position.
    `parameters` are
    parameters of the firmware that are set whenever it is connected (``posCtlPid.xVelMax``). `cache_directory` is where
    its tables of contents are kept (None: the user's cache).
    """

    url: str | None = None
    pose_rate_hz: Annotated[float, Meta(ge=5.0, le=100.0)] = 50.0
    largest_position_std_m: Positive = 0.5
    hovers_by_itself: bool = True
    yaw_rate_rad_s: TurnRate = 1.0
    sends_orientation: bool = True
    parameters: dict[str, float] = field(default_factory=dict)
    cache_directory: str | None = None
