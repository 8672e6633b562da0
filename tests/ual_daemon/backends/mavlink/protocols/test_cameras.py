"""The exchanges with cameras, message by message: what is asked, again or not any more, and how each ends."""

from __future__ import annotations

import math
import random
from concurrent.futures import Future
from functools import partial
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec, received
from tests.ual_daemon.backends.mavlink.fakes import Harness, heartbeat
from tests.ual_daemon.backends.mavlink.protocols.simulated_camera import BUSY, DENIED, STRAY, Bench
from ual.cameras import CameraAbility, CameraMode, Photo, StorageState, VideoStream
from ual.errors import LinkLostError, RejectedByAutopilotError, ResourceExhaustedError, UalTimeoutError
from ual.geometry import Pose, Quaternion
from ual.wire import camera as convert
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols import camera_link
from ual_daemon.backends.mavlink.protocols.camera_photos import MOST_MISSING_REPORTS, TRIES_COUNT, ReportedPhotos
from ual_daemon.backends.mavlink.protocols.cameras import MESSAGE_IDS
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.signing import Signer

START = mavlink.MAV_CMD_IMAGE_START_CAPTURE
VIDEO = mavlink.MAV_CMD_VIDEO_START_CAPTURE


def test_a_camera_is_found_by_its_heartbeat_and_says_what_it_is() -> None:
    bench = Bench()
    info = bench.found().info(bench.now_s)
    assert (info.number, info.name, info.firmware_version, info.is_connected) == (0, "Acme Eye", "1.2.0.0", True)
    assert info.abilities == frozenset(CameraAbility) - {CameraAbility.IMAGE}
    assert info.intrinsics is not None
    assert info.intrinsics.focal_length_x_px == pytest.approx(4000.0)
    assert (info.width_px, info.height_px) == (6000, 4000)


def test_one_that_does_not_say_what_it_is_can_do_nothing_and_is_queried_less_and_less() -> None:
    bench = Bench()
    bench.camera.ignored = {mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION}
    bench.run(60.0)
    info = bench.cameras.found[0].info(bench.now_s)
    assert info.abilities == frozenset()
    assert info.note == "it has not said what it is"
    assert 10 <= len(bench.sent) <= 16
    commands = {each.command for each in bench.sent}
    assert commands == {mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION}


def test_what_is_no_camera_is_not_taken_for_one() -> None:
    bench = Bench()
    gimbal = received(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GIMBAL, 8, 0, 0, 0, 3))
    bench.cameras.on_component(MessageSource(7, 100), gimbal, 1.0, 2.0)
    captured = received(mavlink.MAVLink_camera_capture_status_message(0, 0, 0, 0.0, 0, 0.0, 5))
    bench.cameras.on_component(MessageSource(7, 101), captured, 1.0, 2.0)
    assert bench.cameras.found == ()


def test_a_picture_ends_with_its_report() -> None:
    bench = Bench()
    link = bench.found()
    taken = bench.ended(link.shoot).result()
    assert (taken.number, taken.is_stored, taken.file_url) == (0, True, "http://camera/0.jpg")
    assert taken.stamp_s == pytest.approx(1.8e9 + bench.camera.taken_ms[0] / 1000.0)
    assert taken.viewpoint.body == bench.place
    assert taken.viewpoint.boots_count == 3
    assert taken.viewpoint.position_geo is not None
    assert taken.viewpoint.position_geo.altitude_amsl_m == 500.0
    assert taken.viewpoint.mounting is None
    assert link.photos.since(0) == [taken]


