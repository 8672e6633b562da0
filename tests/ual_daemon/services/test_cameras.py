"""Allowed requests to cameras, with a backend and a UAV that are made up."""

from __future__ import annotations

import math
from concurrent.futures import Future
from typing import Any, TypeVar

import pytest

from tests.ual_daemon.services.limits import limit
from ual.cameras import (
    OPTICAL,
    CameraAbility,
    CameraInfo,
    CameraMode,
    CameraStatus,
    ImageFormat,
    ImageKind,
    VideoStream,
)
from ual.errors import (
    InvalidArgumentError,
    NotSupportedError,
    PermissionDeniedError,
    UalError,
    UalTimeoutError,
)
from ual.geometry import Pose, PoseStamped, Quaternion, Vector3
from ual.types import State
from ual_daemon.backends.offers.cameras import CameraDriver, CameraDrivers, EncodedImage, TakenPhoto, Viewpoint
from ual_daemon.services._derived import Cameras
from ual_daemon.services.cameras import VehicleCameras

T = TypeVar("T")
ALL = frozenset(CameraAbility)
DOWN = Quaternion.from_euler(0.0, math.pi / 2.0, 0.0)


def ended(result: T) -> Future[T]:
    future: Future[T] = Future()
    future.set_result(result)
    return future


class MadeUp(CameraDriver):
    """Notes what it is ordered, and does it at once."""

    def __init__(self, number: int = 0, abilities: frozenset[CameraAbility] = ALL) -> None:
        self.orders: list[tuple[Any, ...]] = []
        self.taken = TakenPhoto(0, 5.0, Viewpoint(Pose.at(1.0, 2.0, 3.0, math.pi / 2.0), 1, Pose(Vector3(0.5), DOWN)))
        self.shooting: Future[TakenPhoto] = Future()
        self.making: list[Future[EncodedImage]] = []
        self._info = CameraInfo(number, "made up", abilities, image_kinds=frozenset({ImageKind.COLOUR}))

    @property
    def info(self) -> CameraInfo:
        return self._info

    def _order(self, *order: Any) -> Future[None]:
        self.orders.append(order)
        return ended(None)

    def status(self) -> Future[CameraStatus]:
        return ended(CameraStatus())

    def photos(self, first: int) -> list[TakenPhoto]:
        return [self.taken][first:]

    def take_photo(self) -> Future[TakenPhoto]:
        self._order("take")
        return self.shooting

    def start_interval(self, interval_s: float, count: int) -> Future[None]:
        return self._order("interval", interval_s, count)

    def start_distance(self, distance_m: float) -> Future[None]:
        return self._order("distance", distance_m)

    def stop_photos(self) -> Future[None]:
        return self._order("stop")

    def start_video(self) -> Future[None]:
        return self._order("start video")

    def stop_video(self) -> Future[None]:
        return self._order("stop video")

    def set_mode(self, mode: CameraMode) -> Future[None]:
        return self._order("mode", mode)

    def set_zoom(self, percent: float) -> Future[None]:
        return self._order("zoom", percent)

    def set_focus(self, percent: float | None) -> Future[None]:
        return self._order("focus", percent)

    def streams(self) -> Future[list[VideoStream]]:
        return ended([])

    def image(self, photo: int | None, kind: ImageKind = ImageKind.COLOUR) -> Future[EncodedImage]:
        self._order("image", photo)
        self.making.append(Future())
        return self.making[-1]

    def make(self, index: int = -1) -> None:
        """Ends one of the pictures that were asked for."""
        self.making[index].set_result(EncodedImage(b"x", ImageFormat.PNG, 1, 1, 5.0, None, Viewpoint()))


class Offer(CameraDrivers):
    """The cameras of a test."""

    def __init__(self, *cameras: MadeUp) -> None:
        self._cameras = cameras

    def all(self) -> tuple[MadeUp, ...]:
        return self._cameras


class Vehicle:
    """One whose odom is 10 m beside the local frame, while it has booted once."""

    ns, backend_name = "uav_1", "made_up"

    def __init__(self, offer: Offer | None) -> None:
        self._offer = offer
        self.is_watch_only = False
        self.boots_count = 1

    def state(self) -> State:
        return State.LANDED_DISARMED

    def offer(self, kind: type[T]) -> T | None:
        return self._offer if isinstance(self._offer, kind) else None

    def is_armed(self) -> bool | None:
        return True

    def require_lease(self, command: str, lease_id: str) -> None:
        raise AssertionError("no lease is needed")

    def in_odom(self, local: Pose, boots_count: int) -> PoseStamped | None:
        if boots_count != self.boots_count:
            return None
        return PoseStamped(Pose(local.position + Vector3(10.0), local.orientation), "uav_1/odom")


