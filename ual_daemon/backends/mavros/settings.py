"""Settings of the backend."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from ual_daemon.backends.firmwares.feed_forward import Drag
from ual_daemon.settings import Settings

SECTION = "mavros"


class MavrosSettings(Settings, frozen=True, kw_only=True):
    """The section ``mavros`` of the configuration.

    `node` is the name of MAVROS' node, within the namespace of the URL. `pose_rate_hz` is the rate at which position
    and attitude are requested from the autopilot. With `has_camera_trigger` the autopilot itself triggers a camera,
    which is offered. With `learns_feed_forward` PX4's drag and the error of its estimate
    are learned and compensated: see `ual_daemon.backends.firmwares.feed_forward`; `drag_1_s` is the drag that it
    begins with.
    """

    node: Annotated[str, Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$")] = "mavros"
    pose_rate_hz: Annotated[float, Meta(ge=5.0, le=100.0)] = 50.0
    has_camera_trigger: bool = False
    learns_feed_forward: bool = True
    drag_1_s: Drag = 0.0
