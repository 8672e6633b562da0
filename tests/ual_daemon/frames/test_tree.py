from __future__ import annotations

import math
import random
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.strategies import POSES, TRANSFORMS
from ual.errors import InvalidArgumentError, ResourceExhaustedError, UnknownFrameError, WrongStateError
from ual.geometry import IDENTITY, Pose, Quaternion, Transform, Vector3
from ual_daemon.frames.tree import EXTRAPOLATION_S, MAP, FrameTree, horizontal
from ual_daemon.settings import ConfigError, FrameSettings, VehicleSettings

ODOM, BODY = "uav_1/odom", "uav_1/base_link"
ORIGIN = Pose()


def tree(settings: VehicleSettings | None = None) -> FrameTree:
    return FrameTree("uav_1", settings or VehicleSettings())


def at(x: float, y: float, z: float, parent: str, child: str, yaw_rad: float = 0.0) -> Transform:
    return Transform(Vector3(x, y, z), Quaternion.from_yaw(yaw_rad), parent, child)


def assert_same_transform(found: Transform, expected: Transform, size_m: float = 1e3) -> None:
    assert (found.frame_id, found.child_frame_id) == (expected.frame_id, expected.child_frame_id)
    assert (found.translation - expected.translation).norm() <= 1e-12 * size_m
    # A quaternion and its negative are the same rotation.
    cosine = sum(a * b for a, b in zip(found.rotation, expected.rotation, strict=True))
    assert abs(abs(cosine) - 1.0) <= 1e-12


@given(POSES)
def test_a_horizontal_pose_has_the_same_heading_and_no_tilt(pose: Pose) -> None:
    level = horizontal(pose)
    roll, pitch, yaw = level.orientation.to_euler()
    assert level.position == pose.position
    assert (roll, pitch) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert math.remainder(yaw - pose.yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-9)


# --- The tree ---------------------------------------------------------------------------------------------------------


def test_it_begins_with_map_odom_and_the_body() -> None:
    found = tree().frames(Pose(Vector3(1, 2, 3)))
    assert [(frame.frame_id, frame.parent_frame_id, frame.is_static) for frame in found] == [
        (MAP, "", True),
        (ODOM, MAP, True),
        (BODY, ODOM, False),
    ]
    assert found[2].transform == Transform(Vector3(1, 2, 3), IDENTITY, ODOM, BODY)


def test_home_pose_positions_odom_in_its_parent() -> None:
    field = FrameSettings(frame_id="field", translation=(10.0, 0.0, 0.0), yaw_rad=math.pi / 2)
    settings = VehicleSettings(home_pose=(1.0, 2.0, 3.0), home_pose_parent_frame="field", frames=(field,))
    found = tree(settings).lookup(MAP, ODOM, None)
    # 1 m ahead of the field's origin is 1 m to the north; 2 m to its left are 2 m to the west.
    assert_same_transform(found, at(8.0, 1.0, 3.0, MAP, ODOM, math.pi / 2))


def test_the_transform_of_a_frame_to_itself_is_the_identity() -> None:
    assert tree().lookup(BODY, BODY, None) == Transform(Vector3(), IDENTITY, BODY, BODY)


def test_a_frame_below_the_body_moves_with_it() -> None:
    frames = tree()
    frames.add(at(0.2, 0.0, -0.1, BODY, "uav_1/camera"))
    body = Pose(Vector3(5, 5, 5), Quaternion.from_yaw(math.pi / 2))
    assert_same_transform(frames.lookup(MAP, "uav_1/camera", body), at(5.0, 5.2, 4.9, MAP, "uav_1/camera", math.pi / 2))


@st.composite
def random_trees(draw: st.DrawFn) -> tuple[list[Transform], Pose]:
    """Frames f0, f1, ..., each in an earlier one; and the pose of the body."""
    names = [MAP, ODOM, BODY]
    frames = []
    for index in range(draw(st.integers(1, 8))):
        frame = draw(TRANSFORMS)
        frames.append(replace(frame, frame_id=draw(st.sampled_from(names)), child_frame_id=f"f{index}"))
        names.append(f"f{index}")
    return frames, draw(POSES)


