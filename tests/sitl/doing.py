"""Manoeuvres that fly while something befalls the vehicle, and how each ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from tests.sitl.flights import PATIENCE_S, Flight
from ual.errors import UalError
from ual.geometry import Twist, Vector3
from ual.interface import Task
from ual.missions import Item, Waypoint
from ual.types import State

HEIGHT_M = 6.0
NORTH_DEG = 3e-4
"""33 m."""


class Doing:
    """Manoeuvre that flies on a thread of its own, and its end."""

    def __init__(self) -> None:
        self.error: UalError | None = None
        self.ended_s: float | None = None
        self._thread: threading.Thread | None = None

    def begin(self, flown: Callable[[], object]) -> None:
        self._thread = threading.Thread(target=self._run, args=(flown,), name="doing")
        self._thread.start()

    def _run(self, flown: Callable[[], object]) -> None:
        try:
            flown()
        except UalError as error:
            self.error = error
        self.ended_s = time.monotonic()

    def join(self) -> None:
        if self._thread is not None:
            self._thread.join(PATIENCE_S)


def waited(begin: Callable[[], Task]) -> Callable[[], object]:
    """Begins a task at once. Returns what waits for its end."""
    task = begin()
    return lambda: task.wait(PATIENCE_S)


def waypoints(flight: Flight, *north: float) -> list[Waypoint]:
    """Returns waypoints so many times `NORTH_DEG` north of where it is."""
    point = flight.uav.telemetry().position_geo
    assert point is not None
    return [Waypoint(point.latitude_deg + each * NORTH_DEG, point.longitude_deg, HEIGHT_M) for each in north]


def mission_of(flight: Flight, items: list[Item]) -> Callable[[], object]:
    """Uploads a mission, and starts it. Returns what waits for its end."""
    flight.uav.mission.upload(items)
    task = flight.uav.task(flight.uav.mission.start().id)
    return lambda: task.wait(PATIENCE_S)


def _go_to(flight: Flight) -> Callable[[], object]:
    return waited(lambda: flight.uav.go_to_waypoint(flight.offset(30.0), blocking=False))


def _path(flight: Flight) -> Callable[[], object]:
    way = [flight.offset(20.0), flight.offset(20.0, 20.0), flight.offset(0.0)]
    return waited(lambda: flight.uav.follow_path(way, blocking=False))


def _velocity(flight: Flight) -> Callable[[], object]:
    def stream() -> None:
        while True:
            flight.uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
            time.sleep(0.05)  # the rate of the stream

    return stream


def _mission(flight: Flight) -> Callable[[], object]:
    return mission_of(flight, [*waypoints(flight, 1, 0)])


def _land(flight: Flight) -> Callable[[], object]:
    task = flight.uav.land(blocking=False)
    flight.wait_for(lambda: flight.uav.state() is State.LANDING, "its landing")
    return lambda: task.wait(PATIENCE_S)


def _hover(_: Flight) -> None:
    return None


FLOWN: dict[str, Callable[[Flight], Callable[[], object] | None]] = {
    "hover": _hover,
    "go_to": _go_to,
    "path": _path,
    "velocity": _velocity,
    "mission": _mission,
    "land": _land,
}
"""Manoeuvres by name: each begins, and returns a function that waits for its end; None for a hover."""


def take_off(flight: Flight, doing: Doing, what: str) -> None:
    """The pilot arms, and it takes off: as a task of `doing` where the take-off is what is flown."""
    flight.be_armed()
    if what != "take_off":
        flight.uav.take_off(HEIGHT_M)
        return
    task = flight.uav.take_off(HEIGHT_M + 4.0, blocking=False)
    doing.begin(lambda: task.wait(PATIENCE_S))
