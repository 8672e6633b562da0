"""Display of one UAV at one moment: its position, its colour and its words. Pure; draws nothing.

Everything is in `map`. A value that is not known, or that is too old to be the present, is None or grey.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime, timezone

from ual.geometry import Pose, Transform
from ual.types import State, Telemetry
from ual_tools import condition, positions
from ual_tools.condition import UavCondition, Urgency, problem
from ual_tools.output import running_text
from ual_tools.view.palette import Colour
from ual_tools.watch_board import WatchedUav

MODEL_NAMES = ("quadrotor", "hexarotor", "manipulator", "crazyflie")

GREY: Colour = (128, 128, 128)
_COLOURS: dict[State, Colour] = {
    State.UNINITIALIZED: (214, 39, 40),
    State.LANDED_DISARMED: (90, 110, 140),
    State.LANDED_ARMED: (148, 103, 189),
    State.TAKING_OFF: (23, 170, 190),
    State.FLYING_AUTO: (44, 160, 44),
    State.FLYING_MANUAL: (240, 170, 10),
    State.LANDING: (23, 170, 190),
}

_FLYING = (State.TAKING_OFF, State.FLYING_AUTO, State.FLYING_MANUAL, State.LANDING)


@dataclass(frozen=True, slots=True)
class Shown:
    """One UAV as it is drawn.

    `body` and `reference` are in `map`; `odom` is the transform from ``<ns>/odom`` to `map`. A UAV that `is_lost` stays
    where it was last seen, in grey, without a reference. `age_s` is how old its pose is, `height_m` how far above home.
    """

    ns: str
    label: str
    colour: Colour
    how: UavCondition = UavCondition()  # noqa: RUF009 (frozen)
    battery: str = ""
    mark: Colour = GREY
    task: str = ""
    is_lost: bool = True
    age_s: float = 0.0
    is_armed: bool = False
    is_flying: bool = False
    body: Pose | None = None
    reference: Pose | None = None
    odom: Transform | None = None
    height_m: float | None = None
    speed_m_s: float | None = None
    off_reference_m: float | None = None


def shown(
    ns: str,
    watched: WatchedUav,
    *,
    now_s: float,
    utc_s: float,
    lost_after_s: float,
    pose_since_s: float | None = None,
    mark: Colour = GREY,
) -> Shown:
    """Returns how a UAV is drawn now.

    Args:
        ns: Its name.
        watched: What is known of it.
        now_s: The monotonic time.
        utc_s: The same moment since 1970.
        lost_after_s: How old the telemetry and the pose may be to be the present.
        pose_since_s: The monotonic time at which the newest pose came; None: the pose is as old as the telemetry.
        mark: Its own colour.

    """
    telemetry = watched.telemetry
    since_s = watched.since_s if pose_since_s is None else pose_since_s
    age_s = now_s - since_s
    lost = _lost_text(watched, since_s, now_s=now_s, utc_s=utc_s, lost_after_s=lost_after_s)
    how = UavCondition(Urgency.ALARM, "LOST", lost, lost) if lost else condition.uav_condition(watched, now_s, math.inf)
    if telemetry is None:
        return Shown(ns, f"{ns}: {lost or 'no telemetry yet'}", GREY, how, mark=mark)
    body, odom = positions.body(telemetry), positions.odom(telemetry)
    if lost:
        return Shown(ns, f"{ns}: {lost}", GREY, how, mark=mark, age_s=age_s, body=body, odom=odom)
    return Shown(
        ns,
        _label(ns, telemetry),
        _COLOURS[telemetry.state],
        how,
        condition.batteries_text(telemetry),
        mark,
        task="" if telemetry.task is None else running_text(telemetry.task),
        is_lost=False,
        age_s=age_s,
        is_armed=telemetry.armed,
        is_flying=telemetry.state in _FLYING,
        body=body,
        reference=positions.reference(telemetry),
        odom=odom,
        height_m=None if telemetry.odometry is None else telemetry.odometry.pose.position.z,
        speed_m_s=None if telemetry.velocity is None else telemetry.velocity.linear.norm(),
        off_reference_m=_off_reference_m(telemetry),
    )


def clock_text(utc_s: float) -> str:
    """Returns a time since 1970 as the time of the day, in UTC."""
    return f"{datetime.fromtimestamp(utc_s, timezone.utc):%H:%M:%S} UTC"


def _lost_text(watched: WatchedUav, pose_since_s: float, *, now_s: float, utc_s: float, lost_after_s: float) -> str:
    """Returns since when the UAV is lost, and why; nothing while its sample may be taken for the present."""
    what, since_s, t = problem(watched, now_s, lost_after_s), watched.since_s, watched.telemetry
    if not what and t is not None and now_s - pose_since_s >= lost_after_s:
        # The daemon does not hear the autopilot, and sends again what it knew last.
        since_s = pose_since_s
        what = f"no new pose for {now_s - since_s:.0f} s, it is {t.state.name} ({t.state_reason})"
    since = "never seen" if t is None else f"LOST since {clock_text(utc_s - (now_s - since_s))}"
    return what and f"{since}: {what}"


def _label(ns: str, t: Telemetry) -> str:
    if t.frame_lost:
        return f"{ns} {t.state.name}: FRAME LOST"
    return f"{ns} {t.state.name}"


def _off_reference_m(t: Telemetry) -> float | None:
    if t.pose is None or t.reference_pose is None:
        return None
    return (t.pose.position - t.reference_pose.position).norm()
