"""The file that keeps home: what could not be written is written once that is possible again."""

from __future__ import annotations

from pathlib import Path

from ual.types import GeoPoint
from ual_daemon.frames.home_file import HomeFile

HOME = GeoPoint(47.4, 8.5, 500.0)


def test_what_could_not_be_saved_is_saved_the_next_time(tmp_path: Path) -> None:
    directory = tmp_path / "home"
    file = HomeFile(directory / "uav_1.json")
    file.write("vehicle", HOME, None, 1)  # there is no such directory yet
    assert file.read() is None
    directory.mkdir()
    file.write("vehicle", HOME, None, 2)
    saved = file.read()
    assert saved is not None
    assert saved.home == HOME
