"""An imaginary autopilot, as the library of its maker would provide it: with north, east, down, and degrees.

It is a simulation: a point that follows a target. A real one would be a device at the end of a cable.
"""

from __future__ import annotations

import math
import threading
import time
from dataclasses import dataclass

PERIOD_S = 0.02
HORIZONTAL_M_S, VERTICAL_M_S, TURN_DEG_S = 3.0, 1.5, 60.0
_RESPONSE_S, _GAIN, _LANDING_M_S, _GIVES_UP_S, _DISARMS_S = 0.3, 1.5, 0.7, 1.0, 1.0

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Packet:
    """The message that it sends 50 times a second. Positions: north, east, down (m); headings: clockwise from north."""

    time_s: float
    mode: str
    is_armed: bool
    is_on_ground: bool
    place: Triple
    velocity: Triple
    heading_deg: float
    turn_deg_s: float


@dataclass(frozen=True)
class Target:
    """What it follows: a position (or none), and the velocity there."""

    velocity: Triple
    turn_deg_s: float
    place: Triple | None = None
    heading_deg: float = 0.0


class Autopilot:
    """One device. `speed` is how fast its time runs, for tests. May be used from any thread."""

    def __init__(self, speed: float = 1.0) -> None:
        self._lock = threading.Lock()
        self._period_s = PERIOD_S / speed
        self._due_s = time.monotonic()
        self._time_s = self._target_s = self._landed_s = 0.0
        self._mode, self._is_armed = "hold", False
        self._place = self._velocity = (0.0, 0.0, 0.0)
        self._heading_deg = self._turn_deg_s = 0.0
        self._target = Target(self._velocity, 0.0, self._place)

    def receive(self, timeout_s: float) -> Packet | None:
        """Waits for the next packet. Returns None if none came in time."""
        pause_s = self._due_s - time.monotonic()
        time.sleep(max(0.0, min(pause_s, timeout_s)))
        if pause_s > timeout_s:
            return None
        self._due_s = max(self._due_s, time.monotonic() - self._period_s) + self._period_s
        with self._lock:
            self._step(PERIOD_S)
            is_on_ground = self._landed_s > 0.0
            return Packet(
                self._time_s,
                self._mode,
                self._is_armed,
                is_on_ground,
                self._place,
                self._velocity,
                self._heading_deg,
                self._turn_deg_s,
            )

    def command(self, name: str) -> str:
        """Performs ``arm``, ``disarm``, or the name of a mode (``follow``, ``hold``, ``land``). Returns ``ok``, or why
        it refuses.
        """
        with self._lock:
            if name in ("arm", "disarm"):
                if self._landed_s == 0.0:
                    return "not on the ground"
                self._is_armed = name == "arm"
                self._switch("hold")
            elif not self._is_armed:
                return "not armed"
            else:
                self._switch(name)
        return "ok"

    def follow(self, target: Target) -> None:
        """Sets the target of the mode ``follow``."""
        with self._lock:
            if self._mode == "follow":
                self._target, self._target_s = target, self._time_s

    def _switch(self, mode: str) -> None:
        """Changes the mode; it stays where it is until it gets a target."""
        self._mode, self._target_s = mode, self._time_s
        self._target = Target((0.0, 0.0, 0.0), 0.0, self._place, self._heading_deg)

    def _step(self, dt: float) -> None:
        self._time_s += dt
        if self._mode == "follow" and self._landed_s == 0.0 and self._time_s - self._target_s > _GIVES_UP_S:
            self._switch("hold")
        north, east, down = self._wanted()
        slower = max(1.0, math.hypot(north, east) / HORIZONTAL_M_S, abs(down) / VERTICAL_M_S)
        wanted = (north / slower, east / slower, down / slower)
        self._velocity = _add(self._velocity, wanted, self._velocity, dt / _RESPONSE_S)
        rests = self._place[2] >= 0.0 and (down >= 0.0 or not self._is_armed)
        if rests:
            self._velocity, self._turn_deg_s = (0.0, 0.0, 0.0), 0.0
        self._place = _add(self._place, self._velocity, (0.0, 0.0, 0.0), dt)
        self._place = (self._place[0], self._place[1], min(0.0, self._place[2]))
        self._heading_deg = (self._heading_deg + self._turn_deg_s * dt) % 360.0
        self._landed_s = self._landed_s + dt if rests else 0.0
        if self._mode == "land" and self._landed_s > _DISARMS_S:
            self._is_armed = False
            self._switch("hold")

    def _wanted(self) -> Triple:
        """Returns the wanted velocity, and sets the yaw rate."""
        target, velocity, turn = self._target, self._target.velocity, self._target.turn_deg_s
        if target.place is not None:
            velocity = _add(velocity, target.place, self._place, _GAIN)
            turn += _GAIN * math.remainder(target.heading_deg - self._heading_deg, 360.0)
        self._turn_deg_s = max(-TURN_DEG_S, min(TURN_DEG_S, turn))
        return (velocity[0], velocity[1], _LANDING_M_S) if self._mode == "land" else velocity


def _add(a: Triple, b: Triple, c: Triple, factor: float) -> Triple:
    """Returns a + (b - c) * factor."""
    return (a[0] + (b[0] - c[0]) * factor, a[1] + (b[1] - c[1]) * factor, a[2] + (b[2] - c[2]) * factor)
