"""A thousand goals that cannot be flown, by services and actions: each is refused, and the UAV stays where it is."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import Any

import pytest
from conftest import ARMED_FAST, Processes
from flying import Client, pose, waited
from nav_msgs.msg import Path
from sensor_msgs.msg import NavSatFix
from ual_msgs import action, srv

import ual

UAL = "/uav_1/ual"


@pytest.fixture(scope="module")
def uav(processes: Processes) -> Iterator[ual.Uav]:
    processes.daemon(*ARMED_FAST)
    processes.node("ns:=uav_1")
    with ual.Uav("uav_1") as uav:
        yield uav


AT_ONCE = 8
"""A service of ROS keeps ten requests that wait."""


def test_a_thousand_malformed_goals_are_refused_and_none_is_executed(client: Client, flying: ual.Uav) -> None:
    chosen = random.Random(36)
    begin = flying.pose().pose.position
    reasons: set[str] = set()
    for _ in range(1000 // AT_ONCE):
        answers = [_malformed(client, chosen) for _ in range(AT_ONCE)]
        reasons |= {_reason(answer) for answer in answers}
    assert reasons == {"INVALID_ARGUMENT", "UNKNOWN_FRAME", "GEOFENCE"}
    assert (flying.pose().pose.position - begin).norm() < 0.1
    assert flying.telemetry().task is None


def _reason(answer: Any) -> str:
    """The reason in the answer of a service or the end of an action; empty where it was not refused."""
    waited(answer.done)
    ended = answer.result()
    return str(getattr(ended, "result", ended).reason)


BAD = (math.nan, math.inf, -math.inf, 1e30, -1e30, 1e308)
FREQUENCIES = (4, 4, 1, 4, 4, 4, 4)
"""The node waits 0.3 s for a frame that it does not know."""


def _malformed(client: Client, chosen: random.Random) -> Any:
    """Sends one goal that cannot be flown; returns the future of its answer or end."""
    bad = chosen.choice(BAD)
    goal = pose(1.0, 1.0, 3.0)
    [case] = chosen.choices(range(7), FREQUENCIES)
    if case == 0:
        setattr(goal.pose.position, chosen.choice("xyz"), bad)
    elif case == 1:
        setattr(goal.pose.orientation, chosen.choice("xyzw"), chosen.choice((math.nan, math.inf, 1e30, -0.3)))
    elif case == 2:
        goal.header.frame_id = chosen.choice(("nowhere", "uav_2/odom", "/", "a" * 500, "\u2603", "map "))
    elif case == 3:
        goal.pose.position.z = chosen.choice((-3.0, -1000.0, 1e6))
    elif case == 4:
        speed = chosen.choice((math.nan, -1.0, 1e-9))
        return _end_of(client, action.GoToWaypoint, "go_to_waypoint", waypoint=goal, max_speed=speed)
    elif case == 5:
        fix = NavSatFix(latitude=chosen.choice((91.0, bad)), longitude=bad, altitude=bad)
        request = {"waypoint": fix, "altitude_reference": chosen.choice((0, 1, 2, 3, 77)), "blocking": True}
        return client.call_soon(srv.GoToWaypointGeo, f"{UAL}/go_to_waypoint_geo", **request)
    else:
        path = Path(poses=[] if chosen.random() < 0.2 else [goal])
        kind = {"corner_radius": bad} if path.poses else {}
        return _end_of(client, action.FollowPath, "follow_path", path=path, **kind)
    if chosen.random() < 0.5:
        return _end_of(client, action.GoToWaypoint, "go_to_waypoint", waypoint=goal)
    return client.call_soon(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=goal, blocking=True)


def _end_of(client: Client, kind: Any, name: str, **fields: Any) -> Any:
    return client.end_soon(client.begin(kind, f"{UAL}/{name}", lambda _: None, **fields))
