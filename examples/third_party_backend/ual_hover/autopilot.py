"""An imaginary autopilot, with the interface of its manufacturer's library: north, east, down, and degrees.

It simulates a point that follows its target. A real autopilot would be a device at the other end of a link.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from dataclasses import dataclass

PERIOD_S = 0.02
HORIZONTAL_M_S, VERTICAL_M_S, YAW_RATE_DEG_S = 3.0, 1.5, 60.0
_RESPONSE_S, _GAIN, _LANDING_M_S, _TARGET_TIMEOUT_S, _DISARM_AFTER_S = 0.3, 1.5, 0.7, 1.0, 1.0

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Packet:
    """Message that it sends 50 times a second. Positions are north, east, down (m); headings are clockwise from
    north.
    """

    time_s: float
    mode: str
    is_armed: bool
    is_on_ground: bool
    position: Triple
    velocity: Triple
    heading_deg: float
    yaw_rate_deg_s: float


@dataclass(frozen=True)
class Answer:
    """Answer after a command: the command, and ``ok``, or the reason of a refusal."""

    command: str
    text: str


@dataclass(frozen=True)
class Target:
    """Target that it is to follow: a position (or none), and the motion there."""

    velocity: Triple
    yaw_rate_deg_s: float
    position: Triple | None = None
    heading_deg: float = 0.0


class Autopilot:
    """One device. Its time runs `speed` times as fast as real time, for tests. Any thread may call its methods."""

    def __init__(self, speed: float = 1.0) -> None:
        self._lock = threading.Lock()
        self._period_s = PERIOD_S / speed
        self._due_s = time.monotonic()
        self._answers: deque[Answer] = deque()
        self.boot()

    def boot(self) -> None:
        """Begins as when it is switched on: where it stands is the origin, and its motors are off."""
        self._time_s = self._target_s = self._landed_s = 0.0
        self._mode, self._is_armed = "hold", False
        self._position = self._velocity = (0.0, 0.0, 0.0)
        self._heading_deg = self._yaw_rate_deg_s = 0.0
        self._target = Target(self._velocity, 0.0, self._position)

    def receive(self, timeout_s: float) -> Packet | Answer | None:
        """Waits for what it sends next. Returns None if nothing came in time."""
        if self._answers:
            return self._answers.popleft()
        pause_s = self._due_s - time.monotonic()
        time.sleep(max(0.0, min(pause_s, timeout_s)))
        if pause_s > timeout_s:
            return None
        self._due_s = max(self._due_s, time.monotonic() - self._period_s) + self._period_s
        return self.step()

    def step(self) -> Packet:
        """Lets it fly on by a period, and returns what it sends then."""
        with self._lock:
            self._step(PERIOD_S)
            is_on_ground = self._landed_s > 0.0
            return Packet(
                self._time_s,
                self._mode,
                self._is_armed,
                is_on_ground,
                self._position,
                self._velocity,
                self._heading_deg,
                self._yaw_rate_deg_s,
            )

    def command(self, name: str) -> None:
        """Sends a command: ``arm``, ``disarm``, or a change to a mode (``follow``, ``hold``, ``land``)."""
        self._answers.append(Answer(name, self.execute(name)))

    def execute(self, name: str) -> str:
        """Executes a command. Returns ``ok``, or the reason of a refusal."""
        with self._lock:
            if name in ("arm", "disarm"):
                if self._landed_s == 0.0:
                    return "not on the ground"
                self._is_armed = name == "arm"
                self._change_mode("hold")
            elif not self._is_armed:
                return "not armed"
            else:
                self._change_mode(name)
        return "ok"

    def follow(self, target: Target) -> None:
        """Sets the target of the mode ``follow``."""
        with self._lock:
            if self._mode == "follow":
                self._target, self._target_s = target, self._time_s

    def _change_mode(self, mode: str) -> None:
        """Changes the mode. It holds its position until it gets a target."""
        self._mode, self._target_s = mode, self._time_s
        self._target = Target((0.0, 0.0, 0.0), 0.0, self._position, self._heading_deg)

    def _step(self, dt: float) -> None:
        self._time_s += dt
        if self._mode == "follow" and self._landed_s == 0.0 and self._time_s - self._target_s > _TARGET_TIMEOUT_S:
            self._change_mode("hold")
        north, east, down = self._wanted_velocity()
        slower = max(1.0, math.hypot(north, east) / HORIZONTAL_M_S, abs(down) / VERTICAL_M_S)
        wanted = (north / slower, east / slower, down / slower)
        self._velocity = _add(self._velocity, wanted, self._velocity, dt / _RESPONSE_S)
        rests = self._position[2] >= 0.0 and (down >= 0.0 or not self._is_armed)
        if rests:
            self._velocity, self._yaw_rate_deg_s = (0.0, 0.0, 0.0), 0.0
        self._position = _add(self._position, self._velocity, (0.0, 0.0, 0.0), dt)
        self._position = (self._position[0], self._position[1], min(0.0, self._position[2]))
        self._heading_deg = (self._heading_deg + self._yaw_rate_deg_s * dt) % 360.0
        self._landed_s = self._landed_s + dt if rests else 0.0
        if self._mode == "land" and self._landed_s > _DISARM_AFTER_S:
            self._is_armed = False
            self._change_mode("hold")

    def _wanted_velocity(self) -> Triple:
        """Returns the velocity to reach, and sets the yaw rate."""
        target, velocity, yaw_rate_deg_s = self._target, self._target.velocity, self._target.yaw_rate_deg_s
        if target.position is not None:
            velocity = _add(velocity, target.position, self._position, _GAIN)
            yaw_rate_deg_s += _GAIN * math.remainder(target.heading_deg - self._heading_deg, 360.0)
        self._yaw_rate_deg_s = max(-YAW_RATE_DEG_S, min(YAW_RATE_DEG_S, yaw_rate_deg_s))
        return (velocity[0], velocity[1], _LANDING_M_S) if self._mode == "land" else velocity


def _add(a: Triple, b: Triple, c: Triple, factor: float) -> Triple:
    """a + (b - c) * factor."""
    return (a[0] + (b[0] - c[0]) * factor, a[1] + (b[1] - c[1]) * factor, a[2] + (b[2] - c[2]) * factor)
