"""Real autopilots in simulation that lose GPS in flight and fly on poses from outside: their true poses, with noise."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.outside import NOISE_M, RATE_HZ, Outside
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.troubles import trouble
from ual.geometry import Pose
from ual.types import GpsFix, State

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

_EV_CTRL = "EKF2_EV_CTRL"
_POSITION_HEIGHT, _POSITION_HEIGHT_YAW = 3, 11
"""Without the heading where the poses end: PX4 may then reset it, which ends a go-to."""
_SET_EKF_SOURCE_SET, _GPS_SET, _OUTSIDE_SET = 42007, 1.0, 2.0
_PREPARED = "UAL_TEST_ARDUPILOT_VISO"
"""ArduPilot reads VISO_TYPE only when it boots."""
BLIND_S = 12.0
"""Neither autopilot flies as long without a position. PX4 goes from GPS to the poses after 8 s of these."""
SETTLED_M = 0.6
ENDED_TOLD_S = 0.5
_ENDED = "come from outside any more"


@contextmanager
def poses_used(simulator: Simulator, pilot: Transmitter, what: int) -> Iterator[None]:
    """The autopilot uses poses from outside until the end of the block."""
    is_px4 = simulator.autopilot == "PX4"
    try:
        if is_px4:
            pilot.set_integer(_EV_CTRL, what)
        yield
    finally:
        if is_px4:
            pilot.set_integer(_EV_CTRL, 0)
        else:
            pilot.order(_SET_EKF_SOURCE_SET, (_GPS_SET,))


@contextmanager
def flying_on_poses(flight: Flight, simulator: Simulator, what: int = _POSITION_HEIGHT_YAW) -> Iterator[Outside]:
    """Takes off, loses GPS, and flies on poses from outside until the end of the block."""
    uav, pilot = flight.uav, flight.pilot
    if simulator.autopilot != "PX4" and not os.environ.get(_PREPARED):
        pytest.skip(
            f"start with VISO_TYPE 1 and EK3_SRC2_POSXY 6 (docs/reference/backends/mavlink.md), and set {_PREPARED}=1"
        )
    source = Outside(uav, pilot, flight.position())
    try:
        with poses_used(simulator, pilot, what):
            flight.take_off()
            if simulator.autopilot != "PX4":
                pilot.order(_SET_EKF_SOURCE_SET, (_OUTSIDE_SET,))
            with trouble(pilot, simulator.autopilot, "position failsafe"):
                flight.wait_for(lambda: fix_of(flight) <= GpsFix.NONE, "the loss of GPS")
                lost_s = time.monotonic()
                flight.wait_for(
                    lambda: time.monotonic() - lost_s > BLIND_S and off_m(flight, source) < SETTLED_M, "its new place"
                )
                yield source
    finally:
        source.close()
    assert source.refusals == []
    flight.wait_for(uav.is_ready, "its position by GPS")


def test_it_flies_on_and_lands_on_poses_from_outside(flight: Flight, simulator: Simulator) -> None:
    ground_m = flight.position().z
    with flying_on_poses(flight, simulator) as source:
        fly_without_gps(flight, source, simulator, ground_m)
        source.is_on = False
        flight.wait_for(lambda: not flight.uav.is_ready(), "the loss of its position")
        assert "; no poses from outside for " in flight.uav.telemetry().state_reason


def test_poses_that_end_are_reported_at_once_and_a_go_to_waits_for_them(flight: Flight, simulator: Simulator) -> None:
    uav = flight.uav
    with flying_on_poses(flight, simulator, _POSITION_HEIGHT) as source:
        goal = flight.offset(8.0)
        task = uav.go_to_waypoint(goal, max_speed_m_s=1.0, blocking=False)
        flight.wait_for_speed(0.5)
        source.is_on = False
        ended_s = time.monotonic()
        flight.wait_for(lambda: _ENDED in uav.telemetry().state_reason, "that they have ended", 5.0)
        told_s = time.monotonic() - ended_s
        print(f"{simulator.autopilot}: told {told_s:.2f} s after the last pose: {uav.telemetry().state_reason}")
        assert told_s < ENDED_TOLD_S
        flight.wait_for(lambda: uav.velocity().twist.linear.norm() < 0.3, "its stop", 3.0)
        assert not task.done()
        source.is_on = True
        task.wait(PATIENCE_S)
        beside_m = (source.pose.position - goal.position).horizontal_norm()
        print(f"{simulator.autopilot}: truly {beside_m:.2f} m beside the goal")
        assert beside_m < simulator.wanders_m
        uav.land()
        flight.wait_for_state(State.LANDED_DISARMED)


def fly_without_gps(flight: Flight, source: Outside, simulator: Simulator, ground_m: float) -> None:
    uav = flight.uav
    assert uav.state() is State.FLYING_AUTO
    here = flight.position()
    goal = Pose.at(here.x + 4.0, here.y + 3.0, here.z)
    uav.go_to_waypoint(goal)
    beside_m = (source.pose.position - goal.position).horizontal_norm()
    off = []
    for _ in range(100):
        off.append(off_m(flight, source))
        time.sleep(0.05)
    uav.land()
    flight.wait_for_state(State.LANDED_DISARMED)
    print(
        f"{simulator.autopilot} on {source.given_count} poses ({RATE_HZ:g} Hz, {NOISE_M * 1e3:g} mm): truly "
        f"{beside_m:.2f} m beside the goal; estimate off by {sum(off) / len(off):.2f} m, {max(off):.2f} m at most; "
        f"landed at {source.pose.position.z - ground_m:.2f} m"
    )
    assert beside_m < simulator.wanders_m
    assert abs(source.pose.position.z - ground_m) < 0.5


def off_m(flight: Flight, source: Outside) -> float:
    """Returns the distance of the estimate from the true position along the ground.

    The height of a PX4 that has had satellites is its barometer's, which wanders by 1 m in a minute.
    """
    return (flight.position() - source.pose.position).horizontal_norm()


def fix_of(flight: Flight) -> GpsFix:
    gps = flight.uav.telemetry().gps
    return GpsFix.RTK_FIXED if gps is None else gps.fix
