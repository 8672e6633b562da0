"""The mavlink backend on the caller's thread and a scripted clock, fed with PX4's recorded stream through a UDP socket.

Every run executes the same instructions.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from unittest.mock import patch

from benchmarks.children import free_port
from benchmarks.setups import FENCE
from benchmarks.vehicle import MinimalVehicle, frames
from ual.types import State, Telemetry
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions, UpdateCallback
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.backends.engine.loop import LoopThread
from ual_daemon.backends.mavlink.backend import MavlinkBackend
from ual_daemon.backends.mavlink.links import LinkConnection
from ual_daemon.backends.mavlink.links.base import Chunk
from ual_daemon.settings import GeofenceSettings, VehicleSettings

_TRACE, _FROM_S, _TO_S = "px4_offboard_manual_recover", 8.0, 21.9
"""A hover in OFFBOARD."""
_BURST_S = 0.001
"""Frames that came within this time reach the backend together."""
_BEGIN_S, _BEGIN_UTC_S = 1000.0, 1.8e9
_FIRST_TURNS, _TURN_S = 20, 0.0001
_SETTLED_S = 1.5


class _ScriptedClock(MonotonicClock):
    """A clock that stands still until it is set."""

    time_s = _BEGIN_S

    def now_s(self) -> float:
        return self.time_s

    def utc_s(self) -> float:
        return _BEGIN_UTC_S + self.time_s


class _PromptConnection(LinkConnection):
    """A connection that does not wait for data."""

    def receive(self, timeout_s: float, now_s: float) -> list[Chunk]:
        return super().receive(0.0, now_s)


class _TurnedBackend(MavlinkBackend):
    """The backend, whose loop turns when its caller turns it."""

    def __init__(self, port: int) -> None:
        super().__init__(BackendOptions("uav_1", f"udpin://127.0.0.1:{port}"))
        self.clock: _ScriptedClock = _ScriptedClock()

    def open(self, on_update: UpdateCallback) -> None:
        with patch.object(LoopThread, "open"):  # no thread begins
            self._start(_PromptConnection(self._new_link(), self.url), on_update)

    def turn(self) -> None:
        """Receives what has come, and makes an update of it."""
        assert self._receiving is not None
        self._receiving.thread.turn()

    def publish(self) -> None:
        """Publishes a snapshot of what is known."""
        assert self._loop is not None
        self._loop.publish(self.clock.now_s())


class ReplayedFlight:
    """A UAV in OFFBOARD, and the autopilot's stream, of which each step sends one burst."""

    def __init__(self, *, has_fence: bool) -> None:
        port = free_port(socket.SOCK_DGRAM)
        self.unsubscribe: Callable[[], None] = lambda: None
        """Ends the reader."""
        self._backend = _TurnedBackend(port)
        settings = VehicleSettings(geofence=GeofenceSettings(polygon=FENCE)) if has_fence else VehicleSettings()
        self.uav = UAL(self._backend, settings=settings)
        self._vehicle = MinimalVehicle()
        self._vehicle.answer_at(port, has_fence=has_fence)
        self._bursts: list[tuple[float, list[bytes]]] = []
        for time_s, frame in frames(_TRACE):
            if not _FROM_S <= time_s <= _TO_S:
                continue
            if self._bursts and time_s - self._bursts[-1][0] < _BURST_S:
                self._bursts[-1][1].append(frame)
            else:
                self._bursts.append((time_s, [frame]))
        self._at = 0
        self._backend.clock.time_s = _BEGIN_S + self._bursts[0][0]
        for _ in range(_FIRST_TURNS):
            self._backend.turn()
            self._backend.clock.time_s += _TURN_S

    def step(self, *, answers: bool = False) -> None:
        """Sends the next burst, and has it received. `answers`: the autopilot answers what it is asked."""
        time_s, burst = self._bursts[self._at]
        self._at += 1
        self._backend.clock.time_s = _BEGIN_S + time_s + 0.01
        send = self._vehicle.send_recorded if answers else self._vehicle.send_bytes
        for frame in burst:
            send(frame)
        self._backend.turn()
        if answers:
            self._vehicle.receive()

    def run(self, duration_s: float, *, answers: bool = False) -> None:
        """Sends the stream of so many seconds."""
        end_s = self._bursts[self._at][0] + duration_s
        while self._bursts[self._at][0] < end_s:
            self.step(answers=answers)

    def update(self) -> None:
        """Has an update made of what is known, though nothing new has come."""
        self._backend.publish()

    def until_flying(self) -> None:
        """Sends the stream until everything that is asked at the beginning is known."""
        while self.uav.state() is not State.FLYING_AUTO:
            self.step(answers=True)
        self.run(_SETTLED_S, answers=True)


@contextmanager
def replayed(read: Callable[[Telemetry], None], *, has_fence: bool) -> Iterator[ReplayedFlight]:
    """Provides a flight, whose telemetry `read` gets. With a fence its edge is 8 m away."""
    flight = ReplayedFlight(has_fence=has_fence)
    try:
        flight.until_flying()
        flight.unsubscribe = flight.uav.vehicle.subscribe(read)
        yield flight
    finally:
        flight.uav.vehicle.close()
