"""Another sender shows by what the autopilot says, and not by its silence."""

from __future__ import annotations

import math

import pytest

from ual.geometry import Vector3
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.firmwares.sender_watch import OWN_SILENCE_S, SenderWatch
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.values import LandedState, PositionSetpoint, Sample, Setpoint, VelocitySetpoint

OFFBOARD = 6 << 16
GUIDED, LOITER = 4, 5


def another(now_s: float, said_s: float) -> str:
    """Returns the sign of another sender to a PX4 that got our last setpoint at 1 s, and was in OFFBOARD until
    `said_s`.
    """
    sent = SetpointMonitor()
    watch = SenderWatch(sent, stays_without_setpoints=False)
    armed, landed = Sample(True, said_s), Sample(LandedState.IN_AIR, said_s)
    sent.on_sent(1.0)
    for heard_s in range(1, math.ceil(said_s)):
        watch.another(heard_s, armed, Sample(Px4().mode(OFFBOARD), heard_s), landed)
    return watch.another(now_s, armed, Sample(Px4().mode(OFFBOARD), said_s), landed)


def test_an_autopilot_that_is_not_received_shows_no_other_sender() -> None:
    assert another(now_s=60.0, said_s=1.5) == ""


def test_an_autopilot_that_stays_in_its_mode_without_our_setpoints_gets_those_of_others() -> None:
    assert another(now_s=1.2 + OWN_SILENCE_S, said_s=1.1 + OWN_SILENCE_S).startswith("another program sends setpoints")


def repeated(goes_on_s: float, target_m: float) -> str:
    """Returns the sign of another sender to an ArduPilot that was heard until 5 s, and from 17 s on for `goes_on_s`.

    We sent positions until 6 s, and send again from 18 s on. The autopilot tells an old target, and from 17.5 s on one
    that is `target_m` away.
    """
    sent = SetpointMonitor()
    watch = SenderWatch(sent, stays_without_setpoints=True)
    found = ""
    for tick in range(round((17.0 + goes_on_s) * 10)):
        now_s = tick / 10
        if now_s < 6.0 or now_s >= 18.0:
            sent.on_sent(now_s, PositionSetpoint(Vector3(min(6.0, now_s), 0.0, 3.0), 0.0))
        is_heard = now_s < 5.0 or now_s >= 17.0
        if is_heard:
            heard_s = now_s
            place = Vector3(now_s, 0.0, 3.0) if now_s < 5.0 else Vector3(0.0 if now_s < 17.5 else target_m, 0.0, 3.0)
            watch.on_target(place, Vector3(), now_s, has_position=True)
        mode = Sample(ArduCopter().mode(GUIDED), heard_s)
        found = found or watch.another(now_s, Sample(True, heard_s), mode, Sample(LandedState.IN_AIR, heard_s))
    return found


def test_our_own_setpoints_that_a_link_tells_late_are_nobody_elses() -> None:
    assert repeated(goes_on_s=3.5, target_m=6.0) == ""


def test_another_sender_is_named_once_what_a_silence_left_behind_is_past() -> None:
    assert repeated(goes_on_s=OWN_SILENCE_S + 2.0, target_m=60.0).startswith("another program sends setpoints")


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


NORTH, EAST = Vector3(0.0, 2.0, 0.0), Vector3(2.0, 0.0, 0.0)
HERE, BESIDE = Vector3(0.0, 0.0, 5.0), Vector3(2.0, 0.0, 5.0)


