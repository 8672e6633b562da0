"""The settings of the light simulation (section ``light`` of the configuration)."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from ual_daemon.settings import Angle, GeoPosition, NotNegative, Position, Positive, Settings

Percent = Annotated[float, Meta(ge=0.0, le=100.0)]


class LightSettings(Settings, frozen=True, kw_only=True):
    """One simulated multirotor and its world.

    `speed_factor` is how fast simulated time runs: 1 is real time, with 0 the time stands still until it is stepped,
    "max" is as fast as the computer can. `origin_geo` is the origin of the local frame on Earth (latitude, longitude,
    metres above mean sea level). The ground is level, at the height of `start`. `takes` says which setpoints the
    simulated autopilot takes (see `ual_daemon.backends.values.Takes`).
    """

    speed_factor: Annotated[float, Meta(ge=0.0, le=100.0)] | Literal["max"] = 1.0
    horizontal_speed_m_s: Positive = 1.6
    vertical_speed_m_s: Positive = 1.2
    horizontal_acceleration_m_s2: Positive = 2.0
    vertical_acceleration_m_s2: Positive = 1.5
    yaw_rate_rad_s: Positive = 1.0
    takes: Literal["all", "positions", "velocities"] = "all"
    response_s: Annotated[float, Meta(ge=0.05, le=10.0)] = 0.3
    landing_speed_m_s: Positive = 0.7
    disarm_after_landing_s: NotNegative = 2.0
    start: Position = (0.0, 0.0, 0.0)
    start_yaw_rad: Angle = 0.0
    origin_geo: GeoPosition = (37.4117, -6.0013, 10.0)
    geoid_separation_m: Annotated[float, Meta(ge=-200.0, le=200.0)] = 49.5
    battery_percent: Percent = 100.0
    battery_endurance_s: Positive = 1200.0
    position_noise_m: NotNegative = 0.0
    velocity_noise_m_s: NotNegative = 0.0
    wind_m_s: Position = (0.0, 0.0, 0.0)
    seed: int = 0
