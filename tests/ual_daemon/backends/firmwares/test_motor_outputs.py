"""Whether motors stand, by what an ArduCopter puts out to them."""

from __future__ import annotations

import pytest

from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.cause_watch import TEXT_AHEAD_S, CauseWatch
from ual_daemon.backends.firmwares.motor_outputs import MotorChannels, MotorOutputs
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.values import Cause, LandedState, Sample

STAND, IDLE, TURN = [1000] * 4 + [0] * 4, [1100] * 4 + [0] * 4, [1430, 1390, 1150, 1600] + [0] * 4
QUAD = {"MOT_PWM_MIN": 1000.0, **{f"SERVO{number}_FUNCTION": 32.0 + number for number in range(1, 5)}}
ON_AUX = {"MOT_PWM_MIN": 1100.0, "SERVO1_FUNCTION": 0.0, "SERVO9_FUNCTION": 33.0, "SERVO10_FUNCTION": 34.0}
GUIDED, STATES = ArduCopter().mode_named("GUIDED"), [LandedState.IN_AIR, LandedState.LANDING, LandedState.TAKING_OFF]


class Watch:
    """The causes of an ArduCopter, whose outputs come four times a second."""

    def __init__(self, parameters: dict[str, float] = QUAD, landed: LandedState = LandedState.IN_AIR) -> None:
        self.causes = CauseWatch(ArduCopter(), SetpointMonitor(), names_intended_mode=False)
        self.parameters, self.landed, self.is_armed = parameters, landed, True
        self.now_s = 0.0

    def hear(self, pulses: list[int], count: int = 2) -> Cause | None:
        for _ in range(count):
            self.now_s += 0.25
            armed, landed = Sample(self.is_armed, self.now_s), Sample(self.landed, self.now_s)
            self.causes.on_outputs(pulses, self.parameters, armed, landed, self.now_s)
        return self.failsafe

    @property
    def failsafe(self) -> Cause | None:
        armed, mode = Sample(True, self.now_s), Sample(GUIDED, self.now_s)
        return self.causes.control_state(armed, Sample(self.landed, self.now_s), mode, "", self.now_s).failsafe


@pytest.mark.parametrize("landed", STATES)
def test_motors_that_stand_in_the_air_are_stopped(landed: LandedState) -> None:
    watch = Watch(landed=landed)
    assert watch.hear(TURN) is None
    assert watch.hear(STAND, 1) is None  # one report may be of the moment in which they are let run
    assert watch.hear(STAND, 1) is Cause.TERMINATION
    assert watch.hear(TURN, 1) is None


@pytest.mark.parametrize("landed", [LandedState.ON_GROUND, LandedState.UNKNOWN])
def test_on_the_ground_motors_stand_by_themselves(landed: LandedState) -> None:
    assert Watch(landed=landed).hear(STAND, 5) is None


@pytest.mark.parametrize(
    ("parameters", "pulses", "expected"),
    [
        (QUAD, IDLE, None),
        (QUAD, [1000, 1000, 1000, 1150], None),
        (QUAD, [1000, 1000, 1000, 1005, 1900], Cause.TERMINATION),  # the fifth output is a servo
        (ON_AUX, [1900] * 8 + [1100, 1100], Cause.TERMINATION),
        (ON_AUX, [1100] * 8 + [1300, 1100], None),
        (ON_AUX, [1000] * 8, None),  # fewer outputs than that
        ({}, STAND, Cause.TERMINATION),  # its parameters were not read yet: as by its defaults
        ({}, [1100] * 4, None),
        ({}, [1000, 1000, 0, 0], None),
        ({**QUAD, "MOT_PWM_MIN": 0.0}, STAND, None),  # then by the transmitter's calibration
    ],
)
def test_only_the_motors_count_and_where_they_stand(
    parameters: dict[str, float], pulses: list[int], expected: Cause | None
) -> None:
    assert Watch(parameters).hear(pulses, 3) is expected


@pytest.mark.parametrize(("is_armed", "landed"), [(False, LandedState.IN_AIR), (True, LandedState.ON_GROUND)])
def test_reports_from_before_the_take_off_say_nothing_of_it(*, is_armed: bool, landed: LandedState) -> None:
    """After a pause of this computer it was armed and in the air, and the newest reports were from the ground."""
    watch = Watch(landed=landed)
    watch.is_armed = is_armed
    watch.hear(STAND, 5)
    watch.is_armed, watch.landed = True, LandedState.TAKING_OFF
    watch.now_s += 0.3
    assert watch.failsafe is None
    assert watch.hear(STAND, 1) is None


def test_a_text_that_was_lost_is_reported_by_the_outputs_that_come_after_it() -> None:
    watch = Watch()
    watch.causes.on_text("RC7: MotorEStop HIGH", watch.now_s)
    assert watch.failsafe is Cause.TERMINATION
    assert watch.hear(TURN, 1) is Cause.TERMINATION  # it may be from before
    watch.now_s += TEXT_AHEAD_S
    assert watch.hear(TURN, 1) is None
    watch.causes.on_text("RC7: MotorEStop LOW", watch.now_s)
    assert watch.hear(STAND) is Cause.TERMINATION


def test_what_was_received_long_ago_says_nothing() -> None:
    motors, quad = MotorOutputs(), MotorChannels(frozenset({0}), 1000.0)
    motors.on_pulses([1000], quad, 0.0)
    assert motors.stand(0.1) is None
    motors.on_pulses([1000], quad, 0.25)
    assert motors.stand(0.3) is True
    assert motors.stand(5.0) is None
    motors.on_pulses([1000], quad, 5.0)  # they may have turned meanwhile
    assert motors.stand(5.0) is None
    motors.on_pulses([1200], quad, 5.5)
    assert motors.stand(5.6) is False