def test_a_picture_of_a_camera_on_a_gimbal_has_where_that_looked() -> None:
    bench = Bench()
    bench.camera.gimbal_device_id = 154
    asked: list[tuple[int, Pose | None]] = []
    down = Pose(orientation=Quaternion.from_euler(0.0, 1.5, 0.0))

    def carried(device_id: int, body: Pose | None) -> Pose:
        asked.append((device_id, body))
        return down

    bench.cameras.carried = carried
    taken = bench.ended(bench.found().shoot).result()
    assert taken.viewpoint.mounting == down
    assert asked == [(154, bench.place)]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_over_a_bad_link_a_picture_is_taken_once_and_reported_once(seed: int) -> None:
    """A third of the messages is lost each way. Each order ends, with its picture or with an error that says so."""
    bench = Bench(loss=0.3, seed=seed)
    link = bench.found()
    ended = [bench.ended(link.shoot) for _ in range(5)]
    good = [each.result() for each in ended if each.exception() is None]
    assert all(isinstance(each.exception(), UalTimeoutError | LinkLostError) for each in ended if each.exception())
    assert len(bench.camera.taken_ms) <= 5
    assert len({each.number for each in good}) == len(good)
    bench.loss = 0.0
    bench.run(10.0)
    bench.ended(link.read_status).result()
    bench.run(10.0)
    stamps = [round((each.stamp_s - 1.8e9) * 1000.0) for each in link.photos.since(0)]
    assert sorted(set(stamps)) == sorted(stamps)
    lost = link.status().missed_count
    assert len(stamps) + lost + (bench.camera.taken_ms.index(min(stamps)) if stamps else 0) == len(
        bench.camera.taken_ms
    )


def test_a_camera_that_answers_twice_and_late_ends_nothing_else() -> None:
    bench = Bench()
    link = bench.found()
    bench.camera.answers_twice = True
    bench.ended(partial(link.order, VIDEO, ())).result()
    bench.camera.result = DENIED
    with pytest.raises(RejectedByAutopilotError, match=r"camera 0 \(Acme Eye\) refused VIDEO_STOP_CAPTURE: DENIED"):
        bench.ended(partial(link.order, mavlink.MAV_CMD_VIDEO_STOP_CAPTURE, ())).result()


def test_an_order_that_was_repeated_keeps_the_next_one_of_its_kind_back() -> None:
    """Its late answers would be taken for those of the next."""
    bench = Bench()
    link = bench.found()
    bench.camera.ignored = {VIDEO}
    first: Future[None] = Future()
    link.order(VIDEO, (), first)
    bench.run(1.3)
    bench.camera.ignored = set()
    bench.until(first.done)
    sent_count, ended_s = len(bench.camera.orders), bench.now_s
    second: Future[None] = Future()
    link.order(VIDEO, (), second)
    bench.run(0.4)
    assert len(bench.camera.orders) == sent_count
    bench.until(second.done)
    assert bench.now_s - ended_s >= camera_link.LATE_ANSWER_S


def test_a_camera_that_does_not_answer_is_not_waited_for_without_end() -> None:
    bench = Bench()
    link = bench.found()
    bench.camera.ignored = {START}
    begin_s = bench.now_s
    with pytest.raises(UalTimeoutError, match="did not answer to IMAGE_START_CAPTURE in 10 tries"):
        bench.ended(link.shoot).result()
    assert bench.now_s - begin_s < 7.0


def test_a_camera_that_accepts_and_takes_none_is_not_waited_for_without_end() -> None:
    bench = Bench()
    link = bench.found()
    bench.camera.takes = False
    with pytest.raises(UalTimeoutError, match="has not told a picture for 12 s: it is not known"):
        bench.ended(link.shoot).result()
    bench.camera.result = BUSY
    begin_s = bench.now_s
    with pytest.raises(UalTimeoutError, match="was busy with VIDEO_START_CAPTURE for 12 s"):
        bench.ended(partial(link.order, VIDEO, ())).result()
    assert bench.now_s - begin_s < 14.0


def test_a_picture_that_failed_is_reported_and_counted() -> None:
    bench = Bench()
    link = bench.found()
    bench.camera.capture_result = 0
    with pytest.raises(RejectedByAutopilotError, match="says that the picture failed"):
        bench.ended(link.shoot).result()
    assert [each.is_stored for each in link.photos.since(0)] == [False]
    assert link.status().missed_count == 1


def test_a_picture_whose_report_is_lost_is_found_by_the_count() -> None:
    bench = Bench()
    link = bench.found()
    bench.ended(link.shoot).result()
    bench.camera.reports = False
    taken = bench.ended(link.shoot)
    assert taken.result().number == 1
    assert (link.photos.count, link.status().missed_count) == (2, 0)