@given(random_trees(), st.data())
def test_a_lookup_is_the_product_of_the_chain(drawn: tuple[list[Transform], Pose], data: st.DataObject) -> None:
    added, body = drawn
    frames = tree(VehicleSettings(home_pose=(7.0, -8.0, 9.0)))
    for each in added:
        frames.add(each)
    links = {each.child_frame_id: each for each in added}
    links[ODOM] = at(7.0, -8.0, 9.0, MAP, ODOM)
    links[BODY] = Transform(body.position, body.orientation, ODOM, BODY)

    def to_map(name: str) -> Transform:
        result = Transform(Vector3(), IDENTITY, name, name)
        while result.frame_id != MAP:
            result = links[result.frame_id].compose(result)
        return result

    names = [MAP, *links]
    source, target = data.draw(st.sampled_from(names)), data.draw(st.sampled_from(names))
    assert_same_transform(frames.lookup(target, source, body), to_map(target).inverse().compose(to_map(source)), 1e5)
    assert_same_transform(frames.lookup(target, source, body), frames.lookup(source, target, body).inverse(), 1e5)


def test_an_added_frame_can_be_moved_and_passed_another_parent() -> None:
    frames = tree()
    frames.add(at(1, 0, 0, "", "box"))
    frames.add(at(0, 0, 2, "box", "lid"))
    frames.add(at(0, 5, 0, ODOM, "box"))
    assert_same_transform(frames.lookup(MAP, "lid", None), at(0, 5, 2, MAP, "lid"))
    assert frames.names() == [MAP, ODOM, BODY, "box", "lid"]


def test_an_unknown_frame_is_refused_and_the_known_are_listed() -> None:
    frames = tree()
    for ask in (
        lambda: frames.lookup("nowhere", ODOM, ORIGIN),
        lambda: frames.lookup(ODOM, "nowhere", ORIGIN),
        lambda: frames.add(at(0, 0, 0, "nowhere", "box")),
        lambda: frames.require("nowhere"),
    ):
        with pytest.raises(UnknownFrameError, match="there is no frame nowhere") as caught:
            ask()
        assert caught.value.metadata == {"frame_id": "nowhere", "known": f"{MAP}, {ODOM}, {BODY}"}


@pytest.mark.parametrize("known", [MAP, ODOM])
def test_a_frame_in_other_capitals_is_answered_with_what_was_meant(known: str) -> None:
    with pytest.raises(UnknownFrameError, match=rf"there is no frame {known.title()}; .*; did you mean {known}\?$"):
        tree().require(known.title())


@pytest.mark.parametrize("name", [MAP, ODOM, BODY, "field"])
def test_a_built_in_or_configured_frame_stays_where_it_is(name: str) -> None:
    frames = tree(VehicleSettings(frames=(FrameSettings(frame_id="field"),)))
    with pytest.raises(InvalidArgumentError, match=f"the frame {name} is built in or configured") as caught:
        frames.add(at(1, 1, 1, MAP, name))
    assert caught.value.metadata["field"] == "transform.child_frame_id"
    assert frames.names() == [MAP, ODOM, BODY, "field"]


@pytest.mark.parametrize("parent", ["a", "b", "c"])
def test_a_frame_cannot_hang_below_itself(parent: str) -> None:
    frames = tree()
    for above, name in ((MAP, "a"), ("a", "b"), ("b", "c")):
        frames.add(at(1, 0, 0, above, name))
    with pytest.raises(InvalidArgumentError, match="a cannot hang below itself") as caught:
        frames.add(at(0, 0, 0, parent, "a"))
    assert caught.value.metadata["field"] == "transform.header.frame_id"
    assert_same_transform(frames.lookup(MAP, "c", None), at(3, 0, 0, MAP, "c"))


def test_only_lookups_through_the_body_fail_while_its_pose_is_not_known() -> None:
    frames = tree()
    frames.add(at(1, 0, 0, BODY, "arm"))
    with pytest.raises(WrongStateError, match=f"not known yet where the frame {BODY} is in {ODOM}"):
        frames.lookup(MAP, "arm", None)
    assert_same_transform(frames.lookup(BODY, "arm", None), at(1, 0, 0, BODY, "arm"))
    assert {frame.frame_id: frame.transform for frame in frames.frames(None)}[BODY] is None


def test_with_a_geographic_origin_odom_is_known_once_home_is_set() -> None:
    frames = tree(VehicleSettings(map_origin_geo=(37.0, -6.0, 0.0)))
    assert not frames.has_home()
    with pytest.raises(WrongStateError, match=f"where the frame {ODOM} is in map"):
        frames.lookup(MAP, BODY, ORIGIN)
    assert_same_transform(frames.lookup(ODOM, BODY, ORIGIN), at(0, 0, 0, ODOM, BODY))
    frames.set_home(Vector3(3, 2, 1))
    assert frames.has_home()
    assert_same_transform(frames.lookup(MAP, BODY, ORIGIN), at(3, 2, 1, MAP, BODY))


