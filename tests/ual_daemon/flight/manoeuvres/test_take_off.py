"""Take-off, with autopilots that climb by setpoints and by themselves."""

from __future__ import annotations

from concurrent.futures import Future

import pytest

from tests.snapshots import changed
from tests.ual_daemon.flight.hand_made import HEIGHT_M, Autopilot, sent
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalError, UalTimeoutError
from ual.geometry import Quaternion, Vector3
from ual.types import Limits, TaskKind
from ual_daemon.backends.values import (
    Control,
    Freshness,
    LandedState,
    Mode,
    PositionSetpoint,
    Sample,
    Snapshot,
)
from ual_daemon.flight.manoeuvres.manoeuvre import Step
from ual_daemon.flight.manoeuvres.take_off import TakeOffManoeuvre
from ual_daemon.flight.state import Estimate, estimate
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.references import Hold


def take_off(autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool) -> TakeOffManoeuvre:
    return TakeOffManoeuvre(
        autopilot.task(TaskKind.TAKE_OFF),
        sent(ack, autopilot),
        autopilot.snapshot(),
        HEIGHT_M,
        Limits(),
        ToleranceSettings(),
        on_setpoints=on_setpoints,
    )


def test_an_autopilot_that_climbs_by_itself_gets_no_setpoint_until_it_is_up(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    ack.set_result(None)
    autopilot.control = Control.REFERENCES
    assert autopilot.step(climb).setpoint is None
    autopilot.landed, autopilot.climb_m_s = LandedState.TAKING_OFF, 1.0
    while autopilot.z < HEIGHT_M + 0.2:
        assert autopilot.step(climb) == Step()
    autopilot.climb_m_s = 0.0
    for _ in range(20):  # it is up, but takes no references before it reports that
        assert autopilot.step(climb) == Step()
    autopilot.landed = LandedState.IN_AIR
    step = Step()
    while not step.has_ended:
        step = autopilot.step(climb)
    assert step.error is None
    assert isinstance(step.next_reference, Hold)
    assert step.next_reference.motion(autopilot.snapshot()).position.z == pytest.approx(HEIGHT_M + 0.2)


@pytest.mark.parametrize("off_m", [-0.7, 0.7])
def test_an_autopilot_that_counts_heights_from_elsewhere_gets_references_to_the_height_once_it_is_up(
    autopilot: Autopilot, ack: Future[None], off_m: float
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    ack.set_result(None)
    autopilot.control, autopilot.landed = Control.REFERENCES, LandedState.TAKING_OFF
    autopilot.z = HEIGHT_M + 0.2 + off_m
    assert autopilot.step(climb) == Step()
    autopilot.landed = LandedState.IN_AIR
    step = autopilot.step(climb)
    while not step.has_ended:
        assert isinstance(step.setpoint, PositionSetpoint)
        autopilot.z = step.setpoint.position.z
        step = autopilot.step(climb)
    assert step.error is None
    assert autopilot.z == pytest.approx(HEIGHT_M + 0.2, abs=0.2)


def test_setpoints_stay_on_the_ground_until_the_mode_has_changed_and_then_climb(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=True)
    ground = PositionSetpoint(Vector3(1.0, 2.0, 0.2), Quaternion.from_yaw(0.5).yaw_rad)
    for _ in range(5):
        assert autopilot.step(climb).setpoint == ground
    ack.set_result(None)
    assert autopilot.step(climb).setpoint == ground  # PX4 acknowledges before it changes the mode: the mode counts
    autopilot.control = Control.REFERENCES
    heights = []
    for _ in range(40):
        setpoint = autopilot.step(climb).setpoint
        assert isinstance(setpoint, PositionSetpoint)
        heights.append(setpoint.position.z)
        autopilot.z = setpoint.position.z
    assert heights == sorted(heights)
    assert heights[-1] > 2.0


def test_a_low_climb_is_not_up_while_it_stands_on_the_ground(autopilot: Autopilot, ack: Future[None]) -> None:
    climb = TakeOffManoeuvre(
        autopilot.task(TaskKind.TAKE_OFF),
        sent(ack, autopilot),
        autopilot.snapshot(),
        0.1,
        Limits(),
        ToleranceSettings(),
        on_setpoints=False,
    )
    ack.set_result(None)
    autopilot.control = Control.REFERENCES
    for _ in range(30):
        assert not autopilot.step(climb).has_ended
    autopilot.landed = LandedState.IN_AIR
    assert autopilot.until_end(climb, 1.0) is None


def test_the_mode_alone_begins_the_climb_if_the_acknowledgement_is_lost(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    autopilot.control = Control.TAKE_OFF
    for _ in range(15):
        autopilot.step(climb)
    autopilot.control = Control.OTHER
    error = autopilot.step(climb).error
    assert isinstance(error, TaskAbortedError)  # the climb had begun, so the pilot took over
    assert error.metadata["by"] == "safety pilot"


@pytest.mark.parametrize("on_setpoints", [False, True])
def test_a_mode_change_by_the_pilot_before_the_command_is_answered_ends_the_take_off(
    autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    assert not autopilot.step(climb).has_ended  # not in its mode yet
    autopilot.control = Control.REFERENCES
    assert not autopilot.step(climb).has_ended
    autopilot.control = Control.OTHER
    error = autopilot.step(climb).error
    assert isinstance(error, TaskAbortedError)
    assert error.metadata["by"] == "safety pilot"
    climb.end(error)
    assert ack.cancelled()  # it is not sent again


def lifted(autopilot: Autopilot, mode: Mode, told_s: float) -> tuple[Snapshot, Estimate]:
    """In the air, as far as it was told; its mode was told some time ago."""
    autopilot.landed = LandedState.IN_AIR
    snapshot = changed(autopilot.snapshot(), mode=Sample(mode, told_s))
    return snapshot, estimate(snapshot, Freshness(mode_s=5.0))


def test_on_a_bad_link_the_air_may_be_known_before_the_mode(autopilot: Autopilot, ack: Future[None]) -> None:
    """As simulated with a loss of 37 %: PX4 is in OFFBOARD, and lifts off, 0.9 s before that mode is heard."""
    loiter = Mode("AUTO.LOITER", Control.OTHER, is_autonomous=True)
    autopilot.mode = loiter.name
    climb = take_off(autopilot, ack, on_setpoints=True)
    told_s = autopilot.time_s
    for _ in range(9):
        autopilot.time_s += 0.1
        step = climb.step(*lifted(autopilot, loiter, told_s))
        assert not step.has_ended
        assert isinstance(step.setpoint, PositionSetpoint)  # OFFBOARD would end without
    autopilot.control, autopilot.mode = Control.REFERENCES, "OFFBOARD"
    ack.set_result(None)
    assert not autopilot.step(climb).has_ended


@pytest.mark.parametrize(
    ("mode", "is_told_again", "on_setpoints", "passed_s"),
    [
        ("AUTO.LOITER", True, True, 0.2),  # it was told in the air, and is not ours
        ("AUTO.LOITER", False, True, 2.0),  # for too long
        ("POSCTL", False, True, 0.1),  # a pilot can lift off in it
        ("AUTO.LOITER", False, False, 0.1),
    ],
)
def test_what_lifts_off_in_another_mode_is_controlled_by_others(
    autopilot: Autopilot, ack: Future[None], mode: str, passed_s: float, *, is_told_again: bool, on_setpoints: bool
) -> None:
    made = Mode(mode, Control.OTHER, is_autonomous=mode.startswith("AUTO"))
    autopilot.mode = mode
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    told_s, begun_s = autopilot.time_s, autopilot.time_s + 0.1
    step = Step()
    while not step.has_ended:
        autopilot.time_s += 0.1
        assert autopilot.time_s < begun_s + passed_s + 0.05
        step = climb.step(*lifted(autopilot, made, autopilot.time_s - 0.05 if is_told_again else told_s))
    assert isinstance(step.error, TaskAbortedError)
    assert step.is_taken


@pytest.mark.parametrize("on_setpoints", [False, True])
def test_another_mode_than_at_the_start_ends_the_take_off_before_the_command_is_sent_again(
    autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool
) -> None:
    autopilot.mode = "POSCTL"
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    assert not autopilot.step(climb).has_ended
    autopilot.mode = "STABILIZED"
    step = autopilot.step(climb)
    assert isinstance(step.error, TaskAbortedError)
    assert step.error.metadata["mode"] == "STABILIZED"
    assert step.is_taken
    climb.end(step.error)
    assert ack.cancelled()


def test_the_mode_that_was_left_to_arm_may_be_known_after_the_take_off_has_begun(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    """PX4 says at once that it is armed, by an event, and its mode in a heartbeat that comes later."""
    before = changed(autopilot.snapshot(), mode=Sample(Mode("AUTO.LAND", Control.LAND), autopilot.time_s - 0.5))
    climb = TakeOffManoeuvre(
        autopilot.task(TaskKind.TAKE_OFF),
        sent(ack, autopilot),
        before,
        HEIGHT_M,
        Limits(),
        ToleranceSettings(),
        on_setpoints=True,
    )
    autopilot.mode = "AUTO.LOITER"
    assert not autopilot.step(climb).has_ended
    autopilot.mode = "POSCTL"
    assert isinstance(autopilot.step(climb).error, TaskAbortedError)


def test_an_offboard_that_was_left_over_may_end_before_it_begins_again(autopilot: Autopilot, ack: Future[None]) -> None:
    """PX4 leaves it by itself just as the setpoints begin, because none came until then."""
    autopilot.control = Control.REFERENCES
    climb = take_off(autopilot, ack, on_setpoints=True)
    assert not autopilot.step(climb).has_ended
    autopilot.control = Control.OTHER
    assert not autopilot.step(climb).has_ended
    autopilot.control = Control.REFERENCES
    assert not autopilot.step(climb).has_ended
    autopilot.control = Control.OTHER  # this time the pilot took over
    assert isinstance(autopilot.step(climb).error, TaskAbortedError)


@pytest.mark.parametrize("on_setpoints", [False, True])
def test_a_lift_off_by_the_pilot_before_the_mode_changes_ends_the_take_off(
    autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    for _ in range(5):  # in the pilot's mode, on the ground
        assert not autopilot.step(climb).has_ended
    autopilot.landed, autopilot.z = LandedState.IN_AIR, 0.5
    step = autopilot.step(climb)
    assert step.setpoint is None
    assert isinstance(step.error, TaskAbortedError)
    assert step.error.metadata["by"] == "safety pilot"
    climb.end(step.error)
    assert ack.cancelled()


@pytest.mark.parametrize(
    ("what", "kind"),
    [
        ({"armed": False}, TaskAbortedError),
        ({"silent_s": 10.0}, LinkLostError),
    ],
)
def test_a_take_off_ends_when_it_cannot_go_on(
    autopilot: Autopilot, ack: Future[None], what: dict[str, object], kind: type[UalError]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=True)
    autopilot.step(climb)
    for name, value in what.items():
        setattr(autopilot, name, value)
    assert isinstance(autopilot.step(climb).error, kind)


def test_a_climb_that_does_not_get_there_times_out_and_names_the_height(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    ack.set_result(None)
    autopilot.control, autopilot.z = Control.REFERENCES, 1.2
    error = autopilot.until_end(climb)
    assert isinstance(error, UalTimeoutError)
    assert "at 1.00 m" in error.message


@pytest.mark.parametrize("on_setpoints", [False, True])
def test_a_climb_that_goes_higher_than_commanded_is_stopped_by_the_autopilot_itself(
    autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    ack.set_result(None)
    autopilot.control, autopilot.landed, autopilot.climb_m_s = Control.REFERENCES, LandedState.TAKING_OFF, 2.0
    step = Step()
    while not step.has_ended:
        step = autopilot.step(climb)
        assert autopilot.z < 1.2 * HEIGHT_M + 1.0 + 0.2 + 0.3
    assert step.is_autopilot_to_hold
    assert step.setpoint is None
    assert isinstance(step.error, TaskAbortedError)
    assert "above the ground of the take-off, as 4 m were asked for" in str(step.error)
    assert step.error.metadata["by"] == "height"


def test_a_late_refusal_ends_a_take_off_that_is_still_on_the_ground(autopilot: Autopilot, ack: Future[None]) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    autopilot.control = Control.REFERENCES
    for _ in range(15):  # no answer: the mode alone counts
        assert not autopilot.step(climb).has_ended
    refusal = RejectedByAutopilotError("refused to take off")
    ack.set_exception(refusal)
    error = autopilot.step(climb).error
    assert isinstance(error, RejectedByAutopilotError)
    assert str(error).startswith(str(refusal))


@pytest.mark.parametrize("on_setpoints", [False, True])
@pytest.mark.parametrize("climbs_s", [0.0, 2.0, 6.0])
def test_a_take_off_that_is_stuck_ends_within_10_s_and_says_what_can_be_done(
    autopilot: Autopilot, ack: Future[None], climbs_s: float, *, on_setpoints: bool
) -> None:
    """It does not begin later, when nobody expects it: the autopilot is to land, or to hold higher up."""
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    ack.set_result(None)
    autopilot.control, autopilot.climb_m_s = Control.REFERENCES, 0.5
    for _ in range(round(climbs_s * 10)):
        assert not autopilot.step(climb).has_ended
    autopilot.climb_m_s = 0.0
    stuck_s, step = autopilot.time_s, Step()
    while not step.has_ended:
        step = autopilot.step(climb)
    assert 7.0 < autopilot.time_s - stuck_s < 10.0  # it takes up to 6 s to lift off
    assert isinstance(step.error, UalTimeoutError)
    assert "it has not climbed for 8 s" in str(step.error)
    assert "safety pilot disarm it" in str(step.error)
    assert step.error.metadata["by"] == "no way"
    assert step.is_autopilot_to_hold
    assert step.is_autopilot_to_land is (climbs_s < 4.0)
    assert ("land on the spot" in str(step.error)) is step.is_autopilot_to_land


@pytest.mark.parametrize("on_setpoints", [True, False])
def test_a_height_that_wanders_on_the_ground_is_no_climb(
    autopilot: Autopilot, ack: Future[None], *, on_setpoints: bool
) -> None:
    climb = take_off(autopilot, ack, on_setpoints=on_setpoints)
    ack.set_result(None)
    autopilot.control, autopilot.climb_m_s = Control.REFERENCES, 0.14
    begun_s, step = autopilot.time_s, Step()
    while not step.has_ended:
        if autopilot.time_s - begun_s > 6.0:
            autopilot.climb_m_s = 0.0
        step = autopilot.step(climb)
    assert isinstance(step.error, UalTimeoutError)
    assert step.error.metadata["by"] == "no way"
    assert step.is_autopilot_to_hold
    assert autopilot.time_s - begun_s < 9.0


def test_a_climb_that_is_slow_by_its_limit_is_not_stuck(autopilot: Autopilot, ack: Future[None]) -> None:
    slow = Limits(climb_speed_m_s=0.02)
    command, start = sent(ack, autopilot), autopilot.snapshot()
    task, tolerance = autopilot.task(TaskKind.TAKE_OFF), ToleranceSettings()
    climb = TakeOffManoeuvre(task, command, start, HEIGHT_M, slow, tolerance, on_setpoints=True)
    ack.set_result(None)
    autopilot.control, autopilot.climb_m_s = Control.REFERENCES, 0.02
    while autopilot.z < HEIGHT_M:
        assert not autopilot.step(climb).has_ended


def test_a_take_off_that_is_refused_says_what_can_be_done(autopilot: Autopilot, ack: Future[None]) -> None:
    climb = take_off(autopilot, ack, on_setpoints=False)
    ack.set_exception(RejectedByAutopilotError("refused to take off: FAILED"))
    error = autopilot.step(climb).error
    assert isinstance(error, RejectedByAutopilotError)
    assert "stays on the ground: disarm it" in str(error)
