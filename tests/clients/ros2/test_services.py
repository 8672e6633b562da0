"""Services of a UAV in ROS other than flying, between messages and values of UAL, without ROS."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import AsyncIterable, AsyncIterator, Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import pytest

import ual
from tests.clients.ros2 import messages
from tests.waiting import until_async
from ual.cameras import CameraAbility, CameraInfo, Photo
from ual.corrections import CorrectionsStatus
from ual.fences import FencePlan, FenceZone, KeptFence
from ual.gimbals import GimbalReference
from ual.gripper import Equipment, RelayInfo, ServoInfo, WinchInfo, WinchStatus
from ual.logs import Log, LogChunk
from ual.missions import (
    MissionProgress,
    MissionStage,
)
from ual_ros2.ros_time import RosTime
from ual_ros2.services import cameras, corrections, equipment, fence, logs, missions, simulation
from ual_ros2.services.fields import Stamp, named
from ual_ros2.services.filling import Filling

# --- Gimbals and cameras ----------------------------------------------------------------------------------------------


def test_a_name_that_is_none_is_refused_with_those_that_are() -> None:
    assert named(GimbalReference, "", "reference", GimbalReference.HORIZON) is GimbalReference.HORIZON
    assert named(GimbalReference, "EARTH", "reference") is GimbalReference.EARTH
    for text in ("earth", ""):
        with pytest.raises(ual.InvalidArgumentError, match=r"reference: '.*' is none of BODY, HORIZON, EARTH"):
            named(GimbalReference, text, "reference")


def test_pictures_are_reported_once_and_from_anew_where_a_daemon_began_anew() -> None:
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

        async def poll_once() -> None:
            told.append([each["number"] for each in await photos.get_new(uav)])

        await photos.begin(uav)
        await poll_once()
        taken.extend([Photo(3, 3.0), Photo(4, 4.0)])
        await poll_once()
        await poll_once()
        taken[:] = [Photo(0, 9.0)]
        await poll_once()
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
def test_what_is_reported_twice_or_is_no_file_is_refused(uploaded: Any, given: Mapping[str, Any], text: str) -> None:
    with pytest.raises(ual.InvalidArgumentError, match=text):
        uploaded(given)


async def _awaited(awaitable: Any) -> Any:
    return await awaitable


# --- Missions ---------------------------------------------------------------------------------------------------------


def test_an_item_that_is_none_is_named_with_its_position() -> None:
    land = SimpleNamespace(kind="LAND", place=SimpleNamespace(latitude=47.0, longitude=8.0), number="")
    given = SimpleNamespace(file="", items=[land, SimpleNamespace(kind="FLIP")])
    with pytest.raises(ual.InvalidArgumentError, match=r"items\[1\].kind: 'FLIP' is none of TAKE_OFF") as refused:
        asyncio.run(_awaited(missions.plan(SimpleNamespace(), given)))  # type: ignore[arg-type]  # it is not used
    assert refused.value.metadata["field"] == "items[1].kind"


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
    downloads = logs.LogDownloads(tmp_path)
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
        downloads, goal = logs.LogDownloads(tmp_path), SimpleNamespace(log_id="../../evil/1.ulg")
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
        asyncio.run(_awaited(logs.LogDownloads(None).download(SimpleNamespace(), SimpleNamespace(log_id="1"))))  # type: ignore[arg-type]  # it is not used


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


async def _corrected(
    receiver: FakeReceiver, act: Callable[[corrections.CorrectionsRelay], Any]
) -> corrections.CorrectionsRelay:
    uav: Any = SimpleNamespace(corrections=receiver, ns="uav_1")
    streaming = corrections.CorrectionsRelay(asyncio.get_running_loop(), uav, idle_s=0.05)
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
        streaming = corrections.CorrectionsRelay(asyncio.get_running_loop(), uav, idle_s=60.0)
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


def put_all(streaming: corrections.CorrectionsRelay, sent: Sequence[bytes]) -> None:
    for each in sent:
        streaming.put(each)


def test_all_that_comes_is_streamed_and_the_stream_ends_when_no_more_comes() -> None:
    receiver = FakeReceiver()
    sent = [b"a", b"b", b"c"]
    streaming = asyncio.run(_corrected(receiver, lambda it: put_all(it, sent)))
    assert receiver.taken == sent
    assert (streaming.received_count, streaming.not_taken_count, streaming.refusal) == (3, 0, "")


def test_what_is_refused_is_counted_and_reported() -> None:
    receiver = FakeReceiver(ual.ResourceExhaustedError("ual rtcm sends", {"held_by": "ual rtcm"}))
    streaming = asyncio.run(_corrected(receiver, lambda it: put_all(it, [b"a", b"b"])))
    assert (streaming.received_count, streaming.not_taken_count) == (2, 2)
    assert streaming.fields()["refusal"] == "RESOURCE_EXHAUSTED: ual rtcm sends"


# --- The simulation ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("is_simulation", "refusal", "is_available", "asked_count"),
    [
        (False, None, False, 0),
        (True, None, True, 1),
        (True, ual.NotSupportedError("there is no such service"), False, 1),
        (True, ual.DaemonUnreachableError("it has ended"), False, 1),
    ],
)
def test_the_simulation_of_a_real_uav_is_not_requested(
    is_simulation: bool, refusal: Exception | None, is_available: bool, asked_count: int
) -> None:
    parts = AsyncMock(return_value=frozenset(), side_effect=refusal)
    uav: Any = SimpleNamespace(simulation=SimpleNamespace(parts=parts))
    info: Any = SimpleNamespace(is_simulation=is_simulation)
    assert asyncio.run(_awaited(simulation.is_available(uav, info))) is is_available
    assert parts.await_count == asked_count


# --- Filling ----------------------------------------------------------------------------------------------------------


def test_fields_are_put_into_messages_with_stamps_of_ros_time() -> None:
    clock = SimpleNamespace(ros_time_is_active=True, now=lambda: SimpleNamespace(nanoseconds=50_000_000_000))
    filling = Filling(RosTime(clock, lambda: 1000.0))
    there = SimpleNamespace(header=messages.header(), text="")
    filled = filling.filled(there, {"header": {"frame_id": "map", "stamp": Stamp(999.5)}, "text": "it"})
    assert (filled.header.frame_id, filled.header.stamp.sec, filled.text) == ("map", 49, "it")
    assert filling.filled(messages.header(), {"stamp": Stamp(0.0)}).stamp.sec == 0, "what is not known stays 0"