def test_a_camera_that_vanishes_ends_what_waits_and_is_reported() -> None:
    bench = Bench()
    link = bench.found()
    bench.camera.ignored = {START}
    running: Future[Any] = Future()
    waiting: Future[None] = Future()
    link.shoot(running)
    link.order(VIDEO, (), waiting)
    bench.camera.is_there = False
    begin_s = bench.now_s
    bench.until(lambda: running.done() and waiting.done())
    assert bench.now_s - begin_s < 7.0
    for each in (running, waiting):
        assert isinstance(each.exception(), LinkLostError | UalTimeoutError)
    bench.run(6.0)
    assert not link.info(bench.now_s).is_connected
    with pytest.raises(LinkLostError, match="is not heard: its last message came"):
        bench.ended(partial(link.order, VIDEO, ())).result()
    sent_count = len(bench.sent)
    bench.run(20.0)
    assert len(bench.sent) == sent_count
    bench.camera.is_there, bench.camera.ignored, bench.camera.model = True, set(), b"Other"
    bench.until(lambda: link.info(bench.now_s).name == "Acme Other")
    assert bench.ended(link.shoot).result().number == 0
    assert len(bench.cameras.found) == 1


@pytest.mark.parametrize(
    ("storage", "state", "total_mib", "free_mib", "note"),
    [
        ((2, 1000.0, 400.0, 600.0), StorageState.READY, 1000.0, 600.0, ""),
        ((2, 1000.0, 999.5, 0.5), StorageState.FULL, 1000.0, 0.5, ""),
        ((0, 0.0, 0.0, 0.0), StorageState.NONE, 0.0, 0.0, ""),
        ((1, 100.0, 0.0, 100.0), StorageState.UNUSABLE, 100.0, 100.0, ""),
        ((3, 0.0, 0.0, 0.0), None, 0.0, 0.0, ""),
        ((2, 100.0, 0.0, 5000.0), StorageState.READY, 100.0, None, "cannot have 5000 of 100 MiB free"),
        ((2, math.nan, 0.0, -1.0), StorageState.READY, None, None, ""),
        ((2, math.inf, 0.0, math.inf), StorageState.READY, None, None, ""),
    ],
)
def test_a_storage_is_reported_as_far_as_it_can_be_so(
    storage: Any, state: StorageState | None, total_mib: float | None, free_mib: float | None, note: str
) -> None:
    bench = Bench()
    link = bench.found()
    bench.camera.storage = storage
    found = bench.ended(link.read_status).result().storage
    assert (found.state, found.total_mib, found.available_mib) == (state, total_mib, free_mib)
    assert note in link.info(bench.now_s).note
    assert bool(link.info(bench.now_s).note) is bool(note)


def test_its_status_is_requested_and_what_it_lacks_is_left_out() -> None:
    bench = Bench()
    link = bench.found()
    for command, params in (
        (mavlink.MAV_CMD_SET_CAMERA_MODE, (0.0, 2.0)),
        (mavlink.MAV_CMD_SET_CAMERA_ZOOM, (2.0, 25.0)),
        (VIDEO, ()),
        (START, (0.0, 2.0, 0.0, 0.0)),
    ):
        bench.ended(partial(link.order, command, params)).result()
    status = bench.ended(link.read_status).result()
    assert (status.mode, status.zoom_percent) == (CameraMode.SURVEY, 25.0)
    assert (status.is_taking_photos, status.interval_s) == (True, 2.0)
    assert (status.is_recording, status.recording_s) == (True, 5.0)
    bench.camera.ignored = {mavlink.MAV_CMD_REQUEST_MESSAGE}
    with pytest.raises(UalTimeoutError, match="did not send CAMERA_CAPTURE_STATUS in 10 tries"):
        bench.ended(link.read_status).result()


def test_an_older_camera_is_queried_by_the_commands_that_it_knows() -> None:
    bench = Bench()
    bench.camera.is_old = True
    link = bench.found()
    assert bench.ended(link.read_status).result().storage.total_mib == 1000.0
    assert len(bench.ended(link.list_streams).result()) == 2
    bench.ended(link.shoot).result()
    bench.camera.reports = False
    assert bench.ended(link.shoot).result().number == 1


