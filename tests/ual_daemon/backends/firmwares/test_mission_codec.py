from __future__ import annotations

import json
import math
from collections.abc import Sequence

import pytest

from tests.ual.missions.plans import TEN, Example
from ual.errors import InvalidArgumentError, WrongStateError
from ual.missions import (
    CameraAction,
    CameraTrigger,
    Heading,
    HoldTime,
    Item,
    Jump,
    Land,
    Mission,
    OtherItem,
    RegionOfInterest,
    RegionOfInterestEnd,
    ReturnToLaunch,
    Speed,
    TakeOff,
    Waypoint,
    parse,
)
from ual.parameters.values import real32
from ual.types import AltitudeReference
from ual_daemon.backends.firmwares.mission_codec import ArduCopterMissions, GeoPosition, MissionCodec, Px4Missions
from ual_daemon.backends.firmwares.mission_items import MissionItem

PX4, COPTER = Px4Missions(), ArduCopterMissions()
HERE = GeoPosition(47.3977, 8.5456)
AMSL = AltitudeReference.AMSL
A = Waypoint(47.1, 8.1, 20.0)
BOTH: list[Item] = [
    TakeOff(20.0),
    Speed(3.5),
    Waypoint(47.1, 8.1, 20.5, hold_s=2.0),
    Waypoint(47.2, -8.2, 520.25, AMSL),
    RegionOfInterest(47.2, 8.2, 1.0),
    CameraTrigger(CameraAction.BY_DISTANCE, 12.5),
    HoldTime(2.5),
    CameraTrigger(CameraAction.STOP),
    RegionOfInterestEnd(),
    CameraTrigger(CameraAction.BY_INTERVAL, 4.0),
    CameraTrigger(CameraAction.STOP),
    CameraTrigger(CameraAction.ONCE),
    CameraTrigger(CameraAction.BY_DISTANCE_LATER, 8.0),
    CameraTrigger(CameraAction.STOP_WITH_PHOTO),
    Jump(3, 2),
    Land(47.3, 8.3),
]


def px4_keeps(item: MissionItem) -> MissionItem:
    """An item as PX4 gives it back (format_mavlink_mission_item)."""
    frame = {0: 5, 3: 6}.get(item.frame, item.frame)
    params = [real32(each) for each in item[2:6]]
    if item.command == 16:  # wrap_2pi of radians
        params = [params[0], params[1], 0.0, math.degrees(math.radians(params[3]) % (2 * math.pi))]
    elif item.command in (21, 22):
        params = [0.0, 0.0, 0.0, params[3]]
    elif item.command == 195:
        params = [0.0] * 4
    return MissionItem(frame, item.command, *four(params), item.x, item.y, real32(item.z))


def four(params: Sequence[float]) -> tuple[float, float, float, float]:
    one, two, three, four = params
    return one, two, three, four


def copter_keeps(items: Sequence[MissionItem]) -> list[MissionItem]:
    """Items as ArduCopter gives them back (mission_cmd_to_mavlink_int); the first one is its home."""
    home = MissionItem(0, 16, x=473977000, y=85456000, z=488.0)
    return [home, *(copter_item(each) for each in items[1:])]


def copter_item(item: MissionItem) -> MissionItem:
    frame = item.frame if item.command in (16, 20, 21, 22, 195, 197) else 0
    kept = {16: (1,), 21: (), 22: (), 20: (), 93: (1, 2, 3, 4), 178: (1, 2, 3), 115: (1, 2, 3, 4), 206: (1, 3)}
    used = kept.get(item.command, (1, 2, 3))
    params = [real32(each) if number in used else 0.0 for number, each in enumerate(item[2:6], 1)]
    params[3] = 1.0 if item.command == 21 else params[3]
    height = int(real32(item.z) * 100.0) * 0.01
    return MissionItem(frame, item.command, *four(params), item.x, item.y, real32(height))


def kept(codec: MissionCodec, sent: Sequence[MissionItem]) -> list[MissionItem]:
    return [px4_keeps(each) for each in sent] if codec is PX4 else copter_keeps(sent)


