"""A recorded PX4 flight, replayed over UDP to a daemon as a real process."""

from __future__ import annotations

from tests.conftest import StartDaemon
from tests.ports import free_port
from tests.ual_daemon.backends.mavlink.traces import load, replay


def test_a_recorded_flight_comes_out_of_the_daemon_as_it_was(start_daemon: StartDaemon) -> None:
    port = free_port()
    daemon = start_daemon("--url", f"udpin://127.0.0.1:{port}", backend="mavlink")
    daemon.wait_for("state", new="UNINITIALIZED")
    replay(load("px4_auto_takeoff_loiter_rtl"), port, speed_factor=8.0)
    daemon.wait_for("state", old="LANDED_ARMED", new="LANDED_DISARMED")
    states = [event["new"] for event in daemon.events if event.get("event") == "state"]
    assert states[:8] == [
        "UNINITIALIZED",
        "LANDED_DISARMED",
        "LANDED_ARMED",
        "TAKING_OFF",
        "FLYING_MANUAL",
        "LANDING",
        "LANDED_ARMED",
        "LANDED_DISARMED",
    ]
