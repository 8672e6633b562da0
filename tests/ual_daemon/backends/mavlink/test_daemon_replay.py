"""A recorded PX4 flight, replayed over UDP to a daemon as a real process."""

from __future__ import annotations

import itertools
import signal

from tests.conftest import StartDaemon
from tests.ports import free_port
from tests.ual_daemon.backends.mavlink.traces import load, replay

FLIGHT = [
    "LANDED_DISARMED",
    "LANDED_ARMED",
    "TAKING_OFF",
    "FLYING_MANUAL",
    "LANDING",
    "LANDED_ARMED",
    "LANDED_DISARMED",
]
ATTEMPTS = 5


def test_a_recorded_flight_comes_out_of_the_daemon_as_it_was(start_daemon: StartDaemon) -> None:
    for attempt in range(ATTEMPTS):  # a daemon that is not scheduled for as long as a state lasts does not see it
        if states(start_daemon, f"uav_{attempt}") == FLIGHT:
            return
    raise AssertionError("it has never seen all of the flight")


def states(start_daemon: StartDaemon, ns: str) -> list[str]:
    """The states that a daemon tells of the flight; but not that it is unknown, as after a pause of the computer."""
    port = free_port()
    daemon = start_daemon("--url", f"udpin://127.0.0.1:{port}", backend="mavlink", ns=ns)
    daemon.wait_for("state", new="UNINITIALIZED")
    replay(load("px4_auto_takeoff_loiter_rtl"), port, speed_factor=8.0)
    daemon.signal(signal.SIGTERM)
    daemon.wait()
    told = [event["new"] for event in daemon.events if event.get("event") == "state"]
    return [state for state, _ in itertools.groupby(state for state in told if state != "UNINITIALIZED")]
