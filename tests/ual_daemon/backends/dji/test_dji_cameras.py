"""The cameras of an aircraft behind a simulated psdk_ros2: orders, what is told, and what goes wrong."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.simulators.dji import Psdk
from tests.simulators.dji_cameras import Camera, CameraModule
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk
from tests.ual_daemon.backends.dji.test_dji_flights import fly, ready, wait
from tests.waiting import until
from ual.cameras import CameraAbility, StorageState
from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    UalTimeoutError,
)
from ual.geometry import Pose
from ual_daemon import UAL
from ual_daemon.backends.dji import cameras


@pytest.fixture
def flight() -> Iterator[tuple[UAL, LockstepDji]]:
    with ready() as (uav, backend):
        yield uav, backend


@pytest.fixture
def uav(flight: tuple[UAL, LockstepDji]) -> UAL:
    return flight[0]


@pytest.fixture
def backend(flight: tuple[UAL, LockstepDji]) -> LockstepDji:
    return flight[1]


def module_of(backend: LockstepDji) -> CameraModule:
    [front] = [node for node in backend.bridge.nodes if isinstance(node, Psdk)]
    return front.camera_module


@pytest.fixture
def camera(uav: UAL, backend: LockstepDji) -> Camera:
    """The camera at port 2."""
    found = Camera()
    with backend.lock:
        module_of(backend).cameras[2] = found
    until(uav.cameras.get_all, "the camera")
    return found


@pytest.mark.usefixtures("camera")
def test_a_camera_is_found_at_its_port(uav: UAL) -> None:
    [info] = uav.cameras.get_all()
    assert (info.number, info.name, info.is_connected) == (0, "payload 2", True)
    assert info.abilities == {CameraAbility.PHOTO, CameraAbility.VIDEO, CameraAbility.ZOOM, CameraAbility.FOCUS}
    with pytest.raises(NotSupportedError, match="does not offer streams"):
        uav.cameras[0].streams()


def test_orders_get_to_the_camera(uav: UAL, camera: Camera) -> None:
    found = uav.cameras[0]
    taken = found.take_photo()
    assert (taken.number, camera.photos_count) == (0, 1)
    assert taken.body is not None
    assert taken.position_geo is not None
    assert found.photos() == [taken]
    found.start_photos(interval_s=2.0, count=10)
    assert camera.interval == (10, 2)
    found.start_photos(interval_s=3.0)
    assert camera.interval == (255, 3)
    assert found.status().interval_s == 3.0
    found.stop_photos()
    assert camera.interval is None
    found.start_video()
    assert camera.is_recording
    assert found.status().is_recording
    found.stop_video()
    assert not camera.is_recording
    found.set_zoom(50.0)
    assert camera.zoom_factor == 3.0
    found.set_focus()
    assert camera.focus_mode == cameras.AUTO_FOCUS_ONCE
    status = found.status()
    assert (status.zoom_percent, status.photos_count) == (50.0, 1)
    assert status.storage.state is StorageState.READY
    assert (status.storage.total_mib, status.storage.available_mib) == (64_000.0, 32_000.0)


@pytest.mark.usefixtures("camera")
def test_what_dji_does_not_take_is_refused_and_not_sent(uav: UAL, backend: LockstepDji) -> None:
    found = uav.cameras[0]
    for photos in ({"interval_s": 0.5}, {"interval_s": 2.0, "count": 255}):
        with pytest.raises(InvalidArgumentError, match="DJI takes"):
            found.start_photos(**photos)  # type: ignore[arg-type]
    with pytest.raises(InvalidArgumentError, match="DJI's cameras focus by themselves only"):
        found.set_focus(50.0)
    assert {name for name, _ in module_of(backend).calls} <= {"get_type"}


def test_pictures_by_distance_are_ordered_where_they_are_due(uav: UAL, camera: Camera) -> None:
    fly(uav)
    found = uav.cameras[0]
    found.start_photos(distance_m=2.0)
    assert found.status().distance_m == 2.0
    uav.go_to_waypoint(Pose.at(0.0, 8.5, 3.0))
    found.stop_photos()
    status = found.status()
    assert status.photos_count + status.missed_count == 5
    assert camera.photos_count == status.photos_count >= 3
    assert not status.is_taking_photos


def test_pictures_by_distance_go_on_where_those_by_time_are_refused(uav: UAL, camera: Camera) -> None:
    found = uav.cameras[0]
    found.start_photos(distance_m=50.0)
    camera.refuses = {"shoot_interval_photo"}
    with pytest.raises(RejectedByAutopilotError):
        found.start_photos(interval_s=2.0)
    assert found.status().distance_m == 50.0
    camera.refuses = set()
    found.start_photos(interval_s=2.0)
    assert found.status().distance_m is None


# --- What goes wrong --------------------------------------------------------------------------------------------------


def test_a_camera_that_is_full_says_so_and_one_that_lies_is_noted(uav: UAL, camera: Camera) -> None:
    found = uav.cameras[0]
    camera.free_mib = 0
    assert found.status().storage.state is StorageState.FULL
    camera.free_mib = 70_000
    storage = found.status().storage
    assert (storage.state, storage.available_mib) == (None, None)
    assert "70000 of 64000 MiB are free" in uav.cameras.get_all()[0].note
    camera.free_mib = camera.total_mib = 0
    assert found.status().storage.state is StorageState.NONE
    camera.refuses = {"get_sd_storage_info", "get_optical_zoom"}  # so some of DJI's cameras do
    status = found.status()
    assert (status.storage.state, status.zoom_percent) == (None, None)


def test_a_refusal_says_where_the_reason_is(uav: UAL, camera: Camera) -> None:
    camera.refuses = {"shoot_single_photo"}
    with pytest.raises(RejectedByAutopilotError, match="log of the wrapper's camera node"):
        uav.cameras[0].take_photo()
    assert uav.cameras[0].photos() == []


@pytest.mark.usefixtures("camera")
def test_a_camera_that_does_not_answer_is_not_waited_for(uav: UAL, backend: LockstepDji) -> None:
    with backend.lock:
        backend.bridge.faults.dead_services.add("/psdk_ros2/camera_shoot_single_photo")
    with pytest.raises(UalTimeoutError, match="it is not known whether a picture was taken"):
        uav.cameras[0].take_photo()
    with backend.lock:
        backend.bridge.faults.dead_services.clear()
    assert uav.cameras[0].take_photo().number == 0


def test_one_that_answers_late_is_no_second_picture(uav: UAL, backend: LockstepDji, camera: Camera) -> None:
    with backend.lock:
        backend.bridge.faults.slow_services["/psdk_ros2/camera_shoot_single_photo"] = cameras.CALL_TIMEOUT_S + 1.0
    with pytest.raises(UalTimeoutError):
        uav.cameras[0].take_photo()
    with backend.lock:
        backend.bridge.faults.slow_services.clear()
    wait(backend, 3.0)
    assert uav.cameras[0].photos() == []
    assert uav.cameras[0].take_photo().number == 0
    assert camera.photos_count == 2


@pytest.mark.usefixtures("camera")
def test_a_camera_that_hangs_delays_no_flight(uav: UAL, backend: LockstepDji) -> None:
    with backend.lock:
        backend.bridge.faults.dead_services.add("/psdk_ros2/camera_get_type")
    wait(backend, cameras.KNOWN_CHECK_S)
    fly(uav)  # what waited behind the camera would not be called any more after its own 3 s


def test_a_camera_that_vanishes_is_reported_and_comes_back(uav: UAL, backend: LockstepDji, camera: Camera) -> None:
    with backend.lock:
        module_of(backend).cameras.clear()
    until(lambda: not uav.cameras.get_all()[0].is_connected, "that it is gone")
    for order in (uav.cameras[0].take_photo, uav.cameras[0].status, uav.cameras[0].start_video):
        with pytest.raises(LinkLostError, match="the wrapper sees it no more"):
            order()
    with backend.lock:
        module_of(backend).cameras[2] = camera
    until(lambda: uav.cameras.get_all()[0].is_connected, "that it is back")
    assert len(uav.cameras.get_all()) == 1


def test_the_older_wrapper_has_none() -> None:
    with ready(LockstepOsdk) as (uav, backend):
        wait(backend, 3.0)
        assert uav.cameras.get_all() == []