def test_a_lookup_during_a_move_sees_the_frame_before_or_after_the_move() -> None:
    frames = tree()
    frames.add(at(1, 0, 0, MAP, "near"))
    transforms = (at(1, 0, 0, MAP, "box"), at(2, 0, 0, "near", "box"))
    frames.add(transforms[0])
    is_over = threading.Event()

    def move() -> None:
        while not is_over.is_set():
            for transform in transforms:
                frames.add(transform)

    mover = threading.Thread(target=move)
    mover.start()
    try:
        seen = {frames.lookup("near", "box", None).translation.x for _ in range(20_000)}
    finally:
        is_over.set()
        mover.join()
    assert seen <= {0.0, 2.0}


# --- Limits -----------------------------------------------------------------------------------------------------------


def test_the_number_of_frames_has_a_limit_and_those_that_are_there_can_be_moved() -> None:
    frames = tree()
    for i in range(200 - len(frames.names())):
        frames.add(at(1, 0, 0, MAP, f"f{i}"))
    with pytest.raises(ResourceExhaustedError, match="at most 200 frames") as caught:
        frames.add(at(1, 0, 0, MAP, "one_more"))
    assert caught.value.metadata["limit"] == "200"
    assert len(frames.names()) == 200
    frames.add(at(2, 0, 0, MAP, "f0"))
    assert frames.lookup(MAP, "f0", None).translation.x == 2.0


def chained(frames: FrameTree, prefix: str, count: int, parent: str = MAP) -> str:
    """Adds frames, each below the one before. Returns the last one."""
    for i in range(count):
        frames.add(at(1, 0, 0, parent, f"{prefix}{i}"))
        parent = f"{prefix}{i}"
    return parent


def test_the_depth_of_the_tree_has_a_limit() -> None:
    frames = tree()
    deepest = chained(frames, "f", 32)
    with pytest.raises(ResourceExhaustedError, match="32 levels below map") as caught:
        frames.add(at(1, 0, 0, deepest, "one_more"))
    assert caught.value.metadata["limit"] == "32"
    frames.add(at(2, 0, 0, "f30", deepest))


def test_a_frame_that_is_moved_below_another_brings_those_below_it() -> None:
    frames = tree()
    deepest = chained(frames, "f", 20)
    chained(frames, "g", 13)
    with pytest.raises(ResourceExhaustedError, match="32 levels below map"):
        frames.add(at(1, 0, 0, deepest, "g0"))
    assert frames.lookup(MAP, "g0", None).translation.x == 1.0


# --- Removing ---------------------------------------------------------------------------------------------------------


def test_a_frame_that_was_added_can_be_removed_and_makes_room() -> None:
    frames = tree()
    for _ in range(300):
        frames.add(at(1, 0, 0, MAP, "pad"))
        frames.remove("pad")
    assert "pad" not in frames.names()
    with pytest.raises(UnknownFrameError):
        frames.lookup(MAP, "pad", None)
    with pytest.raises(UnknownFrameError):
        frames.remove("pad")


@pytest.mark.parametrize("name", [MAP, ODOM, BODY, "site"])
def test_frames_that_are_built_in_or_configured_are_not_removed(name: str) -> None:
    frames = tree(VehicleSettings(frames=(FrameSettings(frame_id="site"),)))
    with pytest.raises(InvalidArgumentError, match=f"{name} is built in or configured and stays"):
        frames.remove(name)


def test_a_frame_with_frames_below_it_is_not_removed() -> None:
    frames = tree()
    chained(frames, "f", 3)
    with pytest.raises(InvalidArgumentError, match="frames lie below f0; remove them first: f1"):
        frames.remove("f0")
    for name in ("f2", "f1", "f0"):
        frames.remove(name)


# --- Frames that a client moves ---------------------------------------------------------------------------------------


