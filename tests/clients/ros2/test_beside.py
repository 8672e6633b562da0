"""What ROS has of a UAV beside flying, between messages and values of UAL, without ROS."""

from __future__ import annotations

import asyncio
import hashlib
import math
import re
from collections.abc import AsyncIterable, AsyncIterator, Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import pytest

import ual
from tests.clients.ros2 import messages
from tests.waiting import until_async
from ual.cameras import CameraAbility, CameraInfo, CameraIntrinsics, CameraStatus, Photo
from ual.corrections import CorrectionsStatus
from ual.fences import FencePlan, FenceZone, KeptFence, RallyPoint
from ual.gimbals import AngleRange, GimbalAbility, GimbalAngles, GimbalInfo, GimbalReference, GimbalStatus
from ual.gripper import Equipment, RelayInfo, ServoInfo, WinchInfo, WinchStatus
from ual.logs import Log, LogChunk
from ual.missions import (
    CameraAction,
    CameraTrigger,
    Heading,
    HoldTime,
    Item,
    Jump,
    Land,
    MissionProgress,
    MissionStage,
    OtherItem,
    RegionOfInterest,
    RegionOfInterestEnd,
    ReturnToLaunch,
    Speed,
    TakeOff,
    Waypoint,
)
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    FailsafeTriggered,
    Fault,
    LinkLost,
    MotorsWeak,
    PositionLost,
)
from ual_ros2.beside import cameras, corrections, equipment, fence, gimbals, logs, mission_items, missions, simulation
from ual_ros2.beside.fields import Stamp, named
from ual_ros2.beside.filling import Filling
from ual_ros2.ros_time import RosTime

PACKAGE = Path(__file__).parents[3] / "clients" / "ros2" / "ual_msgs" / "msg"


def declared(name: str) -> dict[str, str]:
    """The fields of a message, and their types."""
    lines = [re.sub(r"\s*#.*", "", line) for line in (PACKAGE / f"{name}.msg").read_text().splitlines()]
    found = (re.fullmatch(r"(\S+) (\w+)", line) for line in lines)
    return {each[2]: each[1] for each in found if each}


def message(name: str, **fields: Any) -> SimpleNamespace:
    """A message with what a message of ROS has where nothing is put in, and with some fields."""
    made = SimpleNamespace()
    for field, kind in declared(name).items():
        setattr(made, field, _empty(kind))
    vars(made).update(fields)
    return made


def _empty(kind: str) -> Any:
    if kind.endswith("]"):
        return []
    if kind == "GeoPoint":
        return SimpleNamespace(latitude=0.0, longitude=0.0)
    if kind == "geometry_msgs/Vector3":
        return messages.vector()
    return {"string": "", "bool": False}.get(kind, 0.0 if kind.startswith("float") else 0)


def plain(value: Any) -> Any:
    """Fields as messages."""
    if isinstance(value, Mapping):
        return SimpleNamespace(**{name: plain(each) for name, each in value.items()})
    return [plain(each) for each in value] if isinstance(value, list) else value


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("Gimbal", gimbals.info_fields(GimbalInfo(0, "g", frozenset()))),
        ("GimbalStatus", gimbals.status_fields("uav_1", 0, GimbalStatus())),
        ("Camera", cameras.info_fields(CameraInfo(0, "c", frozenset()))),
        ("CameraStatus", cameras.status_fields(CameraStatus())),
        ("Photo", cameras.photo_fields(0, Photo(0, 1.0))),
        ("Viewpoint", cameras.viewpoint_fields(Photo(0, 1.0))),
        ("KeptFence", fence.kept_fields(KeptFence(()))),
        ("WinchStatus", equipment.winch_fields(WinchStatus())),
        ("Log", logs.log_fields(Log("1", 2))),
    ],
)
def test_all_fields_of_a_message_are_told(name: str, fields: Mapping[str, Any]) -> None:
    assert fields.keys() == declared(name).keys()


# --- Gimbals and cameras ----------------------------------------------------------------------------------------------


