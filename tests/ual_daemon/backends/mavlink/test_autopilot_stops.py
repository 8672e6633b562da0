"""Stops from a high speed with simulated autopilots: they use all of the autopilot's acceleration."""

from __future__ import annotations

import pytest

from tests.backend_of import backend_of
from tests.simulators.physics import Vector, minus
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from ual.geometry import Twist, Vector3

SPEED_M_S = 7.0
WHOLE_M_S2 = {"px4": 3.0, "ardupilot": 2.5}
"""MPC_ACC_HOR and WPNAV_ACCEL."""
_STILL = Twist()
LAG_S = 0.5
"""The acceleration rises within 0.4 s, and the UAV follows a little later."""


@pytest.mark.parametrize("kind", list(WHOLE_M_S2))
def test_an_abort_brakes_with_all_of_the_autopilots_acceleration(kind: str) -> None:
    flight = Flight(kind)
    uav = flight.uav
    try:
        flight.take_off()
        flight.wait_for(lambda: backend_of(uav).info().acceleration_share < 1.0, "its parameters")
        begun: list[Vector] = []

        def abort() -> None:
            begun.append(flight.autopilot.body.position)
            uav.abort()

        flight.when(lambda telemetry: (telemetry.velocity or _STILL).linear.norm() > SPEED_M_S, abort)
        uav.go_to_waypoint(flight.goal(90.0, 0.0), max_speed_m_s=SPEED_M_S + 1.0, blocking=False)
        flight.wait_for(lambda: bool(begun), "its speed")
        flight.let_pass(8.0)
        assert uav.velocity().twist.linear.norm() < 0.1
        way = minus(flight.autopilot.body.position, begun[0])
        assert Vector3(*way).norm() < SPEED_M_S**2 / (2 * WHOLE_M_S2[kind]) + SPEED_M_S * LAG_S + 1.0
    finally:
        uav.close()
