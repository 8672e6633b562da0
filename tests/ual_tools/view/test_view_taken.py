"""`ual view`: what is asked of cameras, and when, without a page."""

from __future__ import annotations

from typing import Any

import pytest

from ual.cameras import CameraAbility, CameraInfo, Image, ImageFormat, Photo
from ual.errors import DaemonUnreachableError, LinkLostError, NotSupportedError, UalError, UalTimeoutError
from ual_tools.view.taken import MOST_PLACES, Taken


class Cameras:
    """One camera, which counts what it is asked."""

    def __init__(self) -> None:
        self.taken: list[Photo] = []
        self.asked: list[str] = []
        self.error: UalError | None = None
        self.image_error: UalError | None = None

    def get_all(self) -> list[CameraInfo]:
        self.asked.append("cameras")
        if self.error is not None:
            raise self.error
        return [CameraInfo(0, "made up", frozenset({CameraAbility.IMAGE}))]

    def __getitem__(self, number: int) -> Cameras:
        return self

    def photos(self, first: int) -> list[Photo]:
        return self.taken[first:]

    def image(self, photo: int) -> Image:
        self.asked.append(f"image {photo}")
        if self.image_error is not None:
            raise self.image_error
        return Image(b"", ImageFormat.PNG, 1, 1, 0.0)


def poll_once(taken: Taken, cameras: Cameras, now_s: float, *, wants_image: bool = False) -> None:
    of_uav: Any = cameras
    taken.poll(of_uav, now_s, wants_image=wants_image)


def test_it_is_queried_once_a_second_and_a_picture_comes_once_where_it_is_wanted() -> None:
    taken, cameras = Taken(), Cameras()
    cameras.taken = [Photo(number, 0.0) for number in range(3)]
    poll_once(taken, cameras, 10.0)
    poll_once(taken, cameras, 10.9, wants_image=True)
    assert (len(taken.photos), cameras.asked) == (3, ["cameras"])
    assert taken.newest is not None
    assert (taken.newest.photo.number, taken.newest.image) == (2, None)
    for now_s in (11.0, 12.0):
        poll_once(taken, cameras, now_s, wants_image=True)
    assert cameras.asked == ["cameras", "cameras", "image 2", "cameras"]
    assert taken.newest.image is not None


@pytest.mark.parametrize(
    ("error", "count"), [(DaemonUnreachableError("lost"), 9), (UalTimeoutError("late"), 3), (LinkLostError("gone"), 1)]
)
def test_a_picture_is_requested_again_where_it_may_come_later(error: UalError, count: int) -> None:
    taken, cameras = Taken(), Cameras()
    cameras.taken = [Photo(0, 0.0)]
    cameras.image_error = error
    for second in range(9):
        poll_once(taken, cameras, 10.0 + second, wants_image=True)
    assert cameras.asked.count("image 0") == count


def test_the_pictures_of_a_daemon_that_was_started_anew_are_drawn() -> None:
    taken, cameras = Taken(), Cameras()
    for boot, count in enumerate((3, 2)):
        cameras.taken = [Photo(number, 1000.0 * boot + number) for number in range(count)]
        poll_once(taken, cameras, 10.0 + boot)
    assert [each.stamp_s for each in taken.photos] == [0.0, 1.0, 2.0, 1000.0, 1001.0]


def test_only_the_last_positions_are_kept() -> None:
    taken, cameras = Taken(), Cameras()
    cameras.taken = [Photo(number, 0.0) for number in range(MOST_PLACES + 7)]
    poll_once(taken, cameras, 0.0)
    assert [each.number for each in taken.photos] == list(range(7, MOST_PLACES + 7))


def test_a_uav_without_cameras_is_queried_once_and_one_that_is_silent_again() -> None:
    taken, cameras = Taken(), Cameras()
    cameras.error = LinkLostError("nothing is heard")
    for now_s in (0.0, 1.0):
        poll_once(taken, cameras, now_s)
    cameras.error = NotSupportedError("it has none")
    for now_s in (2.0, 3.0):
        poll_once(taken, cameras, now_s)
    assert cameras.asked == ["cameras"] * 3


class Two(Cameras):
    """Two cameras: the pictures of one cannot be had, as those at a host that the settings do not name."""

    def __init__(self, refusing: int) -> None:
        super().__init__()
        self._refusing = refusing
        self._chosen = 0

    def get_all(self) -> list[CameraInfo]:
        return [CameraInfo(number, "made up", frozenset({CameraAbility.IMAGE})) for number in range(2)]

    def __getitem__(self, number: int) -> Cameras:
        self._chosen = number
        return self

    def image(self, photo: int) -> Image:
        found = super().image(photo)
        if self._chosen == self._refusing:
            raise NotSupportedError("the picture is at another host")
        return found


def test_a_picture_that_cannot_be_had_is_requested_once_and_the_next_photos_are_reported() -> None:
    taken, cameras = Taken(), Two(refusing=1)
    for now_s, count in ((10.0, 1), (20.0, 1), (30.0, 2), (40.0, 2)):
        cameras.taken = [Photo(number, 0.0) for number in range(count)]
        poll_once(taken, cameras, now_s, wants_image=True)
    assert cameras.asked == ["image 0", "image 0", "image 1", "image 1"]  # of each camera
    assert len(taken.photos) == 4


def test_a_camera_that_refuses_keeps_no_other_one_from_being_queried() -> None:
    taken, cameras = Taken(), Two(refusing=0)
    cameras.taken = [Photo(0, 0.0)]
    poll_once(taken, cameras, 10.0, wants_image=True)
    assert taken.newest is not None
    assert (taken.newest.number, taken.newest.image is None) == (1, False)