def test_where_a_gimbal_looks() -> None:
    target = ual.PointStamped(ual.Vector3(1.0, 2.0, 3.0), "map")
    status = GimbalStatus(5.0, GimbalAngles(0.1, 0.2, 0.3), ual.Quaternion(0.0, 0.0, 0.0, 1.0), target=target)
    told = gimbals.status_fields("uav_1", 2, status)
    assert (told["roll"], told["pitch"], told["yaw"], told["gimbal"]) == (0.1, 0.2, 0.3, 2)
    assert told["header"] == {"frame_id": "uav_1/base_link", "stamp": Stamp(5.0)}
    assert told["target"] == {"header": {"frame_id": "map"}, "point": {"x": 1.0, "y": 2.0, "z": 3.0}}
    assert told["in_body"]["w"] == 1.0
    assert told["in_odom"]["w"] == 0.0, "what is not known is no rotation"
    assert math.isnan(told["off_target"])
    assert math.isnan(gimbals.status_fields("uav_1", 2, GimbalStatus())["pitch"])


def test_what_a_gimbal_can_do() -> None:
    able = frozenset({GimbalAbility.YAW, GimbalAbility.ROLL})
    told = gimbals.info_fields(GimbalInfo(0, "g", able, roll=AngleRange(-0.5, 0.25)))
    assert told["abilities"] == ["ROLL", "YAW"]
    assert told["roll"] == [-0.5, 0.25]
    assert all(math.isnan(each) for each in told["yaw"])


def test_a_name_that_is_none_is_refused_with_those_that_are() -> None:
    assert named(GimbalReference, "", "reference", GimbalReference.HORIZON) is GimbalReference.HORIZON
    assert named(GimbalReference, "EARTH", "reference") is GimbalReference.EARTH
    for text in ("earth", ""):
        with pytest.raises(ual.InvalidArgumentError, match=r"reference: '.*' is none of BODY, HORIZON, EARTH"):
            named(GimbalReference, text, "reference")


def test_shares_of_a_camera_are_of_1_and_its_storage_is_in_bytes() -> None:
    told = cameras.status_fields(CameraStatus(zoom_percent=25.0, storage=cameras_storage(2.0)))
    assert (told["zoom"], told["storage_available"]) == (0.25, 2.0 * 1024 * 1024)
    assert math.isnan(told["focus"])
    assert math.isnan(told["storage_total"])


def cameras_storage(available_mib: float) -> Any:
    return CameraStatus().storage.__class__(available_mib=available_mib)


def test_a_camera_says_how_it_is_calibrated() -> None:
    intrinsics = CameraIntrinsics(64, 48, 50.0, 51.0, 31.5, 23.5)
    told = cameras.info_fields(CameraInfo(0, "c", frozenset(), intrinsics=intrinsics))["camera_info"]
    assert (told["width"], told["k"][0], told["k"][4], told["k"][2]) == (64, 50.0, 51.0, 31.5)
    assert not any(cameras.info_fields(CameraInfo(0, "c", frozenset()))["camera_info"]["k"])


def test_pictures_are_told_once_and_from_anew_where_a_daemon_began_anew() -> None:
    taken = [Photo(number, float(number)) for number in range(3)]

    class FakeCamera:
        async def photos(self, first: int = 0) -> list[Photo]:
            return [each for each in taken if each.number >= first]

    class FakeCameras(dict[int, FakeCamera]):
        async def get_all(self) -> list[CameraInfo]:
            return [CameraInfo(0, "c", frozenset({CameraAbility.PHOTO})), CameraInfo(1, "without", frozenset())]

    uav: Any = SimpleNamespace(cameras=FakeCameras({0: FakeCamera()}))

    async def check() -> list[list[int]]:
        photos, told = cameras.Photos(), []

        async def look() -> None:
            told.append([each["number"] for each in await photos.get_new(uav)])

        await photos.begin(uav)
        await look()
        taken.extend([Photo(3, 3.0), Photo(4, 4.0)])
        await look()
        await look()
        taken[:] = [Photo(0, 9.0)]
        await look()
        return told

    assert asyncio.run(check()) == [[], [3, 4], [], [0]]


