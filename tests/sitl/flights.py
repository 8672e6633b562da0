"""Flights of the class interface with a real autopilot in simulation, whichever it is."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import pytest

from ual.errors import RejectedByAutopilotError, TaskAbortedError, WrongStateError
from ual.geometry import Pose, Twist, Vector3, wrap_angle
from ual.types import Limits, State, Telemetry
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.values import Setpoint

PATIENCE_S = 40.0
HEIGHT_M = 3.0


class Pilot(Protocol):
    """A safety pilot."""

    def wait_until_ready(self) -> None:
        """Until the autopilot says that it may be armed."""

    def arm(self) -> None: ...

    def take_over(self) -> None:
        """Flips his switch, and returns at once."""


@dataclass(frozen=True)
class Simulator:
    """What is to be expected of an autopilot in its simulator.

    `wanders_m` is how far off its own estimate it may hover, `estimate_m_s` how wrong its velocity may be.
    """

    autopilot: str
    pilots_mode: str
    wanders_m: float
    estimate_m_s: float


class CountingBackend(MavlinkBackend):
    """Notes when setpoints are sent."""

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        self.sent_s: list[float] = []

    def send(self, setpoint: Setpoint) -> None:
        self.sent_s.append(time.monotonic())
        super().send(setpoint)


class Flight:
    """A UAV, its safety pilot, and everything that was seen of it."""

    def __init__(self, url: str, pilot: Pilot) -> None:
        self.pilot = pilot
        self.backend = CountingBackend(BackendOptions("uav_1", url))
        self.uav = UAL(self.backend, allow_arming=True)
        self.seen: list[Telemetry] = []
        self.uav.subscribe(self.seen.append)

    def wait_for(self, condition: Callable[[], bool], what: str, limit_s: float = PATIENCE_S) -> float:
        """Waits, and says how long it took."""
        began_s = time.monotonic()
        while not condition():
            assert time.monotonic() - began_s < limit_s, f"{what} did not come; {self.uav.telemetry()}"
            time.sleep(0.005)
        return time.monotonic() - began_s

    def wait_for_state(self, state: State, limit_s: float = PATIENCE_S) -> float:
        return self.wait_for(lambda: self.uav.state() is state, state.name, limit_s)

    def position(self) -> Vector3:
        return self.uav.pose().pose.position

    def take_off(self) -> None:
        """The pilot arms, and it climbs."""
        self.wait_for(self.uav.is_ready, "a state")
        self.pilot.wait_until_ready()
        self.pilot.arm()
        self.wait_for_state(State.LANDED_ARMED)
        self.uav.take_off(HEIGHT_M)

    def end(self) -> None:
        """Lands, however it flies, and waits for the motors to stop."""
        if self.uav.state() is State.FLYING_MANUAL:
            self.uav.recover_from_manual()
        if self.uav.state() is State.FLYING_AUTO:
            self.uav.land()
        self.wait_for_state(State.LANDED_DISARMED)

    def close(self) -> None:
        try:
            self.end()
        finally:
            self.uav.close()


def fly_with_the_pilot_taking_over(flight: Flight, simulator: Simulator) -> None:
    """A whole flight: take-off, go-to, velocity, abort; the pilot takes over in a go-to; recovery and landing."""
    uav, pilot = flight.uav, flight.pilot
    flight.wait_for(uav.is_ready, "a state")
    assert uav.info().autopilot == simulator.autopilot
    flight.wait_for(lambda: uav.info().is_simulation, "its version")
    flight.wait_for(lambda: uav.info().limits.horizontal_speed_m_s > Limits().horizontal_speed_m_s, "its limits")
    ground = flight.position()

    flight.take_off()
    assert uav.state() is State.FLYING_AUTO
    assert flight.position().z - ground.z == pytest.approx(HEIGHT_M, abs=0.4)

    here = uav.pose().pose
    goal = Pose.at(here.position.x + 8.0, here.position.y + 6.0, here.position.z + 2.0, here.yaw_rad + math.pi / 2)
    uav.go_to_waypoint(goal)
    assert (flight.position() - goal.position).norm() < simulator.wanders_m
    assert abs(wrap_angle(uav.pose().pose.yaw_rad - goal.yaw_rad)) < 0.2

    velocity = Twist(Vector3(1.0, -0.5, 0.0), Vector3(0.0, 0.0, 0.3))
    seen: list[Twist] = []
    until_s = time.monotonic() + 6.0
    while time.monotonic() < until_s:
        uav.set_velocity(velocity)
        time.sleep(0.05)
        seen.append(uav.velocity().twist)
    steady = seen[len(seen) // 2 :]
    mean = sum((twist.linear for twist in steady), Vector3()) / len(steady)
    assert (mean - velocity.linear).norm() < simulator.estimate_m_s
    turning_rad_s = sum(twist.angular.z for twist in steady) / len(steady)
    assert turning_rad_s == pytest.approx(0.3, abs=0.05)

    uav.abort()
    flight.wait_for(lambda: uav.velocity().twist.linear.norm() < 0.5, "its stop", 5.0)

    far = flight.position() + Vector3(-20.0, 0.0, 0.0)
    task = uav.go_to_waypoint(Pose.at(*far), blocking=False)
    flight.wait_for(lambda: uav.velocity().twist.linear.x < -1.0, "its speed")
    pilot.take_over()
    taken_s = time.monotonic()
    with pytest.raises(TaskAbortedError, match=f"taken by the safety pilot .*{simulator.pilots_mode}"):
        task.wait(timeout_s=5.0)
    assert time.monotonic() - taken_s < 0.5
    assert uav.state() is State.FLYING_MANUAL
    ended_s = time.monotonic()
    time.sleep(2.0)  # that nothing is sent shows only in time
    assert [sent_s for sent_s in flight.backend.sent_s if sent_s > ended_s] == []
    with pytest.raises(WrongStateError):
        uav.set_velocity(velocity)

    uav.recover_from_manual()
    assert uav.state() is State.FLYING_AUTO
    uav.land()
    assert uav.state() in (State.LANDED_ARMED, State.LANDED_DISARMED)
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.pilot.wait_until_ready()  # for the next flight, without anybody switching modes


def arm_and_disarm(flight: Flight) -> None:
    flight.wait_for(flight.uav.is_ready, "a state")
    flight.pilot.wait_until_ready()
    flight.uav.arm()
    assert flight.uav.state() is State.LANDED_ARMED
    flight.uav.disarm()
    assert flight.uav.state() is State.LANDED_DISARMED


def be_refused_to_disarm_in_the_air(flight: Flight, result: str) -> None:
    flight.take_off()
    error = flight.backend.disarm().exception(10.0)
    assert isinstance(error, RejectedByAutopilotError)
    assert result in str(error)
    assert flight.uav.state() is State.FLYING_AUTO


def restart_in_the_air(flight: Flight, url: str, own_hold: str) -> None:
    """A new daemon tells the truth, and can take over from the autopilot's own hold."""
    flight.take_off()
    flight.uav.close()  # the autopilot holds by itself meanwhile
    second = Flight(url, flight.pilot)
    flight.uav, flight.backend = second.uav, second.backend
    assert flight.wait_for(flight.uav.is_ready, "a state") < 3.0
    assert flight.uav.state() is State.FLYING_MANUAL
    assert flight.uav.telemetry().flight_mode == own_hold
    flight.uav.recover_from_manual()
    here = flight.position()
    flight.uav.go_to_waypoint(Pose.at(here.x + 3.0, here.y, here.z))
    assert flight.uav.state() is State.FLYING_AUTO
