"""Another sender shows by what the autopilot says, and not by its silence."""

from __future__ import annotations

import math

from ual.geometry import Vector3
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.firmwares.sender_watch import QUIET_S, SenderWatch
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.values import LandedState, Sample

OFFBOARD = 6 << 16
GUIDED = 4


def another(now_s: float, said_s: float) -> str:
    """What shows another sender to a PX4 that got our last setpoint at 1 s, and was in OFFBOARD until `said_s`."""
    sent = SetpointMonitor()
    watch = SenderWatch(sent, stays_without_setpoints=False)
    armed, landed = Sample(True, said_s), Sample(LandedState.IN_AIR, said_s)
    sent.on_sent(1.0)
    for heard_s in range(1, math.ceil(said_s)):
        watch.another(heard_s, armed, Sample(Px4().mode(OFFBOARD), heard_s), landed)
    return watch.another(now_s, armed, Sample(Px4().mode(OFFBOARD), said_s), landed)


def test_an_autopilot_that_is_not_heard_shows_no_other_sender() -> None:
    assert another(now_s=60.0, said_s=1.5) == ""


def test_an_autopilot_that_stays_in_its_mode_without_our_setpoints_gets_those_of_others() -> None:
    assert another(now_s=1.2 + QUIET_S, said_s=1.1 + QUIET_S).startswith("another program sends setpoints")


def flown_again(goes_on_s: float, target_m: float) -> str:
    """What shows another sender to an ArduPilot that was heard until 5 s, and from 17 s on for `goes_on_s`.

    We sent positions until 6 s, and send again from 18 s on. The autopilot tells an old target, and from 17.5 s on one
    that is `target_m` away.
    """
    sent = SetpointMonitor()
    watch = SenderWatch(sent, stays_without_setpoints=True)
    found = ""
    for tick in range(round((17.0 + goes_on_s) * 10)):
        now_s = tick / 10
        if now_s < 6.0 or now_s >= 18.0:
            sent.on_sent(now_s, Vector3(min(6.0, now_s), 0.0, 3.0))
        is_heard = now_s < 5.0 or now_s >= 17.0
        if is_heard:
            heard_s = now_s
            place = Vector3(now_s, 0.0, 3.0) if now_s < 5.0 else Vector3(0.0 if now_s < 17.5 else target_m, 0.0, 3.0)
            watch.on_target(place, Vector3(), now_s, has_position=True)
        mode = Sample(ArduCopter().mode(GUIDED), heard_s)
        found = found or watch.another(now_s, Sample(True, heard_s), mode, Sample(LandedState.IN_AIR, heard_s))
    return found


def test_our_own_setpoints_that_a_link_tells_late_are_nobody_elses() -> None:
    assert flown_again(goes_on_s=3.5, target_m=6.0) == ""


def test_another_sender_is_named_once_what_a_silence_left_behind_is_past() -> None:
    assert flown_again(goes_on_s=QUIET_S + 2.0, target_m=60.0).startswith("another program sends setpoints")


def test_a_mode_that_a_link_tells_late_is_nobody_elses_either() -> None:
    """PX4 was in OFFBOARD by our setpoints, 12 s of which came late."""
    sent = SetpointMonitor()
    watch = SenderWatch(sent, stays_without_setpoints=False)
    mode = Px4().mode(OFFBOARD)
    for now_s, heard_s in ((1.0, 1.0), (2.0, 2.0), (13.0, 2.0), (14.0, 14.0), (15.0, 15.0)):
        if now_s < 3.0:
            sent.on_sent(now_s)
        landed = Sample(LandedState.IN_AIR, heard_s)
        assert watch.another(now_s, Sample(True, heard_s), Sample(mode, heard_s), landed) == ""