# --- What is carried --------------------------------------------------------------------------------------------------


def test_devices_have_their_bounds_and_positions() -> None:
    found = Equipment(
        winches=(WinchInfo("hook", WinchStatus(length_m=2.5, is_healthy=True)), WinchInfo("other")),
        servos=(ServoInfo("door", 1000, 2000, (("open", 1100), ("shut", 1900))),),
        relays=(RelayInfo("lamp", "lit", "dark", False),),
    )
    hook, other, door, lamp = equipment.devices(found)
    assert (hook["winch"][0]["length"], hook["winch"][0]["is_healthy"]) == (2.5, True)
    assert "winch" not in other
    assert (door["positions"], door["pulses"]) == (["open", "shut"], [1100, 1900])
    assert (door["min_pulse"], door["max_pulse"]) == (1000, 2000)
    assert (lamp["positions"], lamp["state"]) == (["lit", "dark"], "dark")


# --- The fence --------------------------------------------------------------------------------------------------------


def test_zones_and_rally_points_are_read_as_they_are_told() -> None:
    polygon = FenceZone(True, ((47.0, 8.0), (47.1, 8.0), (47.0, 8.1)))
    circle = FenceZone(False, ((47.0, 8.0),), 25.0)
    points = (RallyPoint(47.0, 8.0, 30, ual.AltitudeReference.AMSL), RallyPoint(47.0, 8.0, 10))
    told = plain(fence.kept_fields(KeptFence((polygon, circle), points, False, (47.5, 8.5))))
    assert tuple(map(fence.zone, told.zones)) == (polygon, circle)
    assert tuple(map(fence.rally_point, told.rally_points)) == points
    assert (told.is_enabled, told.is_enabled_known, told.return_point[0].latitude) == (False, True, 47.5)
    assert not fence.kept_fields(KeptFence(()))["is_enabled_known"]


PLAN = (
    '{"fileType": "Plan", "geoFence": {"circles": [{"inclusion": true, "circle": {"center": [47, 8], "radius": 9}}]}}'
)


@pytest.fixture
def uploaded() -> Callable[[Mapping[str, Any]], list[object]]:
    asked = {"file": "", "zones": [], "rally_points": [], "is_configured": False}
    more = {"replace": True, "is_only_kept": True, "force": False}

    def upload(given: Mapping[str, Any]) -> list[object]:
        sent: list[object] = []

        async def take(plan: object, **options: bool) -> KeptFence:
            assert options == {"replace": True, "enable": False, "force": False}
            sent.append(plan)
            return KeptFence(())

        uav: Any = SimpleNamespace(fence=SimpleNamespace(upload=take))
        asyncio.run(_awaited(fence.upload(uav, SimpleNamespace(**{**asked, **more, **given}))))
        return sent

    return upload


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ({"file": PLAN}, FencePlan((FenceZone(True, ((47.0, 8.0),), 9.0),))),
        ({"is_configured": True}, None),
        ({}, FencePlan(())),
    ],
)
def test_what_is_uploaded(uploaded: Any, given: Mapping[str, Any], meant: object) -> None:
    assert uploaded(given) == [meant]


@pytest.mark.parametrize(
    ("given", "text"),
    [({"file": "no plan"}, "file: it is neither a plan"), ({"file": PLAN, "is_configured": True}, "file: give one of")],
)
def test_what_is_said_in_two_ways_or_is_no_file_is_refused(uploaded: Any, given: Mapping[str, Any], text: str) -> None:
    with pytest.raises(ual.InvalidArgumentError, match=text):
        uploaded(given)


async def _awaited(awaitable: Any) -> Any:
    return await awaitable


# --- Missions ---------------------------------------------------------------------------------------------------------

