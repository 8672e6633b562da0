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


_NO_ANSWER = Inexpressible(
    "a refused setpoint is told in `health` and in the log: a topic has no answer",
    r"^(a pose|a reference|a velocity|Twist).*: expected \w+, but it was accepted$",
)
_NO_DRY_RUN = Inexpressible("there are no dry runs", "^dry_run$")
_NO_TASK = Inexpressible("no task is found by its identifier", "^task$")
_NO_FRAME = Inexpressible("frames are added by tf, which refuses none and removes none", "^add_frame$")
_NO_ROUTE = Inexpressible("the way of the running task is not told", "^route$")
_NO_GEOFENCE = Inexpressible("where the UAV may fly is not told", "^geofence$")
_NO_INFO = Inexpressible("who the UAV is, what it can do, and its limits are not told", "^info has no backend$")
_NO_CAMERAS = Inexpressible("cameras are topics and services: what they are and can do is not told", "^cameras$")
_NO_GIMBALS = Inexpressible("gimbals are not offered", "^gimbals$")
_NO_GRIPPER = Inexpressible("what a UAV carries is told in short, without bounds and positions", "^gripper$")
_NO_FENCE = Inexpressible("the autopilot's fence is not offered", "^fence$")
_NO_MISSIONS = Inexpressible("missions of the autopilot are not offered", "^mission$")
_NO_LOGS = Inexpressible("the autopilot's logs are not offered", "^logs$")
_NO_CORRECTIONS = Inexpressible("corrections of satellites are not offered", "^corrections$")
_NO_RATE = Inexpressible("the node has one `rate_hz` for all subscribers", "^rate_hz$")

INEXPRESSIBLE: Mapping[str, Inexpressible] = {
    "says_who_it_is": _NO_INFO,
    "a_slow_rate_leaves_out_samples": _NO_RATE,
    "the_geofence_is_told": _NO_GEOFENCE,
    "a_new_frame_can_be_used": _NO_FRAME,
    "bad_frames_are_refused": _NO_FRAME,
    "an_unknown_task_is_refused": _NO_TASK,
    "a_handle_reports_its_task": _NO_TASK,
    "takes_off_only_when_armed": _NO_DRY_RUN,
    "flies_nothing_on_the_ground": _NO_ANSWER,
    "bad_poses_from_outside_are_refused": _NO_ANSWER,
    "a_take_off_is_not_aborted": _NO_ANSWER,
    "a_dry_take_off_stays_on_the_ground": _NO_DRY_RUN,
    "a_dry_run_moves_nothing": _NO_DRY_RUN,
    "a_dry_run_refuses_what_is_refused": _NO_DRY_RUN,
    "keeps_below_a_speed": _NO_DRY_RUN,
    "holds_at_a_waypoint": _NO_DRY_RUN,
    "returns_home_and_lands": _NO_DRY_RUN,
    "a_goal_below_the_ground_is_refused": _NO_DRY_RUN,
    "bad_poses_are_refused": _NO_ANSWER,
    "bad_velocities_are_refused": _NO_ANSWER,
    "the_pilot_takes_over": _NO_ANSWER,
    "a_paused_task_holds_on_its_way_and_goes_on": _NO_ROUTE,
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
