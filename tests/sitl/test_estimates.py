"""Resets of the estimator of a real PX4 in simulation: nothing that is flown may follow them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.pilot import SafetyPilot
from tests.sitl.transmitter import Transmitter
from tests.waiting import until
from ual.errors import TaskAbortedError
from ual.geometry import Quaternion, wrap_angle
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.mavlink.wire.messages import Message

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

SET_ATTITUDE = 620
"""MAV_CMD_EXTERNAL_ATTITUDE_ESTIMATE: PX4 resets its heading to the third parameter."""
RESET_DEG = 30.0
WATCHED_S = 0.8
"""Seconds within which PX4 turns by most of a reset that is not followed. Later its magnetometer pulls the estimate
back by itself, and the nose follows the estimate, which nothing can tell from a turn: by 0.1 to 0.9 rad in three
flights.
"""
WANDERS_RAD = 0.2
"""The heading of its simulator wanders by half of this; without UAL's care it turned by 0.64 rad."""

Nose = Callable[[], float]


@pytest.fixture
def nose(pilot: Transmitter) -> Nose:
    """True heading of the nose, to the right from north."""
    if not isinstance(pilot, SafetyPilot):
        pytest.skip("a PX4: ArduCopter takes no heading from outside")
    seen: list[float] = []

    def take(message: Message) -> None:
        w, x, y, z = message.attitude_quaternion
        seen.append(Quaternion(x, y, z, w).yaw_rad)

    pilot.listen(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 20.0, take)
    until(lambda: seen, "HIL_STATE_QUATERNION", limit_s=10.0)
    return lambda: seen[-1]


def reset_heading(flight: Flight) -> None:
    """Resets the estimate of the heading to 30 degrees right of what it is."""
    heading_deg = 90.0 - math.degrees(flight.uav.pose().pose.yaw_rad)
    flight.pilot.order(SET_ATTITUDE, (0.0, 0.0, heading_deg + RESET_DEG, 0.0, 0.0, 0.0, 5.0))


def turned_rad(nose: Nose, from_rad: float) -> float:
    """Returns the largest turn of the nose within some time."""
    until_s, most_rad = time.monotonic() + WATCHED_S, 0.0
    while time.monotonic() < until_s:
        time.sleep(0.05)
        most_rad = max(most_rad, abs(wrap_angle(nose() - from_rad)))
    return most_rad


def test_a_hover_does_not_turn_when_the_estimate_of_the_heading_is_reset(flight: Flight, uav: UAL, nose: Nose) -> None:
    flight.take_off()
    time.sleep(2.0)  # until it hovers
    before, from_rad, yaw_rad = flight.position(), nose(), uav.pose().pose.yaw_rad
    reset_heading(flight)
    turned = turned_rad(nose, from_rad)
    moved_m = (flight.position() - before).norm()
    print(f"PX4, heading reset by {RESET_DEG:.0f} deg: the nose turned by {turned:.2f} rad; {moved_m:.2f} m moved")
    assert abs(wrap_angle(uav.pose().pose.yaw_rad - yaw_rad)) > 0.3  # it was reset
    assert turned < WANDERS_RAD
    assert moved_m < 0.7
    assert uav.state() is State.FLYING_AUTO
    uav.land()
    flight.wait_for_state(State.LANDED_DISARMED)


def test_a_go_to_ends_when_the_estimate_of_the_heading_is_reset(flight: Flight, uav: UAL, nose: Nose) -> None:
    del nose  # a PX4
    flight.take_off()
    task = uav.go_to_waypoint(flight.offset(40.0), max_speed_m_s=2.0, blocking=False)
    flight.wait_for_speed(1.0)
    reset_heading(flight)
    with pytest.raises(TaskAbortedError, match="heading jumped") as caught:
        task.wait(PATIENCE_S)
    assert caught.value.metadata["by"] == "estimator"
    flight.wait_for(lambda: uav.velocity().twist.linear.norm() < 0.5, "its stop", 15.0)
    assert uav.state() is State.FLYING_AUTO
    uav.land()
    flight.wait_for_state(State.LANDED_DISARMED)