@pytest.mark.parametrize("codec", [PX4, COPTER], ids=lambda each: each.name)
def test_what_both_execute_is_the_same_after_it_was_read_back(codec: MissionCodec) -> None:
    codec.require(BOTH)
    sent = codec.encode(BOTH, HERE)
    found = kept(codec, sent)
    assert codec.difference(sent, found) == ""
    read = codec.decode(found)
    expected = list(BOTH)
    if codec is PX4:
        expected[0] = TakeOff(20.0, AltitudeReference.HOME, *HERE)
    assert read == expected
    assert codec.digest(found) == codec.digest(kept(codec, codec.encode(read, None)))


def test_only_a_trigger_with_a_photo_at_once_says_so() -> None:
    """ArduCopter takes one photo for a third parameter of 1, also where the distance is 0."""
    sent = {each.param1: each.param3 for each in COPTER.encode(BOTH[:8], HERE) if each.command == 206}
    assert sent == {12.5: 1.0, 0.0: 0.0}
    later = [A, *BOTH[-4:-2]]
    assert [(each.param1, each.param3) for each in COPTER.encode(later, HERE)[2:]] == [(8.0, 0.0), (0.0, 1.0)]


@pytest.mark.parametrize("example", [each for each in TEN if each.kinds], ids=lambda each: each.name)
@pytest.mark.parametrize("codec", [PX4, COPTER], ids=lambda each: each.name)
def test_a_plan_of_qgroundcontrol_is_the_same_after_it_was_read_back(codec: MissionCodec, example: Example) -> None:
    mission: Mission = parse(example.text.encode(), "a.plan")
    codec.require(mission.items)
    read = codec.decode(kept(codec, codec.encode(mission.items, HERE)))
    assert [type(each).__name__ for each in read] == list(example.kinds)
    wanted = list(mission.items)
    wanted[0], read[0] = TakeOff(20.0), TakeOff(20.0)
    assert read == wanted
    assert json.loads(example.text)["mission"]["items"]


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"command": 17}, "item 3 has command 17 instead of 16"),
        ({"param1": 3.0}, "item 3 has param1 3 instead of 2"),
        ({"x": 471000001}, "item 3 has x 471000001 instead of 471000000"),
        ({"z": 20.6}, "item 3 has z 20.6000004 instead of 20.5"),
        ({"frame": 5}, "item 3 has frame 0 instead of 3"),
    ],
)
def test_what_was_kept_otherwise_is_named(changed: dict[str, float], text: str) -> None:
    sent = PX4.encode(BOTH, HERE)
    found = kept(PX4, sent)
    before = PX4.digest(found)
    found[2] = found[2]._replace(**changed)  # type: ignore[arg-type]  # of the right type for each field
    assert PX4.difference(sent, found) == text
    assert PX4.digest(found) != before
    assert PX4.difference(sent, found[:-1]) == "it has 15 items instead of 16"


@pytest.mark.parametrize(("yaw_rad", "yaw_deg"), [(math.pi / 2, 0.0), (0.0, 90.0), (-math.pi, 270.0), (7.0, 48.93)])
def test_px4_gets_the_heading_of_a_waypoint_clockwise_from_north(yaw_rad: float, yaw_deg: float) -> None:
    [sent] = PX4.encode([Waypoint(47.1, 8.1, 20.0, yaw_rad=yaw_rad)], HERE)
    assert sent.param4 == pytest.approx(yaw_deg, abs=0.01)
    assert PX4.difference([sent], [px4_keeps(sent)]) == ""


def test_px4_takes_no_heading_for_a_waypoint_that_has_none() -> None:
    [sent] = PX4.encode([A], HERE)
    assert math.isnan(sent.param4)
    assert PX4.difference([sent], [sent._replace(param4=0.0)]) == "item 1 has param4 0 instead of nan"