ITEMS: tuple[Item, ...] = (
    TakeOff(10.0, number="1"),
    TakeOff(10.0, ual.AltitudeReference.AMSL, 47.0, 8.0),
    Waypoint(47.0, 8.0, 20.0),
    Waypoint(47.0, 8.0, 20.0, ual.AltitudeReference.AMSL, 3.0, 2.0, 1.5),
    Waypoint(47.0, 8.0, 20.0, yaw_rad=0.0),
    HoldTime(4.0),
    Speed(3.0),
    Heading(1.0),
    RegionOfInterest(47.0, 8.0, 5.0),
    RegionOfInterestEnd(),
    CameraTrigger(CameraAction.BY_DISTANCE, 10.0),
    Land(47.0, 8.0),
    ReturnToLaunch(),
    Jump(2, 3),
    OtherItem(183, "a servo"),
)


@pytest.mark.parametrize("item", ITEMS, ids=lambda item: type(item).__name__)
def test_an_item_is_read_as_it_is_told(item: Item) -> None:
    told = mission_items.item_fields(item)
    assert told.keys() <= declared("MissionItem").keys()
    [read] = mission_items.items([message("MissionItem", **vars(plain(told)))])
    assert (read, read.number) == (item, item.number)


def test_an_item_that_is_none_is_named() -> None:
    with pytest.raises(ual.InvalidArgumentError, match=r"items\[1\].kind: 'FLIP' is none of TAKE_OFF, WAYPOINT"):
        mission_items.items([message("MissionItem", kind="LAND"), message("MissionItem", kind="FLIP")])


class FakeMission:
    """A mission that is flown until it is cancelled."""

    def __init__(self) -> None:
        self.may_begin, self.cancelled = asyncio.Event(), asyncio.Event()
        self.id = "mission-1"
        self.abort_count = 0

    async def start(self, first_item: int, on_link_loss: object) -> FakeMission:
        assert (first_item, on_link_loss) == (1, None)
        await self.may_begin.wait()
        return self

    async def watch(self) -> AsyncIterator[MissionProgress]:
        yield MissionProgress(MissionStage.COMPLETE, 7, 7)  # of the mission before
        await self.may_begin.wait()
        yield MissionProgress(MissionStage.ACTIVE, 2, 1, self.id)
        await asyncio.Event().wait()

    async def task(self, task_id: str) -> FakeMission:
        assert task_id == self.id
        return self

    async def wait(self) -> None:
        await self.cancelled.wait()
        raise ual.TaskAbortedError("aborted", {})

    async def cancel(self) -> None:
        self.cancelled.set()

    async def abort(self) -> None:
        self.abort_count += 1
        raise ual.WrongStateError("nothing to abort", {})


async def run_ready() -> None:
    for _ in range(20):
        await asyncio.sleep(0)


@pytest.mark.parametrize("cancels_count", [1, 2])
@pytest.mark.parametrize("has_begun", [True, False])
def test_a_cancel_ends_a_mission_also_one_that_is_about_to_begin(has_begun: bool, cancels_count: int) -> None:
    """Also where the node ends while the cancel is under way."""

    async def check() -> None:
        mission = FakeMission()
        uav: Any = SimpleNamespace(mission=mission, task=mission.task, abort=mission.abort)
        flights = missions.MissionFlights()
        flying = asyncio.create_task(_awaited(flights.fly(uav, SimpleNamespace(first_item=0, on_link_loss=""))))
        await run_ready()
        assert flights.progress_of(mission.id) is None
        if has_begun:
            mission.may_begin.set()
            await run_ready()
            told = flights.progress_of(mission.id)
            assert told is not None
            assert (told["mission"]["item"], told["mission"]["reached"], told["mission"]["stage"]) == (2, 1, "ACTIVE")
        for _ in range(cancels_count):
            flying.cancel()
            await run_ready()
        mission.may_begin.set()
        with pytest.raises(asyncio.CancelledError):
            await flying
        await run_ready()
        assert mission.cancelled.is_set()
        assert mission.abort_count == (0 if has_begun else 1)

    asyncio.run(check())


# --- Logs -------------------------------------------------------------------------------------------------------------

CONTENT = bytes(range(256)) * 3


