"""Home moves, and ``map`` with it: a reader on another thread sees both moved, or neither."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from typing_extensions import override

from tests.ual_daemon.frames.test_local_frame import NO_FIX, at, moved
from tests.ual_daemon.stepped import Stepped, stepped
from tests.waiting import LIMIT_S
from ual.geometry import Quaternion, Vector3
from ual.types import GeoPoint
from ual_daemon.frames.home_file import HomeFile
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import VehicleSettings

ON_EARTH = (47.0, 8.0, 400.0)
WINDOW_S = 0.1
"""Seconds in which a reader can see a partial move."""


class Reader:
    """Reads on a thread of its own, in the moment in which ``map`` is about to follow home."""

    def __init__(self, frames: FrameResolver, read: Callable[[], Vector3], monkeypatch: pytest.MonkeyPatch) -> None:
        self._read, self._follow = read, frames.tree.set_home
        self._seen: list[Vector3] = []
        self._thread = threading.Thread(target=lambda: self._seen.append(self._read()))
        monkeypatch.setattr(frames.tree, "set_home", self._set_home)

    def _set_home(self, place: Vector3, turn: Quaternion) -> None:
        self._thread.start()
        self._thread.join(WINDOW_S)
        self._follow(place, turn)

    def observed(self) -> tuple[float, ...]:
        self._thread.join(LIMIT_S)
        (seen,) = self._seen
        return tuple(seen)


def _pose(uav: Stepped) -> Vector3:
    return uav.pose.position


def _transform_of_sample(uav: Stepped) -> Vector3:
    found = uav.vehicle.telemetry().transform
    assert found is not None
    return found.translation


def _transform(uav: Stepped) -> Vector3:
    return uav.vehicle.transform().translation


@pytest.mark.parametrize("read", [_pose, _transform_of_sample, _transform])
def test_set_home_leaves_what_is_read_in_map_meanwhile(
    read: Callable[[Stepped], Vector3], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sample of that moment was off by as much as home had moved."""
    settings = VehicleSettings(map_origin_geo=ON_EARTH, pose_frame_id="map")
    with stepped(settings, light={"start": [5.0, 2.0, 0.0], "origin_geo": list(ON_EARTH)}) as uav:
        before = read(uav)
        reader = Reader(uav.vehicle._resolver, lambda: read(uav), monkeypatch)
        uav.vehicle.commands.set_home()
        assert reader.observed() == pytest.approx(tuple(before), abs=0.05)


def test_after_a_reboot_map_is_known_with_home(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pose came in odom for a moment, where poses in map are asked for."""
    frames = FrameResolver("uav_1", VehicleSettings(map_origin_geo=ON_EARTH))
    frames.update(at(0.0))
    frames.update(at(1.0, None, 1, NO_FIX))
    known = at(2.0, moved(5.0), 1)
    reader = Reader(frames, lambda: frames.transform("map", "uav_1/base_link", known).translation, monkeypatch)
    frames.update(known)
    assert reader.observed() == pytest.approx((5.0, 0.0, 0.0), abs=0.05)


def test_map_has_followed_before_home_is_written(tmp_path: Path) -> None:
    """All samples were wrong in map for as long as the disk took."""
    here = at(0.1)
    seen: list[tuple[float, ...]] = []

    class Disk(HomeFile):
        @override
        def write(self, vehicle: str, home: GeoPoint | None, start: GeoPoint | None, number: int) -> None:
            seen.append(tuple(frames.transform("map", "uav_1/base_link", here).translation))
            super().write(vehicle, home, start, number)

    settings = VehicleSettings(map_origin_geo=ON_EARTH)
    frames = FrameResolver("uav_1", settings, Disk(tmp_path / "home"), lambda: "PX4 1 ab")
    frames.update(at(0.0))
    frames.set_home(Vector3(10.0, 0.0, 0.0), here, set_z=False)
    assert seen == [pytest.approx((0.0, 0.0, 0.0), abs=0.05)]