def test_the_charge_of_its_battery_is_reported_where_it_says_it() -> None:
    bench = Bench()
    link = bench.found()

    def say(battery_id: int, percent: int) -> float | None:
        cells = [0xFFFF] * 10
        said = mavlink.MAVLink_battery_status_message(battery_id, 0, 0, 0, cells, -1, -1, -1, percent)
        bench.cameras.on_component(MessageSource(7, mavlink.MAV_COMP_ID_CAMERA), received(said), bench.now_s, 1.9e9)
        return link.status().battery_percent

    assert link.status().battery_percent is None
    assert say(1, 80) == 80.0
    assert say(0, 55) == 55.0
    assert say(1, 79) == 55.0  # another one
    assert say(0, -1) is None


def test_what_a_camera_does_not_have_is_left_out_of_its_status() -> None:
    bench = Bench()
    link = bench.found()
    bench.camera.lacks = {mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION, mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS}
    status = bench.ended(link.read_status).result()
    assert (status.mode, status.storage.state) == (None, None)
    bench.camera.lacks = {mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS}
    with pytest.raises(RejectedByAutopilotError, match="UNSUPPORTED"):
        bench.ended(link.read_status).result()
    bench.camera.lacks = {mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION}
    with pytest.raises(RejectedByAutopilotError, match="UNSUPPORTED"):
        bench.ended(link.list_streams).result()


def test_streams_are_listed_also_where_messages_are_lost() -> None:
    for seed in range(10):
        bench = Bench(loss=0.3, seed=seed)
        link = bench.found()
        assert bench.ended(link.list_streams).result() == [
            VideoStream("stream 1", "rtsp://10.0.0.2:8554/live", "H264", 1280, 720, 30.0, True),
            VideoStream("stream 2", "udp://:5600", "H264", 1280, 720, 30.0, True),
        ]


def test_by_distance_each_is_ordered_at_its_position_and_one_that_fails_is_counted() -> None:
    bench = Bench()
    link = bench.found()
    link.start_distance(2.0)
    for i in range(200):
        bench.place = Pose.at(0.1 * i, 0.0, 10.0)
        bench.step()
    bench.run(1.0)
    places = [each.viewpoint.body.position.x for each in link.photos.since(0) if each.viewpoint.body is not None]
    assert [round(each / 2.0) for each in places] == list(range(10))
    assert all(-0.01 < each - 2.0 * i < 0.45 for i, each in enumerate(places))  # two steps there and back
    assert link.status().missed_count == 0
    bench.camera.result = DENIED
    bench.place = Pose.at(22.0, 0.0, 10.0)
    bench.run(0.5)
    assert link.status().missed_count == 2  # one was passed by, and one refused
    bench.camera.ignored = {START}
    bench.place = Pose.at(24.0, 0.0, 10.0)
    orders_count = len([each for each in bench.sent if each.command == START])
    bench.run(5.0)
    sent = [each for each in bench.sent if each.command == START][orders_count:]
    assert len(sent) == camera_link.SHOT_TRIES_COUNT
    assert len({each.param4 for each in sent}) == 1
    assert link.status().missed_count == 3
    assert link.stop_distance()
    assert not link.stop_distance()
    bench.place = Pose.at(50.0, 0.0, 10.0)
    bench.run(1.0)
    assert link.status().missed_count == 3


@pytest.mark.parametrize("how", ["accepted", "refused", "unanswered"])
def test_pictures_by_time_replace_those_by_distance_once_they_may_be_taken(how: str) -> None:
    bench = Bench()
    link = bench.found()
    link.start_distance(50.0)
    bench.run(1.0)
    bench.camera.result = DENIED if how == "refused" else bench.camera.result
    bench.camera.ignored = {START} if how == "unanswered" else set()
    ended = bench.ended(partial(link.start_interval, 2.0, 3))
    assert (ended.exception() is None) is (how == "accepted")
    assert link.status().distance_m == (50.0 if how == "refused" else None)