@pytest.fixture
def camera() -> MadeUp:
    return MadeUp()


@pytest.fixture
def vehicle(camera: MadeUp) -> Vehicle:
    return Vehicle(Offer(camera))


def test_orders_get_to_the_camera_as_they_are(vehicle: Vehicle, camera: MadeUp) -> None:
    found = Cameras(vehicle)[0]
    found.start_photos(interval_s=2, count=3)
    found.start_photos(distance_m=5.0)
    found.stop_photos()
    found.start_video()
    found.stop_video()
    found.set_mode(CameraMode.SURVEY)
    found.set_zoom(50)
    found.set_focus()
    found.set_focus(10.0)
    assert camera.orders == [
        ("interval", 2.0, 3),
        ("distance", 5.0),
        ("stop",),
        ("start video",),
        ("stop video",),
        ("mode", CameraMode.SURVEY),
        ("zoom", 50.0),
        ("focus", None),
        ("focus", 10.0),
    ]


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({}, "interval_s"),
        ({"interval_s": 1.0, "distance_m": 1.0}, "interval_s"),
        ({"interval_s": 0.0}, "interval_s"),
        ({"interval_s": math.nan}, "interval_s"),
        ({"interval_s": 1e9}, "interval_s"),
        ({"interval_s": "1"}, "interval_s"),
        ({"interval_s": 1.0, "count": -1}, "count"),
        ({"interval_s": 1.0, "count": 1.5}, "count"),
        ({"distance_m": 0.0}, "distance_m"),
        ({"distance_m": -5.0}, "distance_m"),
        ({"distance_m": math.inf}, "distance_m"),
        ({"distance_m": 5.0, "count": 3}, "count"),
    ],
)
def test_what_cannot_be_meant_is_not_ordered(
    vehicle: Vehicle, camera: MadeUp, values: dict[str, Any], field: str
) -> None:
    with pytest.raises(InvalidArgumentError, match=f"^{field}: "):
        Cameras(vehicle)[0].start_photos(**values)
    assert camera.orders == []


def test_bad_percents_modes_and_numbers_are_refused(vehicle: Vehicle, camera: MadeUp) -> None:
    found, anything = Cameras(vehicle)[0], Cameras(vehicle)
    bad: Any = "survey"
    for order, field in (
        (lambda: found.image(kind=bad), "kind"),
        (lambda: found.set_zoom(101.0), "percent"),
        (lambda: found.set_focus(-1.0), "percent"),
        (lambda: found.set_mode(bad), "mode"),
        (lambda: found.photos(-1), "first"),
        (lambda: found.image(-1), "photo"),
        (lambda: found.image(max_age_s=-1.0), "max_age_s"),
        (lambda: found.image(max_age_s=math.nan), "max_age_s"),
        (anything[-1].status, "camera"),
        (anything[1].status, "camera"),
    ):
        with pytest.raises(InvalidArgumentError, match=f"^{field}: "):
            order()
    assert camera.orders == []


def test_what_a_camera_cannot_do_is_not_supported() -> None:
    camera = MadeUp(abilities=frozenset({CameraAbility.ZOOM}))
    found = Cameras(Vehicle(Offer(camera)))[0]
    for order in (
        found.take_photo,
        found.stop_photos,
        found.start_video,
        found.stop_video,
        found.set_focus,
        found.streams,
        found.image,
        lambda: found.set_mode(CameraMode.PHOTO),
        lambda: found.start_photos(distance_m=1.0),
    ):
        with pytest.raises(NotSupportedError, match=r"it offers: zoom") as refused:
            order()
        assert refused.value.metadata["ability"]
    assert camera.orders == []


def test_a_kind_of_picture_that_a_camera_does_not_give_is_not_supported(vehicle: Vehicle) -> None:
    with pytest.raises(NotSupportedError, match=r"camera 0 \(made up\) gives no depth \(it gives: colour\)") as refused:
        Cameras(vehicle)[0].image(kind=ImageKind.DEPTH)
    assert refused.value.metadata["kind"] == "depth"


def test_a_daemon_that_only_watches_orders_nothing_and_lists_all(vehicle: Vehicle, camera: MadeUp) -> None:
    vehicle.is_watch_only = True
    found = Cameras(vehicle)[0]
    for order in (found.take_photo, found.stop_photos, found.start_video, lambda: found.set_zoom(1.0)):
        with pytest.raises(PermissionDeniedError, match="only watches"):
            order()
    assert camera.orders == []
    assert [each.number for each in found.photos()] == [0]
    assert found.status() == CameraStatus()
    assert [each.number for each in Cameras(vehicle).get_all()] == [0]
    assert len(list(Cameras(vehicle))) == 1


