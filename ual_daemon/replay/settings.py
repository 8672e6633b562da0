"""The settings of a recording that is played."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from ual_daemon.settings import NotNegative, Positive, Settings

SECTION = "replay"


class ReplaySettings(Settings, frozen=True, kw_only=True):
    """The section ``replay`` of the configuration.

    `speed_factor` says how fast it is played, and `begin_s` from which second of the recording on. With `loop` it
    begins again at its end. `uav` is the UAV of the recording (None: that of ``--ns``, or the only one). `is_decoded`:
    raw packets, where there are some, are decoded again; else all is reported as it was. `system_id` is the only
    autopilot that is decoded (None: the first received).
    """

    speed_factor: Positive = 1.0
    begin_s: NotNegative = 0.0
    loop: bool = False
    uav: str | None = None
    is_decoded: bool = True
    system_id: Annotated[int, Meta(ge=1, le=255)] | None = None
