"""Position at which the UAV flies when it returns home."""

from __future__ import annotations

from typing import NamedTuple

from ual.geometry import Vector3
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.policy.ground import Ground


class HomePoint(NamedTuple):
    """Home in the local frame, on the ground, and what it follows from, human-readable."""

    position: Vector3
    what: str


def home_point(snapshot: Snapshot, ground: Ground) -> HomePoint | None:
    """Returns the autopilot's home, where its own return would fly, else the place of the take-off; None if unknown.

    The ground from which UAL saw it take off gives the height: autopilots correct the altitude of home in flight.
    """
    autopilots, seen = snapshot.earth.home, ground.place
    if autopilots is None:
        return None if seen is None else HomePoint(seen, "the place of the take-off")
    z = autopilots.z if seen is None else seen.z
    return HomePoint(Vector3(autopilots.x, autopilots.y, z), "the autopilot's home")