class FakeLogs:
    async def get_all(self) -> list[Log]:
        return [Log("../../evil/1.ulg", len(CONTENT), 7.0)]

    async def download(self, log_id: str, offset: int = 0) -> AsyncIterator[LogChunk]:
        [log] = await self.get_all()
        assert log_id == log.id
        yield LogChunk(log, offset, CONTENT[offset:500])
        yield LogChunk(log, 500, CONTENT[500:], hashlib.sha256(CONTENT[offset:]).hexdigest())


def test_a_log_is_written_into_the_directory_whatever_its_name(tmp_path: Path) -> None:
    uav: Any = SimpleNamespace(logs=FakeLogs(), ns="uav_1")
    downloads = logs.Downloads(tmp_path)
    told = asyncio.run(_awaited(downloads.download(uav, SimpleNamespace(log_id="../../evil/1.ulg"))))
    assert [each.name for each in tmp_path.iterdir()] == ["uav_1_.._.._evil_1.ulg"]
    assert Path(told["file"]).read_bytes() == CONTENT
    assert told["sha256"] == hashlib.sha256(CONTENT).hexdigest()
    with pytest.raises(ual.InvalidArgumentError, match="there is no log 'other'"):
        asyncio.run(_awaited(downloads.download(uav, SimpleNamespace(log_id="other"))))


def test_a_log_is_written_by_one_download_at_a_time(tmp_path: Path) -> None:
    """A second one would empty the file under the first, which then ends well with a hole in it."""

    class SlowLogs(FakeLogs):
        def __init__(self) -> None:
            self.came = asyncio.Event()

        async def download(self, log_id: str, offset: int = 0) -> AsyncIterator[LogChunk]:
            async for each in super().download(log_id, offset):
                yield each
                await self.came.wait()

    async def check() -> None:
        uav: Any = SimpleNamespace(logs=SlowLogs(), ns="uav_1")
        downloads, goal = logs.Downloads(tmp_path), SimpleNamespace(log_id="../../evil/1.ulg")
        first = asyncio.ensure_future(downloads.download(uav, goal))
        await until_async(lambda: (downloads.progress(goal) or {}).get("done"))
        with pytest.raises(ual.WrongStateError, match="is being downloaded already"):
            await asyncio.wait_for(downloads.download(uav, SimpleNamespace(log_id=goal.log_id)), 30.0)
        uav.logs.came.set()
        for told in (await first, await downloads.download(uav, goal)):
            assert told["sha256"] == hashlib.sha256(CONTENT).hexdigest()

    asyncio.run(check())


def test_without_a_directory_no_log_is_written() -> None:
    with pytest.raises(ual.PermissionDeniedError, match="log_directory:=DIRECTORY"):
        asyncio.run(_awaited(logs.Downloads(None).download(SimpleNamespace(), SimpleNamespace(log_id="1"))))  # type: ignore[arg-type]  # it is not used


# --- Corrections ------------------------------------------------------------------------------------------------------


class FakeReceiver:
    """Takes a stream, or refuses it."""

    def __init__(self, error: ual.UalError | None = None) -> None:
        self.error = error
        self.taken: list[bytes] = []
        self.ended_count = 0

    async def stream(self, rtcm: AsyncIterable[bytes], sender: str) -> CorrectionsStatus:
        assert sender == "ual_ros2"
        async for each in rtcm:
            if self.error is not None:
                raise self.error
            self.taken.append(each)
        self.ended_count += 1
        return CorrectionsStatus()


async def _corrected(receiver: FakeReceiver, act: Callable[[corrections.Corrections], Any]) -> corrections.Corrections:
    uav: Any = SimpleNamespace(corrections=receiver, ns="uav_1")
    streaming = corrections.Corrections(asyncio.get_running_loop(), uav, idle_s=0.05)
    running = asyncio.create_task(streaming.run())
    await run_ready()
    act(streaming)
    await until_async(lambda: receiver.ended_count or streaming.refusal)
    await run_ready()
    running.cancel()
    return streaming