class Streamed:
    """An autopilot in GUIDED that gets a setpoint of ours each 20 ms, and tells a target each 30 ms."""

    def __init__(self) -> None:
        self.sent = SetpointMonitor()
        self.watch = SenderWatch(self.sent, stays_without_setpoints=True)
        self.now_s, self.mode_s, self.found = 0.0, 0.0, ""

    def fly(self, duration_s: float, ours: Setpoint | None, target: Setpoint, *, is_mode_told: bool = True) -> str:
        """`ours` is sent, unless it is None, while the autopilot tells `target`. Returns what shows another sender."""
        for _ in range(round(duration_s / 0.01)):
            self.now_s += 0.01
            tick = round(self.now_s / 0.01)
            if ours is not None and tick % 2 == 0:
                self.sent.on_sent(self.now_s, ours)
            if tick % 3 == 0:
                has_position = isinstance(target, PositionSetpoint)
                position = target.position if isinstance(target, PositionSetpoint) else Vector3(math.nan)
                self.watch.on_target(position, target.velocity, self.now_s, has_position=has_position)
            if is_mode_told and tick % 10 == 0:
                self.mode_s = self.now_s
            self.found = self.another(GUIDED)
        return self.found

    def another(self, mode: int) -> str:
        armed, landed = Sample(True, self.now_s), Sample(LandedState.IN_AIR, self.now_s)
        return self.watch.another(self.now_s, armed, Sample(ArduCopter().mode(mode), self.mode_s), landed)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (VelocitySetpoint(NORTH), VelocitySetpoint(EAST)),
        (VelocitySetpoint(NORTH), VelocitySetpoint(Vector3())),
        (VelocitySetpoint(NORTH), PositionSetpoint(HERE, 0.0)),
        (PositionSetpoint(HERE, 0.0), VelocitySetpoint(EAST)),
        (PositionSetpoint(HERE, 0.0), PositionSetpoint(BESIDE, 0.0)),
    ],
)
def test_a_target_that_is_none_of_ours_is_anothers(ours: Setpoint, theirs: Setpoint) -> None:
    flown = Streamed()
    assert flown.fly(5.0, ours, ours) == ""
    assert flown.fly(0.2, ours, theirs).startswith("another program sends setpoints")
    assert flown.fly(OWN_SILENCE_S + 0.5, ours, ours) == ""


def test_a_target_that_a_reset_of_the_estimate_moves_until_our_next_setpoint_is_ours() -> None:
    """A real PX4 on poses from outside that came back: its position was reset by 1.1 m on a busy computer."""
    flown, ours = Streamed(), PositionSetpoint(HERE, 0.0)
    assert flown.fly(5.0, ours, ours) == ""
    assert flown.fly(0.09, None, PositionSetpoint(BESIDE, 0.0)) == ""
    assert flown.fly(1.0, ours, ours) == ""


def test_a_target_from_before_our_first_setpoint_can_have_arrived_is_nobody_elses() -> None:
    """A real ArduCopter over a link of 2.3 s: in GUIDED again it held by itself, at a velocity of 0."""
    flown, ours, own = Streamed(), PositionSetpoint(HERE, 0.0), VelocitySetpoint(Vector3())
    flown.watch.round_trip_s = 2.3
    for tick in range(100):  # it is not known to be in GUIDED again
        flown.sent.on_sent(tick * 0.02, ours)
    flown.now_s = 2.0
    assert flown.fly(2.2, ours, own) == ""
    assert flown.fly(3.0, ours, ours) == ""
    assert flown.fly(0.2, ours, VelocitySetpoint(EAST)).startswith("another program sends setpoints")


def test_a_target_of_the_autopilot_after_a_pilot_has_just_returned_control_is_no_senders() -> None:
    """A real ArduCopter whose pilot left GUIDED for 0.3 s: it held by itself, at a velocity of 0."""
    flown, ours = Streamed(), PositionSetpoint(HERE, 0.0)
    assert flown.fly(5.0, ours, ours) == ""
    assert flown.another(LOITER) == ""
    assert flown.fly(0.4, None, VelocitySetpoint(Vector3())) == ""


def test_a_target_of_a_pilot_who_took_over_unheard_is_no_senders() -> None:
    flown = Streamed()
    flown.fly(5.0, VelocitySetpoint(NORTH), VelocitySetpoint(NORTH))
    assert not flown.watch.wants_mode
    assert flown.fly(0.5, VelocitySetpoint(NORTH), PositionSetpoint(BESIDE, 0.0), is_mode_told=False) == ""
    assert flown.watch.wants_mode
    flown.mode_s = flown.now_s
    assert flown.another(LOITER) == ""
    assert not flown.watch.wants_mode


def test_a_target_of_ours_that_the_autopilot_moves_on_while_the_link_takes_none_is_ours() -> None:
    flown, goes = Streamed(), PositionSetpoint(HERE, 0.0, EAST * 2.5)
    flown.fly(5.0, goes, goes)
    for tick in range(20):  # ours go on, but do not arrive
        went = EAST * 2.5 * (0.1 * tick)
        braking = PositionSetpoint(HERE + EAST * min(0.5, 0.1 * tick), 0.0)
        assert flown.fly(0.1, braking, PositionSetpoint(HERE + went, 0.0, EAST * 2.5)) == ""


def test_a_target_without_position_and_velocity_is_nobodys() -> None:
    flown, nothing = Streamed(), VelocitySetpoint(Vector3(math.nan, math.nan, math.nan))
    flown.fly(5.0, PositionSetpoint(HERE, 0.0), PositionSetpoint(HERE, 0.0))
    assert flown.fly(1.0, PositionSetpoint(HERE, 0.0), nothing) == ""
