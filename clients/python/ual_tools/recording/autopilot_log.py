"""The track in a log of the autopilot, laid over that of a recording of the same flight.

Needs pyulog for PX4's logs, pymavlink for ArduPilot's, and numpy: the extra ``logs``. They are imported only for this.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ual.errors import InvalidArgumentError

if TYPE_CHECKING:
    import numpy as np

ENDINGS = (".ulg", ".bin")
_COMPARED_STEP_S = 0.1
_LEAST_LIKENESS = 0.6
"""Least likeness of the speeds, from 0 to 1, where the log does not know the time of day."""
_CLOCKS_DIFFER_S = 10.0
"""Seconds by which the clock of a computer may differ from that of the satellites."""
_LEAST_OVERLAP_S, _LEAST_COMPARED_S = 0.2, 5.0
"""For how long the log has to be of the time of the recording, and to be compared with it."""
_DATAFLASH = b"\xa3\x95\x80"
_EARLIEST_UTC_US = 1_500_000_000_000_000


@dataclass(slots=True)
class LogTrack:
    """Positions by the autopilot's log: metres east, north and up of its own origin, m/s.

    `times_s` are since an epoch of its own, or in UTC since 1970 with `is_utc`.
    """

    is_utc: bool = False
    times_s: list[float] = field(default_factory=list)
    xs: list[float] = field(default_factory=list)
    ys: list[float] = field(default_factory=list)
    heights: list[float] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)

    def add(self, time_s: float, north: float, east: float, down: float, speed: float) -> None:
        """Takes a sample."""
        self.times_s.append(time_s)
        self.xs.append(east)
        self.ys.append(north)
        self.heights.append(-down)
        self.speeds.append(speed)


def require() -> None:
    """Imports what reads logs. Raises `ImportError` where the extra is not there."""
    import numpy  # noqa: F401, ICN001
    import pymavlink  # noqa: F401
    import pyulog  # noqa: F401


def read(file: Path) -> LogTrack:
    """Reads the track of a ULog of PX4, or of a dataflash log of ArduPilot.

    Raises:
        InvalidArgumentError: It is no such log, is damaged, or has no positions.

    """
    try:
        track = _of_px4(file) if file.suffix.lower() == ".ulg" else _of_ardupilot(file)
    except InvalidArgumentError:
        raise
    except Exception as error:  # noqa: BLE001  the libraries raise whatever a damaged file leads to
        raise InvalidArgumentError(f"{file} cannot be read: {error}", {"field": "log"}) from None
    if not track.times_s:
        raise InvalidArgumentError(f"{file} has no positions", {"field": "log"})
    return track


def laid_over(track: LogTrack, times_s: Sequence[float], speeds: Sequence[float], begin_s: float) -> LogTrack:
    """Returns the track on the times of a recording, which began at `begin_s` (UTC). Only the time is moved.

    Raises:
        InvalidArgumentError: It is of another time, or does not move as the recording does.

    """
    if not times_s:
        raise InvalidArgumentError("the recording has no positions", {"field": "log"})
    shift_s = _near_utc_s(track, times_s, speeds, begin_s) if track.is_utc else _best_shift_s(track, times_s, speeds)
    moved = LogTrack(True)
    for time_s, x, y, height, speed in zip(track.times_s, track.xs, track.ys, track.heights, track.speeds, strict=True):
        if times_s[0] <= time_s + shift_s <= times_s[-1]:
            moved.add(time_s + shift_s, y, x, -height, speed)
    if not moved.times_s or moved.times_s[-1] - moved.times_s[0] < _LEAST_OVERLAP_S:
        raise InvalidArgumentError("the log is of another time than the recording", {"field": "log"})
    return moved


def placed(
    track: LogTrack, times_s: Sequence[float], positions: Sequence[Sequence[float]]
) -> tuple[LogTrack, list[float]]:
    """Returns the track moved onto places (x, y and z) of a recording, and by how much, in metres.

    The origins of the two differ: the moves are the medians of the differences.
    """
    import numpy as np

    own = (track.xs, track.ys, track.heights)
    offsets = [
        float(np.median(np.interp(track.times_s, times_s, position) - np.asarray(values)))
        for position, values in zip(positions, own, strict=True)
    ]
    x, y, z = offsets
    moved = LogTrack(track.is_utc)
    for time_s, east, north, up, speed in zip(track.times_s, *own, track.speeds, strict=True):
        moved.add(time_s, north + y, east + x, -(up + z), speed)
    return moved, offsets


def _near_utc_s(track: LogTrack, times_s: Sequence[float], speeds: Sequence[float], begin_s: float) -> float:
    """Returns by how much the times differ, by UTC, or better where the speeds are most alike near that."""
    try:
        best_s = _best_shift_s(track, times_s, speeds)
    except InvalidArgumentError:
        return -begin_s
    return best_s if abs(best_s + begin_s) <= _CLOCKS_DIFFER_S else -begin_s


def _best_shift_s(track: LogTrack, times_s: Sequence[float], speeds: Sequence[float]) -> float:
    """Returns by how much the times differ, by where the speeds are most alike."""
    import numpy as np

    def even(times: Sequence[float], values: Sequence[float]) -> np.typing.NDArray[np.float64]:
        grid = np.arange(times[0], times[-1], _COMPARED_STEP_S)
        return np.asarray(np.interp(grid, times, values))

    ours, theirs = even(times_s, speeds), even(track.times_s, track.speeds)
    if min(len(ours), len(theirs)) * _COMPARED_STEP_S < _LEAST_COMPARED_S:
        raise InvalidArgumentError("the log or the recording is too short to be compared", {"field": "log"})
    products = np.correlate(ours, theirs, "full")
    squares = np.correlate(ours**2, np.ones(len(theirs)), "full") * np.correlate(np.ones(len(ours)), theirs**2, "full")
    lengths = np.correlate(np.ones(len(ours)), np.ones(len(theirs)), "full")
    enough = (lengths * _COMPARED_STEP_S >= _LEAST_COMPARED_S) & (squares > 0.0)
    # Of what moves alike for a short time and what does so for long, the longer is meant.
    likeness = np.where(enough, products / np.sqrt(np.where(squares > 0.0, squares, 1.0)), 0.0)
    best = int(np.argmax(likeness * np.sqrt(np.where(enough, products, 0.0).clip(0.0))))
    if likeness[best] < _LEAST_LIKENESS:
        raise InvalidArgumentError(
            "the log does not move as the recording does: is it the same flight?", {"field": "log"}
        )
    return times_s[0] - track.times_s[0] + (best - len(theirs) + 1) * _COMPARED_STEP_S


def _of_px4(file: Path) -> LogTrack:
    from pyulog import ULog

    with file.open("rb") as stream:
        log = ULog(stream, ["vehicle_local_position", "vehicle_gps_position"])
    found = {each.name: each.data for each in log.data_list if each.multi_id == 0}
    local, satellites = found.get("vehicle_local_position"), found.get("vehicle_gps_position")
    to_utc_us = _px4_utc_us(satellites)
    track = LogTrack(to_utc_us is not None)
    if local is not None:
        names = ("timestamp", "x", "y", "z", "vx", "vy", "vz", "xy_valid", "z_valid")
        for time_us, north, east, down, *velocity, has_position, has_height in zip(
            *(local[name] for name in names), strict=True
        ):
            if has_position and has_height:
                time_s = (int(time_us) + (to_utc_us or 0)) * 1e-6
                track.add(time_s, float(north), float(east), float(down), _norm(velocity))
    return track


def _px4_utc_us(satellites: dict[str, Sequence[int]] | None) -> int | None:
    """Returns what has to be added to times since boot; None where it has not known the time of day."""
    if satellites is None:
        return None
    pairs = zip(satellites["timestamp"], satellites["time_utc_usec"], strict=True)
    known = [int(utc_us) - int(time_us) for time_us, utc_us in pairs if int(utc_us) > _EARLIEST_UTC_US]
    return sorted(known)[len(known) // 2] if known else None


def _of_ardupilot(file: Path) -> LogTrack:
    from pymavlink import DFReader

    with file.open("rb") as stream:
        if stream.read(len(_DATAFLASH)) != _DATAFLASH:
            raise InvalidArgumentError(f"{file} cannot be read: it is no dataflash log", {"field": "log"})
    track = LogTrack(True)
    with closing(DFReader.DFReader_binary(str(file))) as reader:
        for message in _messages(reader, "XKF1"):
            if getattr(message, "C", 0) == 0:  # the first estimator
                velocity = (message.VN, message.VE, message.VD)
                track.add(message._timestamp, message.PN, message.PE, message.PD, _norm(velocity))  # noqa: SLF001  pymavlink's only way
    track.is_utc = bool(track.times_s) and track.times_s[0] > _EARLIEST_UTC_US * 1e-6
    return track


def _messages(reader: Any, kind: str) -> Iterator[Any]:  # noqa: ANN401  pymavlink has no types
    while (message := reader.recv_match(type=[kind])) is not None:
        yield message


def _norm(velocity: Sequence[float]) -> float:
    return float(sum(float(each) ** 2 for each in velocity) ** 0.5)
