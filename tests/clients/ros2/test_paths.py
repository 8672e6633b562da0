"""The path of FollowPath, and where the nose points."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import ual
from tests.clients.ros2 import messages
from ual_ros2 import paths

PLACE = SimpleNamespace(
    waypoint=SimpleNamespace(latitude=37.0, longitude=-6.0, altitude=5.0), altitude_reference=0, has_yaw=False, yaw=0.0
)


def goal(*frame_ids: str, frame_id: str = "", heading: int = 0, places: tuple[object, ...] = ()) -> SimpleNamespace:
    poses = [SimpleNamespace(header=messages.header(each), pose=messages.pose()) for each in frame_ids]
    return SimpleNamespace(
        path=SimpleNamespace(header=messages.header(frame_id), poses=poses),
        geo_waypoints=list(places),
        heading=heading,
        point_of_interest=SimpleNamespace(header=messages.header("mast"), point=messages.vector()),
    )


def test_a_pose_of_a_path_without_a_frame_is_in_that_of_the_path() -> None:
    read = paths.waypoints(goal("", "tower", frame_id="deck"))
    assert [each.frame_id for each in read if isinstance(each, ual.PoseStamped)] == ["deck", "tower"]


def test_a_path_is_of_poses_or_of_positions() -> None:
    assert paths.waypoints(goal(places=(PLACE,))) == [ual.GeoWaypoint(37.0, -6.0, 5.0)]
    with pytest.raises(ual.InvalidArgumentError, match="only one of both"):
        paths.waypoints(goal("", places=(PLACE,)))


def test_a_point_of_interest_is_read_only_where_the_nose_points_at_it() -> None:
    assert paths.point_of_interest(goal()) is None
    point = paths.point_of_interest(goal(heading=ual.PathHeading.POINT_OF_INTEREST.value))
    assert point is not None
    assert point.frame_id == "mast"


def test_the_frames_of_a_goal_are_those_of_all_that_it_has() -> None:
    assert paths.frames(goal("tower", frame_id="deck")) == ["deck", "mast", "tower"]
