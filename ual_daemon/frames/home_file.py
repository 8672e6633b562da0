"""The file in which a daemon keeps home, so that it survives a restart of the daemon."""

from __future__ import annotations

import json
import logging
import math
import threading
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ual.discovery import HOME
from ual.types import GeoPoint
from ual_daemon import logs
from ual_daemon.frames.kept_file import UNUSABLE, KeptFile

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class SavedHome:
    """Saved position of a vehicle's frames on Earth.

    Attributes:
        vehicle: Which vehicle it is; see `ual_daemon.backends.values.VehicleInfo.identity`.
        home: The origin of ``<ns>/odom``; None if it was set, but nothing ties it to Earth.
        start: Where the origin of the local frame was at first: a fence in ``map`` stays there.
        saved_s: When it was saved, UTC since 1970.
    """

    vehicle: str
    home: GeoPoint | None
    start: GeoPoint | None
    saved_s: float

    @property
    def age_s(self) -> float:
        """Age in s of the saved home; negative if the computer's clock was set back."""
        return time.time() - self.saved_s


class HomeFile:
    """A small file of JSON, replaced as a whole. What cannot be read is logged, and ignored. Any thread may
    call.
    """

    def __init__(self, path: Path) -> None:
        self.kept = KeptFile(path, HOME)
        self._lock = threading.Lock()
        self._written: SavedHome | None = None
        self._number = 0

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self.kept.path

    def read(self) -> SavedHome | None:
        """Returns what was saved; None if there is nothing, or nothing that can be used."""
        try:
            return _parse(self.kept.read())
        except FileNotFoundError:
            return None
        except UNUSABLE as error:
            logs.event(_log, logging.WARNING, "home_file_ignored", file=str(self.path), why=_why(error))
            return None

    def write(self, vehicle: str, home: GeoPoint | None, start: GeoPoint | None, number: int) -> None:
        """Saves where the frames are. Nothing happens if that was saved already, or something newer.

        The `number` of what is newer is higher: calls may come from several threads, in any order.
        """
        saved = SavedHome(vehicle, home, start, time.time())
        with self._lock:
            if number < self._number:
                return
            self._number, last = number, self._written
            is_same = last is not None and (last.vehicle, last.home, last.start) == (vehicle, home, start)
            if is_same and self.kept.is_there:
                return
            self._written = saved
            self.kept.write(json.dumps(asdict(saved)) + "\n")


def _why(error: Exception) -> str:
    return error.strerror or str(error) if isinstance(error, OSError) else f"it is damaged ({error!r})"


def _parse(text: bytes) -> SavedHome:
    values = json.loads(text)
    saved_s = float(values["saved_s"])
    if math.isnan(saved_s):  # which is of no age
        raise ValueError("saved_s is no number")
    return SavedHome(str(values["vehicle"]), _point(values["home"]), _point(values["start"]), saved_s)


def _point(values: Mapping[str, Any] | None) -> GeoPoint | None:
    if values is None:
        return None
    point = [float(values[name]) for name in ("latitude_deg", "longitude_deg", "altitude_amsl_m")]
    limits = (90.0, 180.0, 1e5)
    if not all(abs(value) <= limit for value, limit in zip(point, limits, strict=True)):  # nor NaN
        raise ValueError(f"{point} is not on Earth")
    return GeoPoint(*point)
