"""Allowed and refused commands while home or map is lost: from hand-made snapshots."""

from __future__ import annotations

import pytest

from tests.ual_daemon.frames.test_local_frame import NO_FIX, at, moved, near
from ual.errors import FrameLostError, UnknownFrameError
from ual.geometry import IDENTITY, Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import VehicleSettings

ODOM, BODY = "uav_1/odom", "uav_1/base_link"
AFTER = at(9.0, moved(5.0), 1)
"""Position at which it has satellites at last: 5 m east of the origin of map."""
BELOW_ODOM, BELOW_MAP, BELOW_BODY = "pad", "field", "camera"


def resolver(*, has_origin: bool) -> FrameResolver:
    """Home is lost by a boot without satellites; then they come. With an origin on Earth, map is known then."""
    settings = VehicleSettings(map_origin_geo=(47.0, 8.0, 400.0) if has_origin else None)
    resolver = FrameResolver("uav_1", settings)
    for name, parent in ((BELOW_ODOM, ODOM), (BELOW_MAP, "map"), (BELOW_BODY, BODY)):
        resolver.tree.add(Transform(Vector3(1.0, 0.0, 0.0), IDENTITY, parent, name))
    for snapshot in (at(0.0, None, gps=NO_FIX), at(1.0, None, 1, NO_FIX), AFTER):
        resolver.update(snapshot)
    return resolver


def goal(frames: FrameResolver, frame_id: str) -> Vector3:
    wanted = frames.goal(PoseStamped(Pose.at(2.0, 0.0, 0.0), frame_id), "waypoint")
    return frames.to_local(wanted, AFTER).position


@pytest.mark.parametrize("frame_id", [ODOM, "", BELOW_ODOM, "map", BELOW_MAP])
def test_without_an_origin_of_map_nothing_but_the_body_is_known(frame_id: str) -> None:
    frames = resolver(has_origin=False)
    with pytest.raises(FrameLostError, match="nothing ties the frame to Earth"):
        goal(frames, frame_id)
    twist, velocity_frame_id = frames.velocity(TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)), frame_id), "velocity")
    with pytest.raises(FrameLostError):
        frames.velocity_to_local(twist, velocity_frame_id, AFTER)
    with pytest.raises(FrameLostError):
        frames.transform(frame_id, BODY, AFTER)


@pytest.mark.parametrize("frame_id", [BODY, BELOW_BODY])
@pytest.mark.parametrize("has_origin", [False, True])
def test_what_is_meant_from_the_body_is_always_known(frame_id: str, *, has_origin: bool) -> None:
    frames = resolver(has_origin=has_origin)
    assert tuple(goal(frames, frame_id)) == near(2.0 if frame_id == BODY else 3.0)
    assert tuple(frames.transform(BODY, BELOW_BODY, AFTER).translation) == near(1.0)


def test_on_earth_map_is_known_though_home_is_lost() -> None:
    frames = resolver(has_origin=True)
    assert frames.body(AFTER) is None
    assert tuple(goal(frames, "map")) == pytest.approx((-3.0, 0.0, 0.0), abs=0.05)
    assert tuple(goal(frames, BELOW_MAP)) == pytest.approx((-2.0, 0.0, 0.0), abs=0.05)
    assert tuple(frames.transform("map", BODY, AFTER).translation) == pytest.approx((5.0, 0.0, 0.0), abs=0.05)
    for frame_id in (ODOM, BELOW_ODOM):
        with pytest.raises(FrameLostError):
            goal(frames, frame_id)
        with pytest.raises(FrameLostError):
            frames.transform("map", frame_id, AFTER)


def test_frames_that_hang_together_are_known_to_each_other() -> None:
    frames = resolver(has_origin=False)
    for target, source in ((ODOM, BELOW_ODOM), ("map", BELOW_MAP), ("map", ODOM)):
        frames.transform(target, source, AFTER)


def test_an_unknown_frame_is_unknown_and_not_lost() -> None:
    frames = resolver(has_origin=False)
    with pytest.raises(UnknownFrameError):
        frames.transform("nowhere", BODY, AFTER)


def test_set_home_makes_all_of_them_known_again() -> None:
    frames = resolver(has_origin=True)
    frames.set_home(Vector3(0.0, 0.0, 0.0), AFTER, set_z=False)
    assert (frames.odom_loss, frames.map_loss) == (None, None)
    assert tuple(goal(frames, "")) == near(2.0)
    assert tuple(frames.transform("map", ODOM, AFTER).translation) == pytest.approx((5.0, 0.0, 0.0), abs=0.05)


def external(frames: FrameResolver, frame_id: str, x: float = 2.0) -> tuple[float, ...]:
    return tuple(frames.external_pose(PoseStamped(Pose.at(x, 0.0, 0.0, 0.0), frame_id), 9.0).position)


@pytest.mark.parametrize(("frame_id", "x"), [("", 2.0), (ODOM, 2.0), (BELOW_ODOM, 3.0), ("map", 2.0)])
@pytest.mark.parametrize("cause", ["jump", "boot"])
def test_poses_from_outside_lay_a_frame_that_nothing_ties_to_earth_whatever_becomes_of_home(
    frame_id: str, x: float, cause: str
) -> None:
    frames = FrameResolver("uav_1", VehicleSettings())
    frames.tree.add(Transform(Vector3(1.0, 0.0, 0.0), IDENTITY, ODOM, BELOW_ODOM))
    frames.update(at(0.0, None, gps=NO_FIX))
    assert external(frames, frame_id) == near(x)
    frames.set_home(Vector3(1.0, 0.0, 0.0), at(0.0, None, gps=NO_FIX), set_z=False)
    assert external(frames, frame_id) == near(x)
    if cause == "jump":
        frames.estimate_jumped(Vector3(1.5, 0.0, 0.0))
    else:
        frames.update(at(1.0, None, 1, NO_FIX))
    assert frames.odom_loss is not None
    assert external(frames, frame_id) == near(x)
    frames.set_home(Vector3(5.0, 0.0, 0.0), at(1.0, None, 0 if cause == "jump" else 1, NO_FIX), set_z=False)
    assert frames.odom_loss is None
    assert external(frames, frame_id) == near(x)


def test_poses_from_outside_that_begin_late_are_where_home_is_then() -> None:
    frames = FrameResolver("uav_1", VehicleSettings())
    before = at(0.0, None, gps=NO_FIX)
    frames.update(before)
    frames.set_home(Vector3(1.0, 0.0, 0.0), before, set_z=False)
    assert external(frames, "") == near(3.0)


def test_poses_from_outside_in_a_frame_on_earth_that_is_lost_are_refused() -> None:
    frames = FrameResolver("uav_1", VehicleSettings())
    frames.update(at(0.0, moved(0.0)))
    assert external(frames, "") == near(2.0)
    frames.update(at(1.0, None, 1, NO_FIX))
    with pytest.raises(FrameLostError):
        external(frames, "")
