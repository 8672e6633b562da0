"""Another sender shows by what the autopilot says, and not by its silence."""

from __future__ import annotations

from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.firmwares.sender_watch import QUIET_S, SenderWatch
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.values import LandedState, Sample

OFFBOARD = 6 << 16


def another(now_s: float, said_s: float) -> str:
    """What shows another sender to a PX4 that got our last setpoint at 1 s, and last said that it is in OFFBOARD."""
    sent = SetpointMonitor()
    watch = SenderWatch(sent, stays_without_setpoints=False)
    armed, landed = Sample(True, said_s), Sample(LandedState.IN_AIR, said_s)
    sent.on_sent(1.0)
    watch.another(1.0, armed, Sample(Px4().mode(OFFBOARD), 1.0), landed)
    return watch.another(now_s, armed, Sample(Px4().mode(OFFBOARD), said_s), landed)


def test_an_autopilot_that_is_not_heard_shows_no_other_sender() -> None:
    assert another(now_s=60.0, said_s=1.5) == ""


def test_an_autopilot_that_stays_in_its_mode_without_our_setpoints_gets_those_of_others() -> None:
    assert another(now_s=1.2 + QUIET_S, said_s=1.1 + QUIET_S).startswith("another program sends setpoints")
