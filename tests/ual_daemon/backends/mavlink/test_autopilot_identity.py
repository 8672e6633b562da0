"""The vehicle is the one that was meant: what callers are told where it is not, with simulated autopilots."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from ual.errors import NotSupportedError, WrongStateError
from ual.geometry import Twist, Vector3
from ual.types import State


@pytest.fixture
def flight() -> Iterator[Flight]:
    flight = Flight("ardupilot")
    yield flight
    flight.uav.close()


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (mavlink.MAV_TYPE_FIXED_WING, "fixed wing"),
        (mavlink.MAV_TYPE_GROUND_ROVER, "ground rover"),
        (mavlink.MAV_TYPE_HELICOPTER, "helicopter"),
    ],
)
def test_a_vehicle_that_is_no_multirotor_says_so_in_every_refusal_and_in_its_state(
    kind: int, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ArduPilot, "kind", kind)
    flight = Flight("ardupilot")
    try:
        flight.wait_for_state(State.LANDED_DISARMED)
        expected = rf"UAL only watches .*{text}.*; it flies PX4 and ArduPilot multirotors"
        for command in (flight.uav.arm, flight.uav.land, flight.uav.recover_from_manual):
            with pytest.raises(NotSupportedError, match=expected):
                command()
        with pytest.raises(NotSupportedError, match=expected):
            flight.uav.take_off(3.0)
        with pytest.raises(NotSupportedError, match=expected):
            flight.uav.set_velocity(Twist(Vector3(1.0, 0.0, 0.0)))
        assert text in flight.uav.telemetry().state_reason
    finally:
        flight.uav.close()


def reported(flight: Flight) -> str:
    health = flight.uav.telemetry().health
    return "" if health is None else " ".join(health.failing_checks)


def push_plane(flight: Flight) -> None:
    with flight.autopilot.lock:
        flight.autopilot.kind = mavlink.MAV_TYPE_FIXED_WING
        flight.autopilot._push(mavlink.MAVLINK_MSG_ID_HEARTBEAT)  # type: ignore[attr-defined]
        flight.autopilot.kind = mavlink.MAV_TYPE_QUADROTOR


def test_heartbeats_of_another_kind_end_no_flight_but_forbid_the_next_one(flight: Flight) -> None:
    flight.take_off()
    task = flight.uav.go_to_waypoint(flight.goal(20.0, 0.0), blocking=False)
    flight.let_pass(1.0)
    push_plane(flight)
    flight.let_pass(3.0)
    assert reported(flight) == ""  # one is no verdict
    for _ in range(6):
        push_plane(flight)
        flight.let_pass(0.7)
    assert "fixed wing send as system 1" in reported(flight)
    assert flight.uav.state() is State.FLYING_AUTO
    task.wait(LIMIT_S)
    landing = flight.uav.land(blocking=False)
    while not landing.done():
        push_plane(flight)
        flight.let_pass(0.7)
    for _ in range(6):
        push_plane(flight)
        flight.let_pass(0.7)
    with pytest.raises(WrongStateError, match="fixed wing send as system 1: give each vehicle an id of its own"):
        flight.uav.take_off(3.0)
    assert "fixed wing" in flight.uav.telemetry().state_reason
    flight.wait_for_state(State.LANDED_DISARMED)  # it is heard no more