def moved(tree: FrameTree, times_s: Sequence[float], x: Callable[[float], float], *, stamped: bool = False) -> None:
    """A car that drives along the x axis, and turns at 0.1 rad/s."""
    for time_s in times_s:
        rotation = Quaternion.from_yaw(0.1 * time_s)
        stamp_s = 1000.0 + time_s if stamped else 0.0
        late_s = 0.03 * (time_s * 1000 % 3) if stamped else 0.0  # sometimes the network is late
        tree.add(Transform(Vector3(x(time_s), 0.0, 0.0), rotation, MAP, "car", stamp_s), time_s + late_s)


def every(period_s: float, until_s: float) -> list[float]:
    return [period_s * i for i in range(round(until_s / period_s) + 1)]


@pytest.mark.parametrize("stamped", [False, True])
def test_a_moved_frame_goes_on_for_a_while_after_its_last_update(stamped: bool) -> None:
    frames = tree()
    moved(frames, every(0.1, 3.0), lambda t: 2.0 * t, stamped=stamped)
    for later_s, x in ((0.2, 6.4), (EXTRAPOLATION_S, 7.0), (9.0, 7.0)):
        found = frames.lookup(MAP, "car", None, 3.0 + later_s)
        assert found.translation.x == pytest.approx(x, abs=0.13 if stamped else 1e-4)
    yaw_rad_later = frames.lookup(MAP, "car", None, 3.2).rotation.yaw_rad
    assert yaw_rad_later == pytest.approx(0.32, abs=0.01 if stamped else 1e-4)


def test_without_a_time_a_frame_is_where_its_last_update_put_it() -> None:
    frames = tree()
    moved(frames, every(0.1, 1.0), lambda t: 2.0 * t)
    assert frames.lookup(MAP, "car", None).translation.x == pytest.approx(2.0)


def test_noisy_updates_do_not_spoil_the_extrapolation() -> None:
    frames = tree()
    rng = random.Random(1)
    moved(frames, every(0.02, 5.0), lambda t: 3.0 * t + rng.gauss(0.0, 0.02))
    ahead = frames.lookup(MAP, "car", None, 5.0 + EXTRAPOLATION_S).translation.x
    assert ahead == pytest.approx(15.0 + 3.0 * EXTRAPOLATION_S, abs=0.5)


def test_two_updates_close_in_time_do_not_give_a_velocity_yet() -> None:
    frames = tree()
    for x, now_s in ((0.0, 0.0), (0.5, 0.02)):
        frames.add(at(x, 0, 0, MAP, "car"), now_s)
    assert frames.lookup(MAP, "car", None, 5.0).translation.x < 2.0


def test_an_update_that_is_repeated_with_its_stamp_does_not_let_a_frame_go_on() -> None:
    """A program that sends the last measurement again and again, as its source has ended, tells of no motion."""
    frames = tree()
    moved(frames, every(0.1, 3.0), lambda t: 2.0 * t, stamped=True)
    last = replace(at(6, 0, 0, MAP, "car"), stamp_s=1003.0)
    for now_s in every(0.1, 2.0):
        frames.add(last, 3.0 + now_s)
    ahead = [frames.lookup(MAP, "car", None, 5.0 + later_s).translation.x for later_s in (0.0, 0.05, 0.09)]
    assert ahead == [ahead[0]] * 3
    assert frames.is_moving("car")


def test_an_update_that_was_overtaken_does_not_move_a_frame_back() -> None:
    frames = tree()
    moved(frames, every(0.1, 3.0), lambda t: 2.0 * t, stamped=True)
    before = frames.links
    frames.add(replace(at(5.8, 0, 0, MAP, "car"), stamp_s=1002.9), 3.05)
    assert frames.links is before


def test_a_frame_stands_where_the_clock_of_its_client_was_set_back() -> None:
    frames = tree()
    moved(frames, every(0.1, 3.0), lambda t: 2.0 * t, stamped=True)
    frames.add(replace(at(6.2, 0, 0, MAP, "car"), stamp_s=500.0), 3.1)
    assert frames.lookup(MAP, "car", None, 3.4).translation.x == 6.2


@pytest.mark.parametrize("pause_s", [0.1, 5.0])
def test_a_frame_that_is_put_elsewhere_stands_still_there(pause_s: float) -> None:
    frames = tree()
    moved(frames, every(0.1, 1.0), lambda t: t)
    frames.add(at(100.0 if pause_s < 1.0 else 2.0, 0, 0, MAP, "car"), 1.0 + pause_s)
    position = frames.lookup(MAP, "car", None).translation
    assert frames.lookup(MAP, "car", None, 1.0 + pause_s + 0.4).translation == position


