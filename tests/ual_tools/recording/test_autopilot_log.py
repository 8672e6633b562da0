"""The track in an autopilot's log: read, laid over a recording in time and place, or refused."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest

from tests.ual_tools.recording.autopilot_logs import Sample, write_dataflash, write_ulog
from ual.errors import InvalidArgumentError
from ual_tools.recording.autopilot_log import LogTrack, laid_over, placed, read

BOOT_UTC_S = 1_795_659_430.0
BEGIN_S = BOOT_UTC_S + 20.0
"""Time at which the recording begins."""


def speed(time_s: float) -> float:
    """Of the flight, by the time since boot: two manoeuvres, and standing between them."""
    return sum(height * math.exp(-(((time_s - at) / 3.0) ** 2)) for at, height in ((45.0, 5.0), (62.0, 3.0)))


SAMPLES = [
    Sample(count / 10, count / 100, -count / 50, -2.0 - speed(count / 10), speed(count / 10)) for count in range(900)
]
TIMES_S = [count / 25 for count in range(1500)]
"""Of the recording, which lasts for 60 s."""
SPEEDS = [speed(time_s + 20.0) for time_s in TIMES_S]


@pytest.fixture(params=["ulog", "ulog without time", "dataflash"])
def track(request: pytest.FixtureRequest, tmp_path: Path) -> LogTrack:
    if request.param == "dataflash":
        write_dataflash(tmp_path / "7.BIN", SAMPLES, BOOT_UTC_S)
        return read(tmp_path / "7.BIN")
    write_ulog(tmp_path / "a.ulg", SAMPLES, BOOT_UTC_S if request.param == "ulog" else None)
    return read(tmp_path / "a.ulg")


def test_positions_are_east_north_and_up(track: LogTrack) -> None:
    assert len(track.times_s) == len(SAMPLES)
    assert [track.xs[-1], track.ys[-1]] == pytest.approx([-899 / 50, 899 / 100])
    assert track.heights[450] == pytest.approx(2.0 + speed(45.0))
    assert track.speeds[450] == pytest.approx(speed(45.0), abs=1e-5)


def test_it_is_laid_over_the_recording_in_time(track: LogTrack) -> None:
    moved = laid_over(track, TIMES_S, SPEEDS, BEGIN_S)
    at_most = max(range(len(moved.times_s)), key=moved.speeds.__getitem__)
    assert moved.times_s[at_most] == pytest.approx(25.0, abs=0.15)
    assert moved.times_s[0] >= 0.0
    assert moved.times_s[-1] <= TIMES_S[-1]


def test_clocks_that_differ_by_seconds_are_found_out(tmp_path: Path) -> None:
    write_dataflash(tmp_path / "7.BIN", SAMPLES, BOOT_UTC_S + 2.4)
    moved = laid_over(read(tmp_path / "7.BIN"), TIMES_S, SPEEDS, BEGIN_S)
    at_most = max(range(len(moved.times_s)), key=moved.speeds.__getitem__)
    assert moved.times_s[at_most] == pytest.approx(25.0, abs=0.15)


def test_it_is_moved_onto_the_positions_of_the_recording(track: LogTrack) -> None:
    moved = laid_over(track, TIMES_S, SPEEDS, BEGIN_S)
    xs = [-(time_s + 20.0) / 5 + 7.0 for time_s in TIMES_S]
    ys = [(time_s + 20.0) / 10 - 3.0 for time_s in TIMES_S]
    heights = [each + 100.0 for each in SPEEDS]
    onto, offsets = placed(moved, TIMES_S, (xs, ys, heights))
    assert offsets == pytest.approx([7.0, -3.0, 98.0], abs=0.1)
    assert onto.xs[100] == pytest.approx(moved.xs[100] + offsets[0])
    assert onto.heights[100] == pytest.approx(moved.heights[100] + offsets[2])


def test_the_log_of_another_time_is_refused(tmp_path: Path) -> None:
    write_ulog(tmp_path / "a.ulg", SAMPLES, BOOT_UTC_S + 3600.0)
    with pytest.raises(InvalidArgumentError, match="of another time"):
        laid_over(read(tmp_path / "a.ulg"), TIMES_S, SPEEDS, BEGIN_S)


def test_a_log_that_moves_otherwise_is_refused(tmp_path: Path) -> None:
    noise = random.Random(1)
    others = [each._replace(speed=8.0 * float(noise.random() < 0.05)) for each in SAMPLES]
    write_ulog(tmp_path / "a.ulg", others)
    with pytest.raises(InvalidArgumentError, match="does not move as the recording does"):
        laid_over(read(tmp_path / "a.ulg"), TIMES_S, SPEEDS, BEGIN_S)
    with pytest.raises(InvalidArgumentError, match="too short"):
        laid_over(read(tmp_path / "a.ulg"), TIMES_S[:10], SPEEDS[:10], BEGIN_S)


@pytest.mark.parametrize("name", ["a.ulg", "7.BIN"])
def test_what_is_no_log_is_refused(tmp_path: Path, name: str) -> None:
    for content in (b"", b"no log at all" * 100):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InvalidArgumentError, match=r"cannot be read|has no positions"):
            read(tmp_path / name)
    write_ulog(tmp_path / "empty.ulg", [])
    with pytest.raises(InvalidArgumentError, match="has no positions"):
        read(tmp_path / "empty.ulg")
