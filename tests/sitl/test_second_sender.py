"""A second sender of setpoints, which drags the vehicle aside: it is told within a second, and ends the task."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.doing import Doing, take_off, waited
from tests.sitl.flights import Flight
from tests.sitl.transmitter import Transmitter
from tests.sitl.wiretap import Wiretap
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

TOLD_S, WATCHED_S = 1.0, 6.0
DRAGGED_M = 5.0
"""Metres aside by which its task has ended: it is told from 3 m on, while it moves."""
RATE_HZ = 40.0
ASIDE_M, UP_M = 10.0, 8.0
POSITION_ONLY = 0b110111111000


@contextmanager
def dragged(flight: Flight, wiretap: Wiretap) -> Iterator[None]:
    """Another program behind the router sends a place aside and above, until the end of the block."""
    here, system_id, is_over = flight.position(), flight.pilot._system_id, threading.Event()
    target = mavlink.MAVLink_set_position_target_local_ned_message(
        0,
        system_id,
        1,
        mavlink.MAV_FRAME_LOCAL_NED,
        POSITION_ONLY,
        here.y + ASIDE_M,
        here.x,
        -(here.z + UP_M),
        *(0.0,) * 8,
    )

    def send() -> None:
        while not is_over.wait(1.0 / RATE_HZ):
            wiretap.inject(target)

    sender = threading.Thread(target=send, name="second sender")
    sender.start()
    try:
        yield
    finally:
        is_over.set()
        sender.join()


@pytest.mark.parametrize("what", ["hover", "go_to"])
def test_another_sender_is_reported_within_a_second_and_drags_no_task_aside(
    flight: Flight, uav: UAL, wiretap: Wiretap, pilot: Transmitter, what: str
) -> None:
    """Its task ends where it is dragged aside. Where UAL's setpoints outweigh the other's, it goes on."""
    doing = Doing()
    take_off(flight, doing, what)
    begin = flight.position()
    if what == "go_to":
        doing.begin(waited(lambda: uav.go_to_waypoint(flight.offset(40.0), max_speed_m_s=2.0, blocking=False)))
        flight.wait_for_speed(1.0)
    aside_m = [0.0]
    with dragged(flight, wiretap):
        began_s = monotonic()
        flight.wait_for(lambda: "another" in uav.telemetry().state_reason, "the other sender", 5.0)
        told_s, reason = monotonic() - began_s, uav.telemetry().state_reason

        def is_over() -> bool:
            if doing.ended_s is None:
                aside_m[0] = max(aside_m[0], abs(flight.position().y - begin.y))
            return doing.ended_s is not None or monotonic() - began_s > WATCHED_S

        flight.wait_for(is_over, "what the other does")
    print(f"{pilot.autopilot} {what}: told {told_s:.2f} s after: {reason}; aside {aside_m[0]:.1f} m; {doing.error}")
    assert told_s < TOLD_S
    if what == "go_to":
        assert aside_m[0] < DRAGGED_M
        assert doing.error is None or "another" in str(doing.error)
