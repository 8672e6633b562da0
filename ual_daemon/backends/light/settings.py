"""The settings of the light simulation (section ``light`` of the configuration)."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from msgspec import Meta

from ual_daemon.settings import (
    Angle,
    Coordinate,
    GeoPosition,
    NotNegative,
    Position,
    Positive,
    Settings,
    TurnRate,
)

Percent = Annotated[float, Meta(ge=0.0, le=100.0)]


ARUCO_0 = ("1011", "0101", "0011", "0010")
"""The cells of marker 0 of OpenCV's dictionary DICT_4X4_50."""


class LightMarkerSettings(Settings, frozen=True, kw_only=True):
    """A square marker on the ground, such as an ArUco marker or an AprilTag, with a black and a white border around it.

    `position` is x and y in the local frame, m. `size_m` is the side of its black border. `rows` are its cells from the
    upper left corner on: 1 is white. With a yaw of 0 its top is towards y.
    """

    position: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    size_m: Annotated[float, Meta(ge=0.01, le=1000.0)] = 1.0
    yaw_rad: Angle = 0.0
    rows: tuple[Annotated[str, Meta(pattern=r"^[01]{1,16}\Z")], ...] = ARUCO_0

    def __post_init__(self) -> None:
        if any(len(row) != len(self.rows) for row in self.rows) or not self.rows:
            raise ValueError(f"rows: a marker is a square, and not {' / '.join(self.rows) or 'empty'}")

    @property
    def cells(self) -> tuple[tuple[bool, ...], ...]:
        """The cells: True is white."""
        return tuple(tuple(each == "1" for each in row) for row in self.rows)


AngleLimits = tuple[Angle, Angle]


class LightGimbalSettings(Settings, frozen=True, kw_only=True):
    """A simulated gimbal at a `position` in the body (m).

    Each axis turns at no more than `speed_rad_s`, within its limits, the lower one first. A positive pitch looks down.
    """

    name: Annotated[str, Meta(min_length=1, max_length=64)] = "light gimbal"
    position: Position = (0.0, 0.0, 0.0)
    speed_rad_s: Annotated[float, Meta(ge=0.01, le=1000.0)] = 1.5
    roll_limits_rad: AngleLimits = (-0.5, 0.5)
    pitch_limits_rad: AngleLimits = (-0.5, math.pi / 2.0)
    yaw_limits_rad: AngleLimits = (-math.pi, math.pi)

    def __post_init__(self) -> None:
        for name in ("roll_limits_rad", "pitch_limits_rad", "yaw_limits_rad"):
            least_rad, most_rad = getattr(self, name)
            if not least_rad <= 0.0 <= most_rad:
                raise ValueError(f"{name}: its neutral angle, 0, is not from {least_rad:g} to {most_rad:g}")


class LightCameraSettings(Settings, frozen=True, kw_only=True):
    """A simulated camera: a pinhole without distortion.

    `horizontal_view_rad` is the angle from the left edge of its picture to the right one. It is mounted in the body at
    `mount_position` (m), and turned there by roll, pitch and yaw: with zeros it looks forward, with a pitch of pi / 2
    straight down. With a `gimbal` it is mounted on that one, in its axes: with zeros it looks where that looks. `noise`
    is the standard deviation of each colour, of 255.
    """

    name: Annotated[str, Meta(min_length=1, max_length=64)] = "light camera"
    width_px: Annotated[int, Meta(ge=16, le=4096)] = 640
    height_px: Annotated[int, Meta(ge=16, le=4096)] = 480
    horizontal_view_rad: Annotated[float, Meta(ge=0.05, le=2.8)] = 1.2
    gimbal: Annotated[int, Meta(ge=0, le=7)] | None = None
    mount_position: Position = (0.0, 0.0, 0.0)
    mount_roll_rad: Angle = 0.0
    mount_pitch_rad: Angle = math.pi / 2.0
    mount_yaw_rad: Angle = 0.0
    noise: Annotated[float, Meta(ge=0.0, le=255.0)] = 0.0
    storage_mib: Annotated[float, Meta(ge=0.0, le=1e9)] = 32_000.0
    markers: tuple[LightMarkerSettings, ...] = ()


class LightSettings(Settings, frozen=True, kw_only=True):
    """One simulated multirotor and its world.

    `speed_factor` is how fast simulated time runs: 1 is real time, with 0 the time stands still until it is stepped,
    "max" is as fast as the computer can. `origin_geo` is the origin of the local frame on Earth (latitude, longitude,
    metres above mean sea level). The ground is level, at the height of `start`. `takes` says which setpoints the
    simulated autopilot takes (see `ual_daemon.backends.values.Takes`). `cameras` are those that it carries: one that
    looks down, unless others are given. So are `gimbals`: one, on which nothing is mounted. `skip_lag` moves the stamps
    ahead where the computer is too slow for simulated time.
    """

    speed_factor: Annotated[float, Meta(ge=0.0, le=100.0)] | Literal["max"] = 1.0
    skip_lag: bool = False
    horizontal_speed_m_s: Positive = 1.6
    vertical_speed_m_s: Positive = 1.2
    horizontal_acceleration_m_s2: Positive = 2.0
    vertical_acceleration_m_s2: Positive = 1.5
    yaw_rate_rad_s: TurnRate = 1.0
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
    cameras: Annotated[tuple[LightCameraSettings, ...], Meta(max_length=8)] = (LightCameraSettings(),)
    gimbals: Annotated[tuple[LightGimbalSettings, ...], Meta(max_length=8)] = (LightGimbalSettings(),)

    def __post_init__(self) -> None:
        for camera in self.cameras:
            if camera.gimbal is not None and camera.gimbal >= len(self.gimbals):
                raise ValueError(
                    f"cameras: {camera.name} is on gimbal {camera.gimbal}, and there are {len(self.gimbals)}"
                )