def test_without_an_offer_and_without_a_camera() -> None:
    with pytest.raises(NotSupportedError, match="the backend made_up of uav_1 does not offer them"):
        Cameras(Vehicle(None)).get_all()
    with pytest.raises(InvalidArgumentError, match="there is no camera 0: none was found"):
        Cameras(Vehicle(Offer()))[0].status()


def test_poses_are_in_odom_and_the_camera_is_where_it_is_mounted(vehicle: Vehicle) -> None:
    [photo] = Cameras(vehicle)[0].photos()
    assert photo.body is not None
    assert photo.camera is not None
    assert photo.body.frame_id == "uav_1/odom"
    assert (photo.body.pose.position - Vector3(11.0, 2.0, 3.0)).norm() < 1e-9
    assert (photo.camera.pose.position - Vector3(11.0, 2.5, 3.0)).norm() < 1e-9
    assert (photo.camera.pose.orientation.rotate(Vector3(1.0)) - Vector3(0.0, 0.0, -1.0)).norm() < 1e-9
    vehicle.boots_count = 2
    [photo] = Cameras(vehicle)[0].photos()
    assert (photo.body, photo.camera) == (None, None)


def test_optical_axes_are_those_of_opencv() -> None:
    """z along the view, x right, y down in the picture; the pose's are x along the view, y left, z up."""
    for optical, axis in (
        (Vector3(0.0, 0.0, 1.0), Vector3(1.0)),
        (Vector3(1.0), Vector3(0.0, -1.0)),
        (Vector3(0.0, 1.0), Vector3(0.0, 0.0, -1.0)),
    ):
        assert (OPTICAL.rotate(optical) - axis).norm() < 1e-12


def test_a_picture_that_is_never_reported_is_not_waited_for(
    vehicle: Vehicle, camera: MadeUp, monkeypatch: pytest.MonkeyPatch
) -> None:
    limit(monkeypatch, "TakePhoto", 0.0)
    with pytest.raises(UalTimeoutError, match="TakePhoto did not end within 0 s"):
        Cameras(vehicle)[0].take_photo()
    assert camera.shooting.cancelled()


def test_a_picture_that_is_taken_is_returned(vehicle: Vehicle, camera: MadeUp) -> None:
    future = VehicleCameras(vehicle).take_photo(0)
    camera.shooting.set_result(camera.taken)
    assert (future.result(0).number, future.result(0).stamp_s) == (0, 5.0)


def test_programs_share_a_picture_that_is_new_enough(
    vehicle: Vehicle, camera: MadeUp, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 100.0
    monkeypatch.setattr("ual_daemon.services.cameras.time.monotonic", lambda: now_s)
    found = VehicleCameras(vehicle)
    first, second = (found.image(0, None, max_age_s=0.1) for _ in range(2))
    now_s += 0.05
    third = found.image(0, None, max_age_s=0.1)
    assert camera.orders == [("image", None)]
    assert second.cancel()  # its program has given up: the others wait on
    camera.make()
    assert first.result(0) is third.result(0)
    now_s += 0.1
    fourth = found.image(0, None, max_age_s=0.1)
    assert len(camera.orders) == 2
    camera.make()
    assert fourth.result(0) is not first.result(0)


def test_a_picture_of_which_no_age_is_reported_and_one_by_its_number_is_never_shared(
    vehicle: Vehicle, camera: MadeUp
) -> None:
    found = VehicleCameras(vehicle)
    for photo, max_age_s in ((None, 10.0), (None, 0.0), (None, 0.0), (3, 10.0)):
        found.image(0, photo, max_age_s=max_age_s)
    assert camera.orders == [("image", None)] * 3 + [("image", 3)]


@pytest.mark.parametrize("is_cancelled", [False, True])
def test_a_picture_that_was_not_made_is_ordered_again(vehicle: Vehicle, camera: MadeUp, is_cancelled: bool) -> None:
    found = VehicleCameras(vehicle)
    first = found.image(0, None, max_age_s=10.0)
    if is_cancelled:
        camera.making[0].cancel()
        assert first.cancelled()
    else:
        camera.making[0].set_exception(UalError("it has ended"))
        with pytest.raises(UalError, match="it has ended"):
            first.result(0)
    second = found.image(0, None, max_age_s=10.0)
    camera.make()
    assert second.result(0).data == b"x"
