"""PX4's events, which MAVROS passes on in ROS 2."""

from __future__ import annotations

from concurrent.futures import Future

from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.firmwares.px4_events import AUTOPILOT_ID, event_id
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.session import MavrosSession
from ual_daemon.backends.mavros.settings import MavrosSettings
from ual_daemon.backends.mavros.vehicle import VehicleDescription
from ual_daemon.backends.rosbridge import Message


def header(now_s: int) -> Message:
    return {"stamp": {"sec": now_s, "nanosec": 0}}


def state(mode: str, now_s: int, *, armed: bool) -> Message:
    return {"header": header(now_s), "connected": True, "armed": armed, "mode": mode, "system_status": 3}


def test_the_mode_that_came_with_the_event_of_an_arming_may_be_the_one_before() -> None:
    """A busy computer reads both at the same moment. The mode that the arming has entered comes up to 1 s later."""
    session = MavrosSession(
        VehicleDescription(1, 12, 2, False, 0, 0, 0, 0, 0),
        Px4(),
        MavrosSettings(),
        SetpointMonitor(),
        lambda *_: Future(),
        LinkWatch("bridge", 1.0),
        lambda: 0.0,
    )
    number = event_id("commander_armed_by") & ~AUTOPILOT_ID  # MAVROS leaves the component out
    event = {"header": header(5), "px4_id": number, "severity": 6, "arguments": [4]}
    session.on_message(topics.EXTENDED_STATE, {"header": header(5), "landed_state": 1, "vtol_state": 0}, 5.0)
    session.on_message(topics.STATE, state("OFFBOARD", 5, armed=False), 5.0)
    session.on_message(topics.STATUS_EVENT, event, 5.0)
    control = session.snapshot(5.0).control
    assert control.armed is not None
    assert control.armed.value
    assert control.settled_mode == ""
    session.on_message(topics.STATE, state("AUTO.LOITER", 6, armed=True), 6.0)
    assert session.snapshot(6.0).control.settled_mode == "AUTO.LOITER"
