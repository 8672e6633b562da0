"""Answers that no autopilot and no camera gives: missions, fence, rally points and cameras.

Nothing crashes, each wait ends, and nothing is believed that did not come. More of it: ``UAL_TEST_FUZZ=100000``.
"""

from __future__ import annotations

import math
import os
import random
from collections.abc import Callable
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any, cast

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.protocols.simulated_camera import STEP_S, Bench
from tests.ual_daemon.backends.mavlink.protocols.test_mission_transfers import BadLink, store
from ual.cameras import CameraStatus, Photo, VideoStream
from ual.errors import UalError
from ual.fences.values import FenceZone, KeptFence, RallyPoint
from ual.missions import HoldTime, Item, Land, Speed, TakeOff, Waypoint
from ual.missions.plan import StoredMission
from ual.types import GeoPoint
from ual.wire import camera as wire_camera
from ual.wire import fence as wire_fence
from ual.wire import mission as wire_mission
from ual.wire.rally_points import rally_point_to_proto
from ual_daemon.backends.firmwares.mission_items import MissionItem, MissionList
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.offers.lists import MavlinkLists, fence_of, missions_of
from ual_daemon.backends.mavlink.offers.parameters import MavlinkParameters
from ual_daemon.backends.mavlink.offers.protocol_access import ProtocolAccess
from ual_daemon.backends.mavlink.protocols.cameras import MESSAGE_IDS
from ual_daemon.backends.mavlink.protocols.mission_exchange import LONGEST_TRANSFER_S
from ual_daemon.backends.mavlink.protocols.mission_progress import MissionProgressProtocol
from ual_daemon.backends.mavlink.protocols.mission_sender import item_of
from ual_daemon.backends.mavlink.protocols.mission_transfers import MissionTransfers
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame, MessageSource, split
from ual_daemon.backends.mavlink.wire.messages import Codec, Message

FUZZ_COUNT = int(os.environ.get("UAL_TEST_FUZZ", "4000"))
HERE = (7, 191)
MISSION: list[Item] = [TakeOff(10.0), Speed(4.0), Waypoint(47.1, 8.1, 20.0), HoldTime(3.0), Land(47.2, 8.2)]
ZONES = [FenceZone(True, ((47.0, 8.0), (47.2, 8.0), (47.1, 8.3))), FenceZone(False, ((47.1, 8.1),), 20.0)]
RALLY = [RallyPoint(47.1, 8.1, 20)]
COUNT, ITEM = mavlink.MAVLINK_MSG_ID_MISSION_COUNT, mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT
KINDS = (
    COUNT,
    ITEM,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
)
NASTY = (0.0, -1.0, 1.0, 3.0, 5.0, 1e38, -1e38, math.nan, math.inf, -math.inf)


