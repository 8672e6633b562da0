"""`ual view`: what is shown of a UAV at one moment, without a page."""

from __future__ import annotations

import dataclasses
import itertools
import math

import pytest

from ual.errors import GeofenceError
from ual.geometry import Pose, Quaternion, Transform, Twist, Vector3
from ual.types import Health, Odometry, State, TaskInfo, TaskKind, TaskStatus, Telemetry
from ual_tools.view import panel
from ual_tools.view.journal import Journal
from ual_tools.view.pose_times import PoseTimes
from ual_tools.view.shown import GREY, Shown, clock_text, shown
from ual_tools.view.track import CHART_S, Track
from ual_tools.watch_board import WatchedUav

NOW_S, UTC_S, LOST_AFTER_S = 10_000.0, 1_700_000_000.0, 2.0
ODOM = Transform(Vector3(10.0, 20.0, 5.0), Quaternion.from_yaw(math.pi / 2), "map", "uav_1/odom")
BODY = Pose(Vector3(1.0, 0.0, 3.0), Quaternion.from_yaw(0.5))
IN_MAP = ODOM.apply_pose(BODY)
FLYING = Telemetry(
    State.FLYING_AUTO,
    state_reason="in the air",
    frame_id="uav_1/odom",
    pose=BODY,
    velocity=Twist(Vector3(3.0, 4.0, 0.0)),
    odometry=Odometry(BODY, Twist(), "uav_1/odom", "uav_1/base_link", UTC_S),
    transform=Transform(IN_MAP.position, IN_MAP.orientation, "map", "uav_1/base_link"),
    reference_pose=Pose(Vector3(1.0, 2.0, 3.0)),
    armed=True,
    task=TaskInfo("1", TaskKind.GO_TO_WAYPOINT, TaskStatus.RUNNING, 0.25, 12.34, 7.0, description="goes to 4 2 3"),
)


def poll_once(seen: WatchedUav) -> Shown:
    return shown("uav_1", seen, now_s=NOW_S, utc_s=UTC_S, lost_after_s=LOST_AFTER_S)


def near(place: Vector3 | None, x: float, y: float, z: float) -> bool:
    return place is not None and (place - Vector3(x, y, z)).norm() < 1e-9


def test_all_is_drawn_in_map() -> None:
    uav = poll_once(WatchedUav(NOW_S, FLYING))
    assert uav.body is not None
    assert uav.odom is not None
    assert uav.reference is not None
    assert near(uav.body.position, 10.0, 21.0, 8.0)
    assert near(uav.odom.translation, 10.0, 20.0, 5.0)
    assert near(uav.reference.position, 8.0, 21.0, 8.0)
    assert uav.is_armed
    assert not uav.is_lost
    assert uav.label == "uav_1 FLYING_AUTO"
    assert uav.task == "goes to 4 2 3"
    assert (uav.height_m, uav.speed_m_s, uav.off_reference_m) == (3.0, 5.0, 2.0)


def test_the_reference_follows_the_frame_of_the_telemetry() -> None:
    in_map = dataclasses.replace(FLYING, frame_id="map", pose=IN_MAP, reference_pose=Pose(Vector3(7.0, 7.0, 7.0)))
    reference = poll_once(WatchedUav(NOW_S, in_map)).reference
    assert reference is not None
    assert near(reference.position, 7.0, 7.0, 7.0)


@pytest.mark.parametrize(("age_s", "is_lost"), [(0.0, False), (1.9, False), (2.0, True), (3600.0, True)])
def test_an_old_sample_is_grey_and_says_since_when(age_s: float, is_lost: bool) -> None:
    uav = poll_once(WatchedUav(NOW_S - age_s, FLYING))
    assert uav.is_lost is is_lost
    assert (uav.colour == GREY) is is_lost
    assert (f"LOST since {clock_text(UTC_S - age_s)}: no telemetry for {age_s:.0f} s" in uav.label) is is_lost


def test_a_lost_uav_stays_where_it_was_and_shows_nothing_as_the_present() -> None:
    uav = poll_once(WatchedUav(NOW_S - 5.0, FLYING))
    assert uav.body is not None
    assert near(uav.body.position, 10.0, 21.0, 8.0)
    assert uav.reference is None
    assert not uav.is_armed  # its propellers stand still
    assert (uav.height_m, uav.speed_m_s, uav.off_reference_m) == (None, None, None)
    text = panel.details(uav, WatchedUav(NOW_S - 5.0, FLYING), now_s=NOW_S).replace("\\", "")
    assert text.startswith("### uav_1: LOST since 22:13:15 UTC: no telemetry for 5 s, it was FLYING_AUTO")
    assert "What was known then (5.0 s old)" in text