def test_only_so_many_orders_wait() -> None:
    bench = Bench()
    link = bench.found()
    futures: list[Future[None]] = [Future() for _ in range(camera_link.MOST_WAITING_EXCHANGES + 1)]
    for each in futures:
        link.order(VIDEO, (), each)
    assert isinstance(futures[-1].exception(0), ResourceExhaustedError)
    futures[0].cancel()
    bench.until(lambda: all(each.done() for each in futures))
    assert len(bench.camera.orders) == camera_link.MOST_WAITING_EXCHANGES - 1


def test_another_vehicle_has_other_cameras() -> None:
    bench = Bench()
    link = bench.found()
    waiting: Future[None] = Future()
    link.order(VIDEO, (), waiting)
    bench.cameras.attach(MessageSource(8, 1), Px4())
    with pytest.raises(LinkLostError, match="another autopilot was found"):
        waiting.result(0)
    heartbeat = received(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 0, 3))
    bench.cameras.on_component(MessageSource(8, 100), heartbeat, bench.now_s, 1.9e9)
    assert [each.number for each in bench.cameras.found] == [0]  # one message finds none
    bench.cameras.on_component(MessageSource(8, 100), heartbeat, bench.now_s + 1.0, 1.9e9)
    assert [each.number for each in bench.cameras.found] == [0, 1]


def test_reports_are_counted_once_and_those_that_are_missing_are_requested() -> None:
    requested: list[int] = []
    photos = ReportedPhotos(lambda index, _: requested.append(index))
    assert photos.is_new(5, 1000, 0.0)
    assert not photos.is_new(5, 1000, 0.1)
    assert photos.is_new(8, 2000, 0.2)
    photos.tick(0.3)
    assert requested == [6, 7]
    assert photos.is_new(6, 1500, 0.4)
    assert not photos.is_new(6, 1500, 0.4)
    for i in range(20):
        photos.tick(1.0 + i)
    assert requested == [6, 7] + [7] * (TRIES_COUNT - 1)
    assert photos.lost_count == 1
    assert photos.is_new(5, 500, 30.0)  # it has booted: its numbers begin again
    assert not photos.is_new(5, 500, 30.0)
    photos.on_count(8, 31.0)
    photos.tick(31.0)
    assert requested[-2:] == [6, 7]


def test_a_picture_of_a_camera_without_a_time_since_boot_is_known_by_its_own_time() -> None:
    """After the camera had booted, its new pictures were hidden by those of the same numbers."""
    bench = Bench()
    link = bench.found()
    bench.camera.has_boot_time = False
    for _ in range(2):  # before a boot, and after it
        bench.camera.taken_ms.clear()
        bench.camera.take()
        bench.run(0.5)
        bench.camera.report(0)  # doubled on its way
        bench.run(0.5)
    assert link.photos.count == 2


def test_a_camera_without_times_that_has_booted_is_known_by_its_count() -> None:
    """Its new pictures were taken for those from before, until they were more."""
    photos = ReportedPhotos(lambda *_: None)
    for index in range(4):
        assert photos.is_new(index, 0, 0.0)
    photos.on_count(4, 1.0)
    assert not photos.is_new(3, 0, 1.1)  # doubled on its way
    photos.on_count(0, 2.0)
    assert photos.is_new(0, 0, 2.1)
    assert not photos.is_new(0, 0, 2.2)
    photos.on_count(1, 3.0)
    assert not photos.is_new(0, 0, 3.1)


def test_a_jump_of_the_numbers_is_no_lost_picture_and_many_are_requested_in_part() -> None:
    requested: list[int] = []
    photos = ReportedPhotos(lambda index, _: requested.append(index))
    photos.is_new(-3, 1, 0.0)
    photos.is_new(0, 1, 0.0)
    photos.is_new(2_000_000_000, 2, 0.0)
    photos.on_count(-5, 0.0)
    photos.on_count(2_147_483_647, 0.0)
    photos.tick(0.0)
    assert requested == []
    photos.is_new(2_000_000_000 + 201, 3, 0.0)
    photos.tick(0.0)
    assert len(requested) == MOST_MISSING_REPORTS
    assert photos.lost_count == 200 - MOST_MISSING_REPORTS


