"""Where the UAV flies when it returns home."""

from __future__ import annotations

from typing import NamedTuple

from ual.geometry import Vector3
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.ground import Ground
from ual_daemon.flight.state import Estimate


class HomePlace(NamedTuple):
    """Home in the local frame, on the ground, and what it follows from, for people."""

    position: Vector3
    what: str


class Home:
    """The home of one UAV: the autopilot's, where the autopilot's own return would fly; else the place of the take-off.

    The ground from which UAL saw it take off gives the height: autopilots correct the altitude of home in flight.
    """

    def __init__(self) -> None:
        self._ground = Ground()

    def observe(self, snapshot: Snapshot, raw: Estimate) -> None:
        """Notes where the UAV stands. Called by the update thread at each update."""
        self._ground.observe(snapshot, raw)

    def estimate_jumped(self, jump: Vector3) -> None:
        """Notes that the autopilot's estimate has jumped: the place of the take-off has not."""
        self._ground.estimate_jumped(jump)

    def place(self, snapshot: Snapshot) -> HomePlace | None:
        """Returns home; None if none is known."""
        autopilots, seen = snapshot.home, self._ground.place
        if autopilots is None:
            return None if seen is None else HomePlace(seen, "the place of the take-off")
        z = autopilots.z if seen is None else seen.z
        return HomePlace(Vector3(autopilots.x, autopilots.y, z), "the autopilot's home")
