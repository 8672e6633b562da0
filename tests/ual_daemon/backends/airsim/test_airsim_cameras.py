"""The cameras of a small AirSim: pictures, where they were taken, and what goes wrong with them."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from concurrent.futures import Future
from typing import Any

import msgspec
import numpy as np
import pytest

from tests.simulators.airsim import Vehicle
from tests.simulators.airsim_server import AirsimServer
from tests.waiting import LIMIT_S, until
from ual.cameras import ImageFormat, ImageKind
from ual.errors import InvalidArgumentError, LinkLostError, RejectedByAutopilotError, UalTimeoutError
from ual.geometry import Pose, Quaternion, Vector3
from ual_daemon import UAL
from ual_daemon.backends.airsim import cameras
from ual_daemon.backends.airsim.camera_settings import OF_EACH_MULTIROTOR, Capture, NamedCamera, cameras_of
from ual_daemon.backends.airsim.cameras import AirsimCamera, AirsimCameras
from ual_daemon.backends.airsim.fetching import Fetched
from ual_daemon.backends.airsim.pictures import AirsimPicture, CameraProjection, CameraState, data_of, intrinsics_of
from ual_daemon.backends.airsim.state import Rotation, Vector
from ual_daemon.backends.airsim.trail import LONGEST_POSE_GAP_S, Trail
from ual_daemon.backends.offers.cameras import CameraDrivers

BOTTOM, BACK = OF_EACH_MULTIROTOR.index("bottom_center"), OF_EACH_MULTIROTOR.index("back_center")


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle("Drone1")


@pytest.fixture
def server(vehicle: Vehicle) -> Iterator[AirsimServer]:
    with AirsimServer([vehicle]) as server:
        server.cameras.settings = {
            "CameraDefaults": {
                "CaptureSettings": [{"Width": 64, "Height": 48}, {"ImageType": 1, "Width": 32, "Height": 24}]
            },
            "Vehicles": {"Drone1": {"Cameras": {"mine": {"X": 0.1, "Y": 0.0, "Z": 0.0}}}},
        }
        yield server


@pytest.fixture
def uav(server: AirsimServer) -> Iterator[UAL]:
    with UAL("airsim", "uav_1", url=server.url, backend_settings={"rate_hz": 25.0}) as uav:
        until(uav.is_ready, "its readiness")
        yield uav


def offer_of(uav: UAL) -> AirsimCameras:
    found = uav.vehicle.offer(CameraDrivers)  # type: ignore[type-abstract]
    assert isinstance(found, AirsimCameras)
    return found


def hang(vehicle: Vehicle, north_m: float, east_m: float, up_m: float, yaw_rad: float) -> None:
    """Puts the vehicle into the air, where it stays: its controller holds it."""
    vehicle.current_position((north_m, east_m, -up_m), yaw_rad)


def test_all_cameras_are_listed_by_their_names(uav: UAL) -> None:
    listed = uav.cameras.get_all()
    assert [each.name for each in listed] == [*OF_EACH_MULTIROTOR, "mine"]
    assert all(each.is_connected and each.image_kinds == frozenset(ImageKind) for each in listed)
    assert {(each.width_px, each.height_px) for each in listed} == {(64, 48)}


def test_a_picture_has_the_pose_of_the_body_and_of_the_camera(uav: UAL, vehicle: Vehicle) -> None:
    uav.take_off(3.0)
    image = uav.cameras[BACK].image()
    assert image.data.startswith(b"\x89PNG")
    assert (image.width_px, image.height_px, image.kind) == (64, 48, ImageKind.COLOUR)
    north, east, down = vehicle.body.position
    assert image.body is not None
    assert image.camera is not None
    assert image.body.frame_id == "uav_1/odom"
    assert (image.body.pose.position - Vector3(east, north, -down)).norm() < 0.3
    behind = image.body.pose.orientation.rotate(Vector3(-0.5))
    assert (image.camera.pose.position - image.body.pose.position - behind).norm() < 0.05
    view = image.camera.pose.orientation.rotate(Vector3(1.0))
    assert (view - Vector3(0.0, -1.0)).norm() < 0.05  # it looks south, as the nose points north
    assert image.stamp_s == pytest.approx(uav.telemetry().stamp_s, abs=60.0)  # of the simulator's clock
    assert image.intrinsics is not None
    assert image.intrinsics.focal_length_x_px == pytest.approx(32.0)
    assert (image.intrinsics.centre_x_px, image.intrinsics.centre_y_px) == (31.5, 23.5)
    assert uav.cameras.get_all()[BACK].intrinsics == image.intrinsics


def test_distances_are_metres_and_the_sky_is_infinitely_far(uav: UAL) -> None:
    uav.take_off(3.0)
    depth = uav.cameras[BOTTOM].image(kind=ImageKind.DEPTH)
    assert (depth.format, depth.width_px, depth.height_px) == (ImageFormat.FLOAT32, 32, 24)
    numbers = np.frombuffer(depth.data, "<f4").reshape(24, 32)
    assert depth.camera is not None
    assert numbers[12, 16] == pytest.approx(depth.camera.pose.position.z, abs=0.15)
    far = np.frombuffer(uav.cameras[0].image(kind=ImageKind.RANGE).data, "<f4")
    assert np.isposinf(far[0])
    assert np.isfinite(far[-1])


def test_a_picture_that_was_taken_is_kept(uav: UAL, monkeypatch: pytest.MonkeyPatch) -> None:
    camera = uav.cameras[BOTTOM]
    taken = camera.take_photo()
    assert camera.photos() == [taken]
    kept = camera.image(taken.number)
    assert (kept.stamp_s, kept.body) == (taken.stamp_s, taken.body)
    assert taken.position_geo is not None
    with pytest.raises(InvalidArgumentError, match="kept as colours"):
        camera.image(taken.number, ImageKind.DEPTH)
    with pytest.raises(InvalidArgumentError, match="there is no picture 1"):
        camera.image(1)
    monkeypatch.setattr(cameras, "MOST_KEPT_BYTES", len(kept.data))
    camera.take_photo()
    with pytest.raises(InvalidArgumentError, match="the bytes of picture 0 are kept no more"):
        camera.image(0)
    assert [each.number for each in camera.photos()] == [0, 1]


def test_pictures_by_distance_are_taken_where_they_are_due(uav: UAL) -> None:
    uav.take_off(2.0)
    camera = uav.cameras[BOTTOM]
    camera.start_photos(distance_m=1.0)
    assert camera.status().distance_m == 1.0
    until(camera.photos, "the first one, at once")
    uav.go_to_waypoint(Pose.at(0.0, 4.5, 2.0))
    camera.stop_photos()
    assert not camera.status().is_taking_photos
    places = [each.body.pose.position for each in camera.photos() if each.body is not None]
    status = camera.status()
    assert status.photos_count + status.missed_count >= 5
    assert len(places) == status.photos_count >= 1
    assert places[0].norm() < 2.5


# --- What goes wrong --------------------------------------------------------------------------------------------------


def test_a_simulator_that_renders_nothing_is_queried_once_and_goes_on_flying(uav: UAL, server: AirsimServer) -> None:
    """Each request would hold one of its threads for ever, and without one it takes no setpoint."""
    server.cameras.renders = False
    offer_of(uav)._fetcher.patience_s = 0.05
    with pytest.raises(UalTimeoutError, match="has not rendered a picture within"):
        uav.cameras[0].image()
    for _ in range(5):
        with pytest.raises(UalTimeoutError, match=r"still renders a picture requested .* s ago"):
            uav.cameras[1].take_photo()
    assert server.pending_count == 1
    assert len(server._unrendered) == 1
    uav.take_off(2.0)
    server.render()
    offer_of(uav)._fetcher.patience_s = LIMIT_S
    until(lambda: answers(uav), "a picture, once the late one has come")
    assert len(uav.cameras[0].photos()) == 0  # the late one is nobody's


def answers(uav: UAL) -> bool:
    try:
        uav.cameras[0].image()
    except (UalTimeoutError, LinkLostError):
        return False
    return True


@pytest.mark.parametrize(
    ("name", "text"),
    [("refusal", "not offered without Unreal"), ("message", "Can't take screenshot because texture target is null")],
)
def test_why_there_is_no_picture_is_reported_in_the_simulators_words(
    uav: UAL, server: AirsimServer, name: str, text: str
) -> None:
    setattr(server.cameras, name, text)
    for order in (uav.cameras[0].image, uav.cameras[0].take_photo):
        with pytest.raises(RejectedByAutopilotError, match=f"the simulator made no picture: {text}") as refused:
            order()
        assert refused.value.metadata["text"] == text


def test_a_camera_that_is_not_there_is_refused_and_the_simulator_lives(uav: UAL, server: AirsimServer) -> None:
    """``simGetCameraInfo`` of a camera that is not there ends AirSim: it follows a null pointer."""
    del server.cameras.settings["Vehicles"]  # type: ignore[attr-defined]  # another program has removed it
    with pytest.raises(RejectedByAutopilotError, match="map::at"):
        uav.cameras[len(OF_EACH_MULTIROTOR)].image()
    assert not server._is_closing
    assert uav.cameras[0].image().width_px == 64


def test_microsofts_simulator_takes_another_argument(uav: UAL, server: AirsimServer) -> None:
    server.cameras.is_of_microsoft = True
    assert uav.cameras[0].image().intrinsics is not None
    assert uav.cameras[BOTTOM].image(kind=ImageKind.SEGMENTATION).width_px == 256


def test_a_connection_that_is_lost_is_reported_and_made_anew(uav: UAL, server: AirsimServer) -> None:
    uav.cameras[0].image()
    server.cameras.renders = False
    fetching = offer_of(uav)._fetcher.fetch("front_center", ImageKind.COLOUR)
    until(lambda: server._unrendered, "the request")
    server.drop_connections()
    with pytest.raises(LinkLostError, match="the simulator sent no picture"):
        fetching.result(LIMIT_S)
    server.render()
    until(lambda: answers(uav), "a picture by another connection")


def test_without_a_simulator_nothing_is_waited_for(vehicle: Vehicle) -> None:
    with AirsimServer([vehicle]) as server, UAL("airsim", url=server.url, backend_settings={"rate_hz": 25.0}) as uav:
        until(uav.is_ready, "its readiness")
        uav.cameras[0].start_photos(interval_s=0.5)
        server.close()
        until(lambda: not uav.cameras.get_all()[0].is_connected, "that it is gone")
        for order in (uav.cameras[0].image, uav.cameras[0].take_photo, uav.cameras[0].status):
            with pytest.raises(LinkLostError, match="camera 0 is not heard"):
                order()
        uav.cameras[0].stop_photos()


def test_closing_ends_a_picture_that_is_waited_for(server: AirsimServer) -> None:
    with UAL("airsim", url=server.url, backend_settings={"rate_hz": 25.0}) as uav:
        until(uav.is_ready, "its readiness")
        server.cameras.renders = False
        waiting = offer_of(uav)._fetcher.fetch("front_center", ImageKind.COLOUR)
        until(lambda: server._unrendered, "the request")
    with pytest.raises(LinkLostError):
        waiting.result(LIMIT_S)


# --- Parts ------------------------------------------------------------------------------------------------------------


def picture(**values: Any) -> AirsimPicture:
    known: dict[str, Any] = {
        "image_data_uint8": b"",
        "image_data_float": msgspec.Raw(b"\x90"),
        "camera_position": Vector(),
        "camera_orientation": Rotation(1.0, 0.0, 0.0, 0.0),
        "time_stamp": 0,
        "message": "",
        "width": 2,
        "height": 1,
    }
    return AirsimPicture(**{**known, **values})


def test_the_cameras_pose_is_east_north_up_along_its_view() -> None:
    found = picture(camera_position=Vector(1.0, 2.0, -3.0)).camera
    assert found.position == Vector3(2.0, 1.0, 3.0)
    assert (found.orientation.rotate(Vector3(1.0)) - Vector3(0.0, 1.0)).norm() < 1e-9
    assert (found.orientation.rotate(Vector3(0.0, 1.0)) - Vector3(-1.0)).norm() < 1e-9


@pytest.mark.parametrize("head", [b"\x92", b"\xdc\0\2", b"\xdd\0\0\0\2"])
@pytest.mark.parametrize("code", ["f", "d"])
def test_distances_of_each_encoding(head: bytes, code: str) -> None:
    kind = {"f": b"\xca", "d": b"\xcb"}[code]
    for wanted in ((1.5, math.nan), (0.0, 65504.0)):
        raw = head + b"".join(kind + struct.pack(f">{code}", each) for each in wanted)
        data, _ = data_of(picture(image_data_float=msgspec.Raw(raw)), ImageKind.DEPTH)
        read = struct.unpack("<2f", data)
        assert read[0] == wanted[0]
        assert math.isnan(read[1]) if math.isnan(wanted[1]) else read[1] == math.inf


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ({"width": 0}, ImageKind.COLOUR),
        ({"message": "no"}, ImageKind.COLOUR),
        ({"image_data_uint8": [0]}, ImageKind.COLOUR),
        ({"image_data_uint8": b"JFIF"}, ImageKind.SEGMENTATION),
        ({}, ImageKind.DEPTH),
    ],
)
def test_what_is_no_picture_is_not_taken_for_one(values: dict[str, Any], kind: ImageKind) -> None:
    with pytest.raises(Exception, match=r"empty|no PNG|^no$|0 distances"):
        data_of(picture(**values), kind)


def test_settings_name_the_cameras_and_their_sizes() -> None:
    settings = {
        "CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 640, "Height": 480, "FOV_Degrees": 90}]},
        "Vehicles": {
            "Drone1": {"Cameras": {"front_center": {"CaptureSettings": [{"ImageType": 0, "Width": 320}]}, "top": {}}},
            "Drone2": {},
        },
    }
    first = cameras_of(json.dumps(settings), "Drone1")
    assert [each.name for each in first] == [*OF_EACH_MULTIROTOR, "top"]
    assert first[0].capture(ImageKind.COLOUR) == Capture(0, 320)
    assert first[-1].capture(ImageKind.COLOUR) == Capture(0, 640, 480, 90.0)
    assert first[-1].capture(ImageKind.DEPTH) == Capture(1)
    assert [each.name for each in cameras_of(json.dumps(settings), "Drone2")] == list(OF_EACH_MULTIROTOR)
    for odd in ("", "[]", "no JSON", '{"Vehicles": 5}'):
        assert [each.name for each in cameras_of(odd, "Drone1")] == list(OF_EACH_MULTIROTOR)


def test_the_view_is_that_of_the_longer_side() -> None:
    plain = NamedCamera("plain")
    wide = intrinsics_of(plain, ImageKind.COLOUR, 200, 100, 0.5)
    tall = intrinsics_of(plain, ImageKind.DEPTH, 100, 200, 0.5)
    assert wide is not None
    assert tall is not None
    assert wide.focal_length_x_px == wide.focal_length_y_px == tall.focal_length_x_px == 200.0
    assert (wide.centre_x_px, wide.centre_y_px) == (99.5, 49.5)
    assert intrinsics_of(plain, ImageKind.COLOUR, 200, 100, None) is None


def test_a_kind_with_a_view_of_its_own_has_that_while_nothing_has_changed_it() -> None:
    captures = Capture(0, view_deg=90.0), Capture(1, view_deg=60.0), Capture(2, projection="Orthographic")
    camera = NamedCamera("two", captures)
    own = intrinsics_of(camera, ImageKind.DEPTH, 200, 100, 1.0)
    assert own is not None
    assert own.focal_length_x_px == pytest.approx(100.0 / math.tan(math.radians(30.0)))
    assert intrinsics_of(camera, ImageKind.DEPTH, 200, 100, 0.7) is None
    assert intrinsics_of(camera, ImageKind.RANGE, 200, 100, 1.0) is None


@pytest.mark.parametrize(
    ("matrix", "tangent"),
    [
        ([[0.0, 2.0, 0.0, 0.0], [0.0, 0.0, -4.0, 0.0]], 0.5),
        ([[0.0, 4.0, 0.0, 0.0], [0.0, 0.0, -2.0, 0.0]], 0.5),
        ([[math.nan] * 4] * 4, None),
        ([[0.0] * 4] * 4, None),
        ([], None),
    ],
)
def test_the_view_by_the_matrix(matrix: list[list[float]], tangent: float | None) -> None:
    assert CameraState(CameraProjection(matrix)).tangent == tangent


def test_where_it_was_is_between_two_reports_and_not_known_in_a_gap() -> None:
    trail = Trail()
    assert trail.at(1.0) is None
    trail.add(1.0, Pose.at(0.0, 0.0, 1.0, 3.0))
    trail.add(1.1, Pose.at(1.0, 0.0, 1.0, -3.0))
    found = trail.at(1.025)
    assert found is not None
    assert found.position.x == pytest.approx(0.25)
    assert math.cos(found.yaw_rad - (3.0 + 0.25 * (2.0 * math.pi - 6.0))) == pytest.approx(1.0, abs=1e-5)
    assert trail.at(0.9) is None
    beyond = trail.at(1.2)  # a picture that is newer than the last report
    assert beyond is not None
    assert beyond.position.x == pytest.approx(2.0)
    assert math.cos(beyond.yaw_rad - (-3.0 + 2.0 * math.pi - 6.0)) == pytest.approx(1.0, abs=1e-3)
    assert trail.at(1.2 + LONGEST_POSE_GAP_S) is None
    trail.add(2.0, Pose.at(2.0, 0.0, 1.0, 0.0))
    assert trail.at(1.5) is None
    assert trail.at(2.0 + LONGEST_POSE_GAP_S / 2.0) == Pose.at(2.0, 0.0, 1.0, 0.0)  # how fast it is, is not known
    trail.add(0.5, Pose.at(9.0, 0.0, 1.0, 0.0))  # another simulator
    assert trail.at(1.0) is None
    assert trail.at(0.5) == Pose.at(9.0, 0.0, 1.0, 0.0)


class Shots:
    """Notes what a camera fetches, and answers nothing."""

    def __init__(self) -> None:
        self.asked: list[Future[Fetched]] = []

    def fetch(self, *_: object) -> Future[Fetched]:
        self.asked.append(Future())
        return self.asked[-1]


def camera_of(shots: Shots) -> AirsimCamera:
    place = cameras.LocalFrameOrigin(0, None)
    return AirsimCamera(0, NamedCamera("front"), shots.fetch, Trail(), lambda: place, lambda: "")


def test_pictures_by_time_are_counted_also_those_for_which_it_is_too_slow() -> None:
    shots = Shots()
    camera = camera_of(shots)
    camera.start_interval(0.5, 4).result(0)
    for time_s in (10.0, 10.2, 10.5, 10.6):
        camera.step(time_s, Pose())
    assert len(shots.asked) == 1
    assert camera.status().result(0).missed_count == 1  # the first is still rendered
    shots.asked[0].set_exception(UalTimeoutError("late"))
    camera.step(11.6, Pose())  # two were due
    status = camera.status().result(0)
    assert len(shots.asked) == 2
    assert (status.missed_count, status.is_taking_photos) == (3, False)
    camera.step(20.0, Pose())
    assert len(shots.asked) == 2


def test_a_simulator_that_is_started_anew_ends_them() -> None:
    shots = Shots()
    camera = camera_of(shots)
    camera.start_distance(1.0).result(0)
    camera.step(1.0, Pose())
    camera.end_boot()
    camera.step(2.0, Pose(Vector3(9.0)))
    assert len(shots.asked) == 1
    assert not camera.status().result(0).is_taking_photos


def test_a_camera_keeps_its_number_and_one_that_is_gone_stays_listed(uav: UAL) -> None:
    offer = offer_of(uav)
    offer.on_connect((NamedCamera("mine"), NamedCamera("other")), has_booted=False)
    listed = [(each.name, each.is_connected) for each in uav.cameras.get_all()]
    assert listed == [*((name, False) for name in OF_EACH_MULTIROTOR), ("mine", True), ("other", True)]
    with pytest.raises(LinkLostError, match="the simulator has it no more"):
        uav.cameras[0].take_photo()


def test_an_orientation_that_is_none_has_no_position() -> None:
    trail = Trail()
    trail.add(0.0, Pose())
    shots = Shots()
    camera = AirsimCamera(
        0, NamedCamera("front"), shots.fetch, trail, lambda: cameras.LocalFrameOrigin(0, None), lambda: ""
    )
    assert (
        camera._viewpoint(cameras.LocalFrameOrigin(0, None), 0.0, Pose(Vector3(), Quaternion(0.0, 0.0, 0.0, 0.0))).body
        is None
    )