def test_no_content_of_a_cameras_message_is_too_strange() -> None:
    """Whatever a camera puts into its messages, with a right checksum: what is told of it can be sent on."""
    noise = random.Random(5)
    harness = Harness()
    harness.receive(heartbeat())
    camera = mavlink.MAVLink(None, srcSystem=harness.session.system_id, srcComponent=100)
    for _ in range(2):
        harness.receive(data=mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 0, 3).pack(camera))
    [link] = harness.discovery.protocols.cameras.found
    for _ in range(200):
        for message_id in sorted(MESSAGE_IDS):
            kind = mavlink.mavlink_map[message_id]
            size = kind.unpacker.size
            payload = noise.choice((noise.randbytes(size), b"\xff" * size, b"\0", noise.randbytes(size // 2 + 1)))
            body = bytes((len(payload), 0, 0, 0, harness.session.system_id, 100, *message_id.to_bytes(3, "little")))
            crc = mavlink.x25crc(body + payload + bytes((kind.crc_extra,))).crc
            harness.now_s += 0.01
            harness.receive(data=b"\xfd" + body + payload + int(crc).to_bytes(2, "little"))
            harness.discovery.tick(harness.now_s)
        convert.camera_info_to_proto(link.info(harness.now_s))
        convert.camera_status_to_proto(link.status())
    assert harness.discovery.receiver.corrupt_count == 0
    for each in link.photos.since(0):
        place = each.viewpoint.position_geo
        message = convert.photo_to_proto(Photo(each.number, each.stamp_s, each.is_stored, None, None, place))
        assert message.stamp.ToJsonString()
        assert place is None or abs(place.latitude_deg) <= 90.0


def test_a_signed_vehicles_camera_must_sign_too() -> None:
    signer = Signer(b"k" * 32, lambda: 1.42e9 + 5e8)
    harness = Harness(signer=signer)

    def signed(system_id: int, component_id: int, kind: int, autopilot: int, after_s: float = 0.0) -> bytes:
        codec = AutopilotCodec(component_id, Signer(b"k" * 32, lambda: 1.42e9 + 5e8 + after_s))
        codec.join(system_id)
        return codec.encode(mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 0, 3))

    harness.receive(data=signed(1, 1, mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4))
    unsigned = mavlink.MAVLink(None, srcSystem=1, srcComponent=100)
    camera = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 0, 3)
    for _ in range(2):
        harness.receive(data=camera.pack(unsigned))
    assert harness.discovery.protocols.cameras.found == ()
    for after_s in (0.0, 1.0):
        harness.receive(data=signed(1, 100, mavlink.MAV_TYPE_CAMERA, 8, after_s))
    assert len(harness.discovery.protocols.cameras.found) == 1


def test_one_message_finds_no_camera_and_changes_none() -> None:
    bench = Bench()
    link = bench.found()
    info = link.info(bench.now_s)
    stray = received(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 0, 3))
    bench.cameras.on_component(STRAY, stray, bench.now_s, 1.9e9)
    nobody = mavlink.MAVLink_camera_information_message(
        1, list(b"x".ljust(32, b"\0")), list(b"y".ljust(32, b"\0")), 1, 1.0, 1.0, 1.0, 1, 1, 0, 0, 0, b""
    )
    link.on_message(received(nobody), bench.now_s, 1.9e9)
    assert link.info(bench.now_s) == info
    bench.run(5.0)  # it is asked again, and says what it is
    assert link.info(bench.now_s) == info
    assert bench.cameras.found == (link,)


def test_a_camera_that_becomes_another_one_is_reported_on_the_ground() -> None:
    bench = Bench()
    link = bench.found()
    bench.may_be_flying = True
    name, bench.camera.vendor = link.info(bench.now_s).name, b"Other"
    bench.camera.answer(mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION)
    bench.run(5.0)
    assert link.info(bench.now_s).name == name
    bench.may_be_flying = False
    bench.run(2.0)
    assert "Other" in link.info(bench.now_s).name
