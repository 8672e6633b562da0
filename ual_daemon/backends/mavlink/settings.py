"""Settings of the backend."""

from __future__ import annotations

import re
from typing import Annotated

from msgspec import Meta

from ual_daemon.backends.firmwares.feed_forward import Drag
from ual_daemon.settings import Settings

SECTION = "mavlink"
FIRST_SYSTEM_PORT = 14540
"""The port to which PX4's simulator sends the onboard stream of its first vehicle; the next one's is one higher."""

MavlinkId = Annotated[int, Meta(ge=1, le=254)]
ComponentId = Annotated[int, Meta(ge=0, le=255)]


PictureHost = Annotated[
    str,
    Meta(
        pattern=r"^([0-9A-Za-z._-]+|\[[0-9A-Fa-f:.]+\]|[0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*)(:[0-9]{1,5})?(/[^?#\s]*)?$"
    ),
]
"""``HOST``, ``HOST:PORT``, ``HOST:PORT/PATH``; an address of IPv6 with a port is in brackets."""


class MavlinkSettings(Settings, frozen=True, kw_only=True):
    """The section ``mavlink`` of the configuration.

    `url` is where the autopilot is (default: see `default_url`). `system_id` is the only autopilot that is received
    (None: the first received), and `autopilot_component_id` its component (None: 1, or another one that is surely an
    autopilot's). `component_id` is ours, beside the autopilot in its system; two programs on one vehicle
    need different ones. `pose_rate_hz` is the rate at which position and attitude are requested. With
    `learns_feed_forward` PX4's drag and the error of its estimate are learned and compensated: see `FeedForward`;
    `drag_1_s` is the drag that it begins with.
    With `has_camera_trigger` the autopilot itself triggers a camera, which is offered as the first one.
    `picture_hosts` are the hosts from which pictures of cameras are fetched by HTTP, ``HOST`` or ``HOST:PORT/PATH``.
    `signing_key_file` holds the key of an autopilot that signs its messages: see `signing.read_key`.
    """

    url: str | None = None
    system_id: MavlinkId | None = None
    autopilot_component_id: ComponentId | None = None
    component_id: MavlinkId = 191
    pose_rate_hz: Annotated[float, Meta(ge=5.0, le=200.0)] = 50.0
    learns_feed_forward: bool = True
    drag_1_s: Drag = 0.0
    signing_key_file: str | None = None
    has_camera_trigger: bool = False
    picture_hosts: tuple[PictureHost, ...] = ()


def default_url(ns: str) -> str:
    """Returns where PX4's simulator sends the vehicle of a namespace: ``uav_2`` is at 14541. Loopback only."""
    number = re.search(r"_(\d{1,5})$", ns)
    port = FIRST_SYSTEM_PORT + (int(number[1]) if number else 1) - 1
    return f"udpin://127.0.0.1:{port}"