def test_the_take_off_of_px4_is_where_it_stands_unless_it_has_a_position() -> None:
    [sent] = PX4.encode([TakeOff(10.0)], HERE)
    assert (sent.x, sent.y, sent.z) == (473977000, 85456000, 10.0)
    [sent] = PX4.encode([TakeOff(10.0, AMSL, 47.0, 8.0)], None)
    assert (sent.x, sent.y, sent.frame) == (470000000, 80000000, 0)
    with pytest.raises(WrongStateError, match="it is not known where the UAV is"):
        PX4.encode([TakeOff(10.0)], None)


def test_jumps_count_from_the_number_that_the_autopilot_gives_to_the_first_item() -> None:
    assert PX4.encode([A, A, Jump(2, 3)], HERE)[2].param1 == 1.0
    assert COPTER.encode([A, A, Jump(2, 3)], HERE)[3].param1 == 2.0
    assert (PX4.seq_of(1), COPTER.seq_of(1), PX4.index_of(1), COPTER.index_of(1)) == (1, 2, 1, 0)


@pytest.mark.parametrize(
    ("codec", "items", "text"),
    [
        (PX4, [A, Heading(1.0), HoldTime(2.0)], "item 2 (heading): PX4 has no turn of its own"),
        (COPTER, [A, Heading(1.0), A], "item 2 (heading): ArduCopter turns back to its own heading"),
        (COPTER, [Waypoint(47.1, 8.1, 20.0, yaw_rad=1.0)], "item 1 (waypoint): ArduCopter ignores the heading"),
        (COPTER, [Waypoint(47.1, 8.1, 20.0, accept_radius_m=2.0)], "item 1 (waypoint): ArduCopter ignores the radius"),
        (COPTER, [Waypoint(47.1, 8.1, 20.0, hold_s=1.5)], "item 1 (waypoint): ArduCopter holds for whole seconds"),
        (COPTER, [Waypoint(47.1, 8.1, 0.0, number="7")], "item 7 (waypoint): ArduCopter reads altitude 0"),
        (COPTER, [Waypoint(47.1, 8.1, 0.004)], "item 1 (waypoint): ArduCopter reads altitude 0"),
        (COPTER, [TakeOff(10.0, AMSL, 47.0, 8.0), A], "item 1 (take-off): ArduCopter ignores the place"),
        (COPTER, [TakeOff(0.5), A], "item 1 (take-off): ArduCopter climbs 1 m at least"),
    ],
)
def test_what_an_autopilot_would_ignore_or_read_otherwise_is_refused(
    codec: MissionCodec, items: list[Item], text: str
) -> None:
    with pytest.raises(InvalidArgumentError) as refused:
        codec.require(items)
    assert refused.value.message.startswith(text)


def test_a_heading_with_a_hold_after_it_is_executed_by_ardupilot() -> None:
    items = [A, Heading(0.0), Speed(2.0), HoldTime(3.0), ReturnToLaunch()]
    COPTER.require(items)
    assert COPTER.encode(items, HERE)[2].param1 == pytest.approx(90.0)


def test_what_a_mission_of_ual_has_not_is_reported_and_not_left_out() -> None:
    found = [MissionItem(3, 82, x=471000000, y=81000000, z=20.0), MissionItem(2, 205, -90.0)]
    assert PX4.decode(found) == [
        OtherItem(82, "it has a spline, which a mission of UAL has not (MAVLink command 82): delete it"),
        OtherItem(205, "it has camera and gimbal, which a mission of UAL has not (MAVLink command 205): delete it"),
    ]
    assert PX4.digest(found) != PX4.digest(found[:1])


def test_an_autopilot_without_a_mission_has_no_items() -> None:
    assert COPTER.decode([]) == COPTER.decode([MissionItem(0, 16)]) == []
    assert PX4.decode([]) == []


def test_what_arducopter_keeps_without_an_altitude_or_a_position_is_no_item_of_ours() -> None:
    home, first = MissionItem(0, 16), MissionItem(3, 16, x=471000000, y=81000000, z=20.0)
    without = [first._replace(z=0.0), first._replace(x=0, y=0), MissionItem(3, 21)]
    found = COPTER.decode([home, first, *without])
    assert found[0] == Waypoint(47.1, 8.1, 20.0)
    assert [type(each) for each in found[1:]] == [OtherItem] * 3