def test_a_daemon_that_ended_is_lost_at_once() -> None:
    uav = poll_once(WatchedUav(NOW_S - 0.1, FLYING, gone_s=NOW_S))
    assert uav.colour == GREY
    assert "its daemon has ended, it was FLYING_AUTO" in uav.label


def test_an_old_pose_is_not_the_present_however_new_its_telemetry_is() -> None:
    # A daemon that hears nothing from its autopilot goes on sending the pose that it knew last.
    poses = PoseTimes()

    def sample(time_s: float, stamp_s: float) -> tuple[Shown, str]:
        seen = WatchedUav(time_s, dataclasses.replace(FLYING, stamp_s=stamp_s))
        since_s = poses.since_s("uav_1", seen, time_s)
        utc_s = UTC_S + time_s - NOW_S
        uav = shown("uav_1", seen, now_s=time_s, utc_s=utc_s, lost_after_s=LOST_AFTER_S, pose_since_s=since_s)
        return uav, panel.details(uav, seen, now_s=time_s).replace("\\", "")

    assert not sample(NOW_S, 5.0)[0].is_lost
    uav, text = sample(NOW_S + 1.9, 5.0)
    assert not uav.is_lost
    assert "pose 1.9 s old" in text
    uav, text = sample(NOW_S + 3.0, 5.0)
    assert (uav.is_lost, uav.colour, uav.is_armed, uav.reference, uav.height_m) == (True, GREY, False, None, None)
    assert uav.label == "uav_1: LOST since 22:13:20 UTC: no new pose for 3 s, it is FLYING_AUTO (in the air)"
    assert "What was known then (3.0 s old)" in text
    assert not sample(NOW_S + 3.1, 5.1)[0].is_lost
    poses.keep([])
    assert not sample(NOW_S + 9.0, 5.1)[0].is_lost  # it was forgotten


def test_a_pose_without_a_time_is_not_assessed_by_it() -> None:
    poses = PoseTimes()
    assert poses.since_s("uav_1", WatchedUav(NOW_S, FLYING), NOW_S) is None
    assert poses.since_s("uav_1", WatchedUav(NOW_S, Telemetry(State.UNINITIALIZED, stamp_s=3.0)), NOW_S) is None


def test_a_uav_that_was_never_observed_says_so() -> None:
    assert poll_once(WatchedUav(NOW_S)).label == "uav_1: no telemetry yet"
    assert (
        poll_once(WatchedUav(NOW_S - 3.0, None, "LINK_LOST: x")).label
        == "uav_1: never seen: no telemetry for 3 s: LINK_LOST: x"
    )


def test_what_is_not_known_is_not_drawn() -> None:
    uav = poll_once(WatchedUav(NOW_S, Telemetry(State.UNINITIALIZED, "no pose")))
    assert (uav.body, uav.reference, uav.odom, uav.height_m) == (None, None, None, None)
    nowhere = dataclasses.replace(FLYING, transform=Transform(Vector3(math.nan, 0.0, 0.0)))
    assert poll_once(WatchedUav(NOW_S, nowhere)).body is None
    lost_frame = dataclasses.replace(FLYING, frame_lost="the autopilot rebooted", transform=None, odometry=None)
    assert poll_once(WatchedUav(NOW_S, lost_frame)).label == "uav_1 FLYING_AUTO: FRAME LOST"


def test_the_panel_names_what_an_operator_searches() -> None:
    seen = WatchedUav(NOW_S, dataclasses.replace(FLYING, health=Health(link_quality=0.5, failsafe="battery failsafe")))
    text = panel.details(poll_once(seen), seen, now_s=NOW_S).replace("\\", "")
    for words in ("in the air", "25 % after 7 s", "12.34 m left", "battery failsafe", "pose 0.0 s old; 50 %"):
        assert words in text


def test_the_panel_has_what_is_carried_but_not_of_a_lost_uav() -> None:
    carried = (("gripper claw", "closed"),)
    assert "| gripper claw | closed |" in panel.details(
        poll_once(WatchedUav(NOW_S, FLYING)), WatchedUav(NOW_S, FLYING), now_s=NOW_S, carried=carried
    )
    lost = WatchedUav(NOW_S - 10.0, FLYING)
    assert "claw" not in panel.details(poll_once(lost), lost, now_s=NOW_S, carried=carried)