class Invented:
    """Messages with any content, of a kind."""

    def __init__(self, noise: random.Random) -> None:
        self._noise = noise
        self._codec = Codec(1)

    def of(self, message_id: int, source: MessageSource) -> Any:
        """Returns a message of a kind; all its bytes may be anything."""
        kind = mavlink.mavlink_map[message_id]
        size = kind.unpacker.size
        bytes_ = self._noise.randbytes
        content = self._noise.choice((bytes_(size), b"\xff" * size, b"\0", bytes_(size // 2 + 1)))
        head = bytes((len(content), 0, 0, 0, *source, *message_id.to_bytes(3, "little")))
        crc = mavlink.x25crc(head + content + bytes((kind.crc_extra,))).crc
        return self.received(b"\xfd" + head + content + int(crc).to_bytes(2, "little"))

    def received(self, data: bytes) -> Any:
        """Returns a message as it is received."""
        [frame] = split(data)[0]
        return self._codec.decode(frame)

    def item(self) -> MissionItem:
        """Returns an item of a mission, or of a fence."""
        noise = self._noise
        command = noise.choice(
            (16, 16, 19, 20, 21, 22, 93, 177, 178, 195, 201, 206, 2000, 5001, 5002, 5003, 5004, 5100)
        )
        frame = noise.choice((0, 2, 3, 3, 5, 6, 10, noise.randrange(256)))
        one, two, three, four, height = noise.choices((*NASTY, noise.uniform(-1e3, 1e3)), k=5)
        place = [noise.choice((0, 471000000, 81000000, noise.randrange(-(2**31), 2**31))) for _ in range(2)]
        return MissionItem(frame, command, one, two, three, four, place[0], place[1], height)


class FuzzedLink(BadLink):
    """A link on which a part of what the autopilot says is something else.

    `share` is how much; the stores of both firmwares are at the other end.
    """

    def __init__(self, kind: str, seed: int, share: float) -> None:
        super().__init__(store(kind), seed, loss=0.05)
        self.dialect: Dialect = Px4() if kind == "px4" else ArduCopter()
        self.transfers = MissionTransfers(self._ours_sends, lambda _: True)
        self.progress = MissionProgressProtocol(self._ours_sends, lambda _: True)
        for each in (self.transfers, self.progress):
            each.attach(MessageSource(7, 1), self.dialect)
        self.arrived_count = 0
        self.items: set[tuple[int, int, str]] = set()
        """The list, the number and the content of each item that has come."""
        self._invented, self._share = Invented(self.noise), share

    def keep_anything(self) -> None:
        """The autopilot has lists that no station of ours would upload."""
        for kind, most in ((0, 6), (1, 4), (2, 3)):
            item = self._invented.item
            items = [item() for _ in range(self.noise.randrange(most))]
            if kind:  # of its own commands
                commands = (5001, 5002, 5003, 5004) if kind == 1 else (5100,)
                items = [each._replace(command=self.noise.choice(commands)) for each in items]
            self.store.keep(kind, items)

    def _arrive(self, is_up: bool, data: bytes) -> None:
        [frame] = split(data)[0]
        if is_up and frame.message_id == mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT:
            self.send(mavlink.MAVLink_mission_current_message(self._ours.decode(frame).seq, 5, 2, 2), self.now_s)
            return
        if is_up:
            super()._arrive(is_up, data)
            return
        for message in self._spoilt(frame):
            self._take(message)

    def _spoilt(self, frame: MavlinkFrame) -> list[Any]:
        dice = self.noise.random()
        if dice >= self._share:
            return [self._ours.decode(frame)]
        if dice < self._share / 4.0:
            return []
        if dice < self._share / 2.0:
            return [self._invented.of(self.noise.choice(KINDS), MessageSource(7, 1))]
        return [self._ours.decode(frame), self._invented.received(self._theirs.encode(self._likely()))]

    def _likely(self) -> Message:
        """Returns a message that fits, but for what it says."""
        noise = self.noise
        kind, seq = noise.choice((0, 0, 1, 1, 2, 255)), noise.choice((0, 0, 1, 1, 2, 3, 4, 5, 65535))
        chosen = noise.randrange(5)
        if chosen == 0:
            return mavlink.MAVLink_mission_count_message(*HERE, noise.choice((0, 1, 3, 4, 5, 6, 65535)), kind)
        if chosen == 1:
            item = self._invented.item()
            return mavlink.MAVLink_mission_item_int_message(
                *HERE, seq, item.frame, item.command, 0, 1, *item[2:6], *item[6:9], kind
            )
        if chosen == 2:
            return mavlink.MAVLink_mission_request_int_message(*HERE, seq, kind)
        if chosen == 3:
            return mavlink.MAVLink_mission_current_message(seq, 5, noise.randrange(8), 2)
        return mavlink.MAVLink_mission_ack_message(*HERE, noise.choice((0, 1, 13, 14, 15, noise.randrange(256))), kind)

    def _take(self, message: Any) -> None:
        self.arrived_count += 1
        if message.get_msgId() == ITEM:
            self.items.add((message.mission_type, message.seq, repr(item_of(message))))
        for each in (self.transfers, self.progress):
            handler = each.handlers.get(message.get_msgId())
            if handler is not None:
                handler(message, self.now_s)

    def step(self) -> None:
        super().step()
        self.progress.tick(self.now_s)


class FuzzedAccess:
    """As `ProtocolAccess`, in one thread. Keeps what each list was that was believed."""

    def __init__(self, link: FuzzedLink) -> None:
        self._link = link
        self.believed: list[tuple[str, MissionList]] = []

    def session(self) -> Any:
        heard = self._link.progress.heard
        return SimpleNamespace(dialect=self._link.dialect, mission_news=heard)

    def run_on_loop(self, what: str, begin: Callable[[Any, Future[Any]], None]) -> Future[Any]:
        future: Future[Any] = Future()

        def keep(done: Future[Any]) -> None:
            if not done.cancelled() and done.exception() is None and isinstance(done.result(), MissionList):
                self.believed.append((what, done.result()))

        future.add_done_callback(keep)
        begin(SimpleNamespace(missions=self._link.transfers, progress=self._link.progress), future)
        return future


def ended(link: FuzzedLink, futures: list[Future[Any]]) -> list[Any]:
    """Waits for the futures. Returns the results of those without an error, which can only be one of ours."""
    until_s = link.now_s + (len(futures) + 1) * 8.0 * LONGEST_TRANSFER_S
    while not all(each.done() for each in futures):
        link.step()
        assert link.now_s < until_s, "it does not end"
    errors = [each.exception() for each in futures]
    assert all(error is None or isinstance(error, UalError) for error in errors), errors
    return [each.result() for each, error in zip(futures, errors, strict=True) if error is None]


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_whatever_is_answered_no_list_is_believed_that_did_not_come(kind: str) -> None:
    link = FuzzedLink(kind, seed=len(kind), share=0.3)
    reach = FuzzedAccess(link)
    to_link = cast("ProtocolAccess", reach)
    lists = MavlinkLists(to_link)
    missions = missions_of(to_link, lists, MavlinkParameters(to_link), Future, lambda: GeoPoint(47.0, 8.0, 500.0))
    fence = fence_of(to_link, lists)
    believed_count = 0
    while link.arrived_count < FUZZ_COUNT // 2:
        link.keep_anything()
        kept: list[Future[Any]] = [missions.download(), fence.read(), fence.read_rally()]
        uploads = [missions.upload(MISSION, lambda: None), missions.clear(lambda: None)]
        zones = [fence.write(ZONES, lambda: None), fence.read(), fence.write([], lambda: None)]
        rally = [fence.write_rally(RALLY, lambda: None), fence.read_rally()]
        chosen = missions.set_current(MISSION, 3, lambda: None, anew=False)
        link.items.clear()
        results = ended(link, [*kept, *uploads, missions.download(), *zones, *rally, chosen])
        for what, found in reach.believed:
            which = 1 if "fence" in what else 2 if "rally" in what else 0
            missing = [
                (seq, item) for seq, item in enumerate(found.items) if (which, seq, repr(item)) not in link.items
            ]
            assert not missing, (what, missing)
        believed_count += len(reach.believed)
        reach.believed.clear()
        _can_be_reported(results)
        missions.report()
    assert believed_count > 3


def _can_be_reported(results: list[Any]) -> None:
    """Checks that believed values can be sent to a client."""
    for each in results:
        if hasattr(each, "digest"):
            wire_mission.stored_mission_to_proto(StoredMission(each.items, each.digest))
        elif isinstance(each, tuple) and all(isinstance(part, FenceZone) for part in each):
            wire_fence.kept_fence_to_proto(KeptFence(each))
        elif isinstance(each, tuple):
            list(map(rally_point_to_proto, each))


class FuzzedCamera(Bench):
    """A camera of whose messages a part is something else."""

    def __init__(self, seed: int) -> None:
        super().__init__(loss=0.05, seed=seed)
        self.noise = random.Random(seed)
        self.arrived_count = 0
        self._invented = Invented(self.noise)
        self._source_of_all = MessageSource(7, mavlink.MAV_COMP_ID_CAMERA)

    def step(self) -> None:
        super().step()
        for message_id, handler in self.cameras.handlers.items():  # of the camera that the autopilot triggers
            if self.noise.random() < 0.05:
                self.arrived_count += 1
                handler(self._invented.of(message_id, MessageSource(7, 1)), self.now_s)
        if self.noise.random() < 0.3:
            message = self._invented.of(self.noise.choice(sorted(MESSAGE_IDS)), self._source_of_all)
            self.arrived_count += 1
            self.cameras.on_component(self._source_of_all, message, self.now_s, 1.9e9)


@pytest.mark.parametrize("seed", [1, 2])
def test_whatever_a_camera_answers_each_order_ends_and_what_it_tells_can_be_reported(seed: int) -> None:
    bench = FuzzedCamera(seed)
    link = bench.found()
    kinds: tuple[Callable[[Future[Any]], object], ...] = (
        link.shoot,
        link.read_status,
        link.list_streams,
        bench.cameras.trigger.await_photo,
        lambda future: link.order(mavlink.MAV_CMD_VIDEO_START_CAPTURE, (0.0, 1.0), future),
    )
    while bench.arrived_count < FUZZ_COUNT // 4:
        made: list[Future[Any]] = [Future() for _ in kinds]
        for begin, future in zip(kinds, made, strict=True):
            begin(future)
        link.start_distance(2.0)
        bench.until(lambda made=made: all(each.done() for each in made), 120.0)  # type: ignore[misc]
        link.stop_distance()
        for each in made:
            error = each.exception()
            assert error is None or isinstance(error, UalError), error
            if error is None:
                _camera_can_be_reported(each.result())
        wire_camera.camera_info_to_proto(link.info(bench.now_s))
        wire_camera.camera_status_to_proto(link.status())
        assert link.photos.count <= bench.arrived_count + len(bench.camera.taken_ms)
        bench.run(STEP_S)


def _camera_can_be_reported(result: Any) -> None:
    if isinstance(result, CameraStatus):
        wire_camera.camera_status_to_proto(result)
    elif isinstance(result, list):
        for each in result:
            assert isinstance(each, VideoStream)
            wire_camera.video_stream_to_proto(each)
    elif result is not None:
        place = result.viewpoint.position_geo
        photo = wire_camera.photo_to_proto(Photo(result.number, result.stamp_s, result.is_stored, None, None, place))
        assert photo.stamp.ToJsonString()