def test_a_cancel_that_comes_with_a_message_ends_the_stream() -> None:
    async def check() -> bool:
        uav: Any = SimpleNamespace(corrections=FakeReceiver(), ns="uav_1")
        streaming = corrections.Corrections(asyncio.get_running_loop(), uav, idle_s=60.0)
        running = asyncio.create_task(streaming.run())
        await run_ready()
        streaming.put(b"a")
        await run_ready()
        streaming.put(b"b")
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        running.cancel()
        await run_ready()
        return running.cancelled()

    assert asyncio.run(check())


def put_all(streaming: corrections.Corrections, sent: Sequence[bytes]) -> None:
    for each in sent:
        streaming.put(each)


def test_all_that_comes_is_streamed_and_the_stream_ends_when_no_more_comes() -> None:
    receiver = FakeReceiver()
    sent = [b"a", b"b", b"c"]
    streaming = asyncio.run(_corrected(receiver, lambda it: put_all(it, sent)))
    assert receiver.taken == sent
    assert (streaming.received_count, streaming.not_taken_count, streaming.refusal) == (3, 0, "")


def test_what_is_refused_is_counted_and_told() -> None:
    receiver = FakeReceiver(ual.ResourceExhaustedError("ual rtcm sends", {"held_by": "ual rtcm"}))
    streaming = asyncio.run(_corrected(receiver, lambda it: put_all(it, [b"a", b"b"])))
    assert (streaming.received_count, streaming.not_taken_count) == (2, 2)
    assert streaming.fields()["refusal"] == "RESOURCE_EXHAUSTED: ual rtcm sends"


# --- The simulation ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("is_simulation", "refusal", "is_offered", "asked_count"),
    [
        (False, None, False, 0),
        (True, None, True, 1),
        (True, ual.NotSupportedError("there is no such service"), False, 1),
        (True, ual.DaemonUnreachableError("it has ended"), False, 1),
    ],
)
def test_the_simulation_of_a_real_uav_is_not_asked_for(
    is_simulation: bool, refusal: Exception | None, is_offered: bool, asked_count: int
) -> None:
    parts = AsyncMock(return_value=frozenset(), side_effect=refusal)
    uav: Any = SimpleNamespace(simulation=SimpleNamespace(parts=parts))
    info: Any = SimpleNamespace(is_simulation=is_simulation)
    assert asyncio.run(_awaited(simulation.is_offered(uav, info))) is is_offered
    assert parts.await_count == asked_count


FAULTS: tuple[Fault, ...] = (
    LinkLost(),
    PositionLost(),
    EstimatorJumps(ual.Vector3(1.0, 2.0, 3.0), 4.0),
    MotorsWeak(0.25),
    BatteryLow(50.0),
    CommandRefused(Command.TAKE_OFF, "no"),
    AckLost(),
    AckLate(Command.ARM, 2.0),
    FailsafeTriggered("fence"),
)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: type(fault).__name__)
def test_a_fault_is_read_as_it_is_told(fault: Fault) -> None:
    told = simulation.fault_fields(fault)
    assert told.keys() <= declared("Fault").keys()
    assert simulation.fault(message("Fault", **vars(plain(told)))) == fault


def test_a_fault_that_is_none_is_refused() -> None:
    with pytest.raises(ual.InvalidArgumentError, match="kind: 'FIRE' is none of LINK_LOST"):
        simulation.fault(message("Fault", kind="FIRE"))


# --- Filling ----------------------------------------------------------------------------------------------------------


def test_fields_are_put_into_messages_with_stamps_of_ros_time() -> None:
    clock = SimpleNamespace(ros_time_is_active=True, now=lambda: SimpleNamespace(nanoseconds=50_000_000_000))
    filling = Filling(RosTime(clock, lambda: 1000.0))
    there = SimpleNamespace(header=messages.header(), text="")
    filled = filling.filled(there, {"header": {"frame_id": "map", "stamp": Stamp(999.5)}, "text": "it"})
    assert (filled.header.frame_id, filled.header.stamp.sec, filled.text) == ("map", 49, "it")
    assert filling.filled(messages.header(), {"stamp": Stamp(0.0)}).stamp.sec == 0, "what is not known stays 0"