def test_which_frames_move() -> None:
    frames = tree(VehicleSettings(frames=(FrameSettings(frame_id="site"),)))
    moved(frames, every(0.1, 0.1), lambda t: t)
    for parent, child in ((MAP, "once"), ("car", "roof"), (BODY, "camera")):
        frames.add(at(1, 0, 0, parent, child))
    frames.add(at(2, 0, 0, BODY, "camera"), 0.1)
    assert [name for name in frames.names() if frames.is_moving(name)] == ["car", "roof"]
    assert {frame.frame_id for frame in frames.frames(ORIGIN) if not frame.is_static} == {BODY, "car", "camera"}


def test_a_frame_that_is_added_again_where_it_is_has_not_moved() -> None:
    """A program that starts again adds its frames again. A go-to there then has a way, and can be paused."""
    frames = tree()
    for now_s in (0.0, 1.1, 30.0):
        frames.add(at(1, 2, 3, MAP, "tower", 0.5), now_s)
        assert not frames.is_moving("tower")
    moved(frames, every(0.1, 0.2), lambda _: 7.0)
    frames.add(at(7, 0, 0, MAP, "car"), 0.3)
    assert frames.is_moving("car")


@pytest.mark.parametrize("period_s", [0.0, 0.1, 1.0])
def test_a_frame_that_is_updated_and_stands_may_move_on(period_s: float) -> None:
    """A goal over a car that waits at the lights is followed when it goes on."""
    frames = tree()
    for now_s in (0.0, period_s):
        frames.add(at(1, 2, 3, MAP, "car"), now_s)
    assert frames.is_moving("car")


# --- The configuration ------------------------------------------------------------------------------------------------

CONFIGURED = (
    FrameSettings(frame_id="site", translation=(1.0, 0.0, 0.0)),
    FrameSettings(frame_id="site/hall", parent_frame_id="site", translation=(1.0, 0.0, 0.0)),
    FrameSettings(frame_id="site/hall/gate", parent_frame_id="site/hall", translation=(1.0, 0.0, 0.0)),
    FrameSettings(frame_id="camera", parent_frame_id=BODY, translation=(1.0, 0.0, 0.0)),
)


@given(st.permutations(CONFIGURED))
def test_configured_frames_may_come_in_any_order(order: list[FrameSettings]) -> None:
    settings = VehicleSettings(frames=tuple(order), home_pose_parent_frame="site/hall/gate", pose_frame_id="site/hall")
    assert_same_transform(tree(settings).lookup(MAP, "camera", ORIGIN), at(4, 0, 0, MAP, "camera"))


@pytest.mark.parametrize(
    ("settings", "key", "message"),
    [
        (
            VehicleSettings(frames=(FrameSettings(frame_id="a"), FrameSettings(frame_id="a"))),
            "frames[1].frame_id",
            "the frame a is there already",
        ),
        (VehicleSettings(frames=(FrameSettings(frame_id=MAP),)), "frames[0].frame_id", "map is there already"),
        (VehicleSettings(frames=(FrameSettings(frame_id=ODOM),)), "frames[0].frame_id", "is there already"),
        (
            VehicleSettings(frames=(FrameSettings(frame_id="a"), FrameSettings(frame_id="b", parent_frame_id="c"))),
            "frames[1].parent_frame_id",
            "the frame b does not lead to map: its parent c is not known",
        ),
        (
            VehicleSettings(
                frames=(
                    FrameSettings(frame_id="a", parent_frame_id="b"),
                    FrameSettings(frame_id="b", parent_frame_id="a"),
                )
            ),
            "frames[0].parent_frame_id",
            "or they make a loop",
        ),
        (
            VehicleSettings(frames=(FrameSettings(frame_id="a", parent_frame_id="a"),)),
            "frames[0].parent_frame_id",
            "or they make a loop",
        ),
        (VehicleSettings(home_pose_parent_frame="a"), "home_pose_parent_frame", "the frame a is not known"),
        (VehicleSettings(home_pose_parent_frame=BODY), "home_pose_parent_frame", f"or lies below {ODOM}"),
        (VehicleSettings(pose_frame_id="a"), "pose_frame_id", "the frame a is not known"),
    ],
)
def test_the_error_of_an_impossible_tree_names_the_setting_at_fault(
    settings: VehicleSettings, key: str, message: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        tree(settings)
    assert caught.value.key == key
    assert message in str(caught.value)
