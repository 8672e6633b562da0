"""The conformance checks that cannot be done over ROS, each with its reason. It needs no ROS.

docs/clients/ros2.md lists them, too; a test compares both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


class InexpressibleError(Exception):
    """The interface in ROS has nothing for a member of `ual.interface.Uav`. The message names the member."""


@dataclass(frozen=True)
class Inexpressible:
    """Why a check cannot be done, and what it says then, as a regular expression."""

    why: str
    says: str


_NO_CAMERAS = Inexpressible("cameras are topics and services: what they are and can do is not told", "^cameras$")
_NO_GIMBALS = Inexpressible("gimbals are not offered", "^gimbals$")
_NO_GRIPPER = Inexpressible("what a UAV carries is told in short, without bounds and positions", "^gripper$")
_NO_FENCE = Inexpressible("the autopilot's fence is not offered", "^fence$")
_NO_MISSIONS = Inexpressible("missions of the autopilot are not offered", "^mission$")
_NO_LOGS = Inexpressible("the autopilot's logs are not offered", "^logs$")
_NO_CORRECTIONS = Inexpressible("corrections of satellites are not offered", "^corrections$")
_NO_RATE = Inexpressible("the node has one `rate_hz` for all subscribers", "^rate_hz$")

INEXPRESSIBLE: Mapping[str, Inexpressible] = {
    "a_slow_rate_leaves_out_samples": _NO_RATE,
    "lists_the_cameras": _NO_CAMERAS,
    "takes_a_picture": _NO_CAMERAS,
    "shows_what_the_camera_sees": _NO_CAMERAS,
    "lists_what_it_carries": _NO_GRIPPER,
    "moves_only_what_is_configured": _NO_GRIPPER,
    "lists_the_gimbals": _NO_GIMBALS,
    "turns_a_gimbal": _NO_GIMBALS,
    "points_a_gimbal": _NO_GIMBALS,
    "reads_the_autopilots_fence": _NO_FENCE,
    "uploads_no_fence_in_flight": _NO_FENCE,
    "reads_the_autopilots_mission": _NO_MISSIONS,
    "keeps_an_uploaded_mission": _NO_MISSIONS,
    "flies_a_mission_of_the_autopilot": _NO_MISSIONS,
    "a_mission_of_the_autopilot_is_aborted": _NO_MISSIONS,
    "lists_the_autopilots_logs": _NO_LOGS,
    "downloads_a_log": _NO_LOGS,
    "passes_on_no_correction_that_is_damaged": _NO_CORRECTIONS,
}