def test_words_of_an_autopilot_are_no_markup() -> None:
    evil = dataclasses.replace(FLYING, status_text="<img src=x onerror=alert(1)> {a} | **c**\n# d http://b")
    text = panel.details(poll_once(WatchedUav(NOW_S, evil)), WatchedUav(NOW_S, evil), now_s=NOW_S)
    line = next(line for line in text.splitlines() if "onerror" in line)
    assert line == (r"| autopilot says | \<img src=x onerror=alert\(1\)\> \{a\} \| \*\*c\*\* \# d http\://b |")


def test_the_head_says_of_which_moment_the_page_is() -> None:
    assert panel.head(UTC_S, 2) == "**2 UAVs** as of **22:13:20 UTC**"


def test_the_curtain_is_another_one_each_second_and_says_since_when_there_is_no_news() -> None:
    assert "NO NEWS since 22:13:20 UTC" in panel.curtain(UTC_S)
    assert panel.curtain(UTC_S) != panel.curtain(UTC_S + 1.0)


def at(x: float, *, is_lost: bool = False) -> Shown:
    return Shown("uav_1", "", GREY, is_lost=is_lost, body=Pose(Vector3(x, 0.0, 0.0)), height_m=x)


def test_a_trail_has_gaps_where_the_uav_was_lost_or_set_anew() -> None:
    track = Track()
    for now_s, uav in enumerate([at(0.0), at(1.0), at(1.01), at(2.0, is_lost=True), at(3.0), at(4.0), at(100.0)]):
        track.add(float(now_s), uav)
    assert [(a.x, b.x) for a, b in track.trail()] == [(0.0, 1.0), (3.0, 4.0)]


def test_a_trail_has_few_pieces_where_it_is_nearly_straight() -> None:
    track, radius_m, corners = Track(), 8.0, 500
    way = [
        Vector3(radius_m * math.cos(a), radius_m * math.sin(a), 0.0)
        for a in (math.tau * i / corners for i in range(corners))
    ]
    for place in way:
        track.add(0.0, dataclasses.replace(at(0.0), body=Pose(place)))
    pieces = track.trail()
    assert len(pieces) < 50
    assert all(end == start for (_, end), (start, _) in itertools.pairwise(pieces))
    assert min((a + b).norm() / 2 for a, b in pieces) > radius_m - 0.05


def test_the_chart_is_of_the_last_minute_and_has_no_values_of_a_lost_uav() -> None:
    track = Track()
    for step in range(100):
        track.add(float(step), at(float(step), is_lost=step >= 90))
    samples = track.chart(99.0)
    assert samples[0].time_s == -CHART_S
    assert samples[-1].time_s == -10.0
    assert samples[-1].height_m == 89.0
    assert math.isnan(samples[-1].speed_m_s)


def test_a_trail_and_a_chart_do_not_grow() -> None:
    track = Track()
    for step in range(5000):
        track.add(step / 10, at(float(step % 2)))
    assert len(track.trail()) == 100
    assert len(track.chart(500.0)) <= 301


def test_the_journal_has_each_change_once() -> None:
    journal = Journal()
    spoken = dataclasses.replace(FLYING, status_text="Low battery")
    old = WatchedUav(NOW_S - 100.0, spoken)
    for seen in (
        WatchedUav(NOW_S, FLYING),
        WatchedUav(NOW_S, FLYING),
        WatchedUav(NOW_S, spoken),
        WatchedUav(NOW_S, spoken),
        old,
        old,
    ):
        journal.note_changes(poll_once(seen), seen, UTC_S)
    journal.refused("uav_1", "go to 1 2 3", GeofenceError("outside"), UTC_S)
    ended = TaskInfo("1", TaskKind.LAND, TaskStatus.ABORTED, error=GeofenceError("no"), description="land")
    journal.ended("uav_1", ended, UTC_S)
    assert journal.entries("uav_1") == [
        "22:13:20 UTC uav_1: land: ABORTED: GEOFENCE: no",
        "22:13:20 UTC uav_1: go to 1 2 3 REFUSED: GEOFENCE: outside",
        "22:13:20 UTC uav_1: LOST since 22:11:40 UTC: no telemetry for 100 s, it was FLYING_AUTO",
        "22:13:20 UTC uav_1: the autopilot says: Low battery",
        "22:13:20 UTC uav_1: FLYING_AUTO (in the air)",
    ]
    assert journal.entries("uav_2") == []


def test_the_journal_has_a_loss_once_although_its_age_grows() -> None:
    journal = Journal()
    for age_s in (4.7, 4.9, 5.1):
        seen = WatchedUav(NOW_S, dataclasses.replace(FLYING, status_text=f"nothing heard for {age_s:.1f} s"))
        journal.note_changes(poll_once(seen), seen, UTC_S)
    assert sum("nothing heard" in line for line in journal.entries("uav_1")) == 1
