from __future__ import annotations

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.snapshots import changed, value_of
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import State
from ual_daemon.backends.values import (
    NEVER_S,
    Cause,
    Control,
    ControlState,
    EarthReference,
    Estimator,
    Freshness,
    LandedState,
    Mode,
    MotionState,
    Sample,
    Snapshot,
)
from ual_daemon.flight.state import Estimate, estimate, is_surely_auto, noted
from ual_daemon.geodesy import FlatProjection

NOW_S = 100.0
FRESHNESS = Freshness(link_s=1.0, pose_s=2.0, mode_s=3.0, landed_s=4.0, estimator_s=5.0)

HEALTHY = Snapshot(
    time_s=NOW_S,
    heard_s=NOW_S,
    control=ControlState(
        armed=Sample(True, NOW_S),
        landed=Sample(LandedState.IN_AIR, NOW_S),
        mode=Sample(Mode("OFFBOARD", Control.REFERENCES), NOW_S),
    ),
    motion=MotionState(estimator=Sample(Estimator(True), NOW_S), pose=Sample(Pose(), NOW_S)),
)


def snapshot(
    *, armed: bool = True, landed: LandedState | None = LandedState.IN_AIR, control: Control = Control.REFERENCES
) -> Snapshot:
    return changed(
        HEALTHY,
        armed=Sample(armed, NOW_S),
        landed=None if landed is None else Sample(landed, NOW_S),
        mode=Sample(Mode("a mode", control), NOW_S),
    )


def state(given: Snapshot, manoeuvre: State | None = None) -> State:
    return estimate(given, FRESHNESS, manoeuvre).state


def table(armed: bool, landed: LandedState | None, control: Control, manoeuvre: State | None) -> State:
    """Design.md's State section, rules 2 to 7, as a list of (does it apply, state)."""
    rules = [
        (not armed, State.LANDED_DISARMED),
        (landed is LandedState.ON_GROUND, State.LANDED_ARMED),
        (
            manoeuvre is State.TAKING_OFF or landed is LandedState.TAKING_OFF or control is Control.TAKE_OFF,
            State.TAKING_OFF,
        ),
        (manoeuvre is State.LANDING or landed is LandedState.LANDING or control is Control.LAND, State.LANDING),
        (control is Control.REFERENCES, State.FLYING_AUTO),
        (True, State.FLYING_MANUAL),
    ]
    return next(found for applies, found in rules if applies)


@pytest.mark.parametrize("manoeuvre", [None, State.TAKING_OFF, State.LANDING])
@pytest.mark.parametrize("control", Control)
@pytest.mark.parametrize("landed", [None, *LandedState])
@pytest.mark.parametrize("armed", [False, True])
def test_every_combination_is_the_first_rule_that_applies(
    armed: bool, landed: LandedState | None, control: Control, manoeuvre: State | None
) -> None:
    found = state(snapshot(armed=armed, landed=landed, control=control), manoeuvre)
    assert found is table(armed, landed, control, manoeuvre)


IN_AIR, ON_GROUND, UNKNOWN = LandedState.IN_AIR, LandedState.ON_GROUND, LandedState.UNKNOWN
AUTO, PILOT = Control.REFERENCES, Control.OTHER
OUR_TAKE_OFF, OUR_LANDING = State.TAKING_OFF, State.LANDING


@pytest.mark.parametrize(
    ("what_happens", "before", "after", "expected"),
    [
        (
            "the pilot arms",
            (snapshot(armed=False, landed=ON_GROUND, control=PILOT), None),
            (snapshot(landed=ON_GROUND, control=PILOT), None),
            (State.LANDED_DISARMED, State.LANDED_ARMED),
        ),
        (
            "it disarms by itself on the ground",
            (snapshot(landed=ON_GROUND), None),
            (snapshot(armed=False, landed=ON_GROUND), None),
            (State.LANDED_ARMED, State.LANDED_DISARMED),
        ),
        (
            "our take-off leaves the ground",
            (snapshot(landed=ON_GROUND), OUR_TAKE_OFF),
            (snapshot(), OUR_TAKE_OFF),
            (State.LANDED_ARMED, State.TAKING_OFF),
        ),
        (
            "our take-off is up",
            (snapshot(), OUR_TAKE_OFF),
            (snapshot(), None),
            (State.TAKING_OFF, State.FLYING_AUTO),
        ),
        (
            "the autopilot takes off by itself, then loiters",
            (snapshot(landed=LandedState.TAKING_OFF, control=Control.TAKE_OFF), None),
            (snapshot(control=PILOT), None),
            (State.TAKING_OFF, State.FLYING_MANUAL),
        ),
        (
            "the safety pilot takes it",
            (snapshot(control=AUTO), None),
            (snapshot(control=PILOT), None),
            (State.FLYING_AUTO, State.FLYING_MANUAL),
        ),
        (
            "it is recovered",
            (snapshot(control=PILOT), None),
            (snapshot(control=AUTO), None),
            (State.FLYING_MANUAL, State.FLYING_AUTO),
        ),
        (
            "the safety pilot lands it by the autopilot",
            (snapshot(control=PILOT), None),
            (snapshot(control=Control.LAND), None),
            (State.FLYING_MANUAL, State.LANDING),
        ),
        (
            "our landing begins before the mode changes",
            (snapshot(), None),
            (snapshot(), OUR_LANDING),
            (State.FLYING_AUTO, State.LANDING),
        ),
        (
            "it touches down",
            (snapshot(landed=LandedState.LANDING, control=Control.LAND), OUR_LANDING),
            (snapshot(landed=ON_GROUND, control=Control.LAND), OUR_LANDING),
            (State.LANDING, State.LANDED_ARMED),
        ),
        (
            "the safety pilot lands by hand",
            (snapshot(control=PILOT), None),
            (snapshot(landed=ON_GROUND, control=PILOT), None),
            (State.FLYING_MANUAL, State.LANDED_ARMED),
        ),
        (
            "it is disarmed in the air",
            (snapshot(), None),
            (snapshot(armed=False), None),
            (State.FLYING_AUTO, State.LANDED_DISARMED),
        ),
        (
            "the autopilot loses its position in flight",
            (snapshot(), None),
            (changed(HEALTHY, estimator=Sample(Estimator(False, "no GPS"), NOW_S)), None),
            (State.FLYING_AUTO, State.UNINITIALIZED),
        ),
        (
            "the daemon, restarted in flight, hears the autopilot",
            (Snapshot(time_s=NOW_S), None),
            (snapshot(), None),
            (State.UNINITIALIZED, State.FLYING_AUTO),
        ),
    ],
)
def test_transitions(
    what_happens: str,
    before: tuple[Snapshot, State | None],
    after: tuple[Snapshot, State | None],
    expected: tuple[State, State],
) -> None:
    assert (state(*before), state(*after)) == expected, what_happens


def test_an_autopilot_without_a_landed_state_can_fly() -> None:
    assert state(snapshot(landed=None)) is State.FLYING_AUTO
    assert state(snapshot(landed=UNKNOWN)) is State.FLYING_AUTO


@pytest.mark.parametrize(
    ("value", "limit_s", "why"),
    [
        ("heard_s", FRESHNESS.link_s, "nothing heard from the autopilot for"),
        ("armed", FRESHNESS.mode_s, "the autopilot has not said whether it is armed for"),
        ("mode", FRESHNESS.mode_s, "the autopilot has not said its mode for"),
        ("estimator", FRESHNESS.estimator_s, "the autopilot has not said whether its position is good for"),
        ("pose", FRESHNESS.pose_s, "the autopilot has not said its pose for"),
        ("landed", FRESHNESS.landed_s, "the autopilot has not said whether it is landed for"),
    ],
)
def test_a_value_is_used_up_to_its_age_limit(value: str, limit_s: float, why: str) -> None:
    def aged(age_s: float) -> Estimate:
        old = NOW_S - age_s if value == "heard_s" else Sample(value_of(HEALTHY, value).value, NOW_S - age_s)
        return estimate(changed(HEALTHY, **{value: old}), FRESHNESS)

    assert aged(limit_s).state is State.FLYING_AUTO
    too_old = aged(limit_s + 0.2)
    assert too_old.state is State.UNINITIALIZED
    does = "; it is in the air, in mode OFFBOARD" if value in ("estimator", "pose") else ""
    assert too_old.why == f"{why} {limit_s + 0.2:.1f} s{does}"
    assert too_old.is_link_up is (value != "heard_s")


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("heard_s", "nothing heard from the autopilot yet"),
        ("armed", "the autopilot has not said whether it is armed"),
        ("mode", "the autopilot has not said its mode"),
        ("estimator", "the autopilot has not said whether its position is good"),
        ("pose", "the autopilot has not said its pose"),
    ],
)
def test_a_value_that_never_came_makes_the_state_uninitialized(value: str, why: str) -> None:
    found = estimate(changed(HEALTHY, **{value: None}), FRESHNESS)
    does = "; it is in the air, in mode OFFBOARD" if value in ("estimator", "pose") else ""
    assert found == Estimate(State.UNINITIALIZED, f"{why}{does}", is_link_up=value != "heard_s")


def test_what_is_wrong_with_the_link_ends_the_reason_while_nothing_is_received() -> None:
    trouble = "/dev/ttyACM0 is gone (unplugged?); opening it anew"
    silent = changed(HEALTHY, trouble=trouble, heard_s=None)
    assert estimate(silent, FRESHNESS).why == f"nothing heard from the autopilot yet; {trouble}"
    lost = changed(HEALTHY, trouble=trouble, heard_s=NOW_S - 60.0)
    assert estimate(lost, FRESHNESS).why == f"nothing heard from the autopilot for 60.0 s; {trouble}"
    assert trouble not in estimate(changed(HEALTHY, trouble=trouble), FRESHNESS).why


def test_what_the_autopilot_refused_to_send_ends_the_reason_while_it_is_missing() -> None:
    refused = "EXTENDED_SYS_STATE (UNSUPPORTED)"
    found = estimate(changed(HEALTHY, refused=refused, landed=Sample(LandedState.UNKNOWN, NEVER_S)), FRESHNESS)
    assert found.why == f"the autopilot has not said whether it is landed; it refused to send {refused}"
    assert refused not in estimate(changed(HEALTHY, refused=refused), FRESHNESS).why


def test_a_value_that_has_not_come_yet_makes_the_state_uninitialized() -> None:
    found = estimate(changed(HEALTHY, landed=Sample(LandedState.UNKNOWN, NEVER_S)), FRESHNESS)
    assert found == Estimate(State.UNINITIALIZED, "the autopilot has not said whether it is landed")


def test_a_position_that_the_autopilot_does_not_trust_makes_the_state_uninitialized_and_says_why() -> None:
    found = estimate(changed(HEALTHY, estimator=Sample(Estimator(False, "no GPS"), NOW_S)), FRESHNESS)
    why = "the autopilot has no good position: no GPS; it is in the air, in mode OFFBOARD"
    assert found == Estimate(State.UNINITIALIZED, why)


@pytest.mark.parametrize(
    ("given_snapshot", "manoeuvre", "why"),
    [
        (snapshot(armed=False), None, "not armed"),
        (snapshot(landed=ON_GROUND), None, "armed, on the ground"),
        (snapshot(), OUR_TAKE_OFF, "our take-off is under way"),
        (snapshot(control=Control.TAKE_OFF), None, "the autopilot takes off (mode a mode)"),
        (snapshot(), OUR_LANDING, "our landing is under way"),
        (snapshot(control=Control.LAND), None, "the autopilot lands (mode a mode)"),
        (
            changed(snapshot(landed=LandedState.LANDING), held_by=Cause.FENCE),
            None,
            "the autopilot lands; its mode was still a mode when it was told last",
        ),
        (
            changed(
                snapshot(landed=LandedState.LANDING),
                mode=Sample(Mode("RTL", PILOT, is_autonomous=True), NOW_S),
                held_by=Cause.FENCE,
            ),
            None,
            "the autopilot lands (mode RTL): fence",
        ),
        (snapshot(), None, "in the air, the autopilot takes our references (mode a mode)"),
        (snapshot(control=PILOT), None, "in the air, mode a mode does not take our references"),
    ],
)
def test_each_state_says_why_it_is_that_state(given_snapshot: Snapshot, manoeuvre: State | None, why: str) -> None:
    assert estimate(given_snapshot, FRESHNESS, manoeuvre).why == why


@pytest.mark.parametrize(
    ("held_by", "why"),
    [
        (None, "the autopilot flies our mission: item 5 of 5, and lands (mode RTL)"),
        (Cause.GROUND_STATION, "the autopilot flies our mission: item 5 of 5, and lands (mode RTL)"),
        (Cause.BATTERY, "the autopilot lands (mode RTL): battery failsafe"),
    ],
)
def test_the_landing_of_our_mission_is_reported_as_ours_but_not_that_of_a_failsafe(
    held_by: Cause | None, why: str
) -> None:
    """PX4 returns in a mode of its own, which without a mission is a ground station's."""
    mode = Sample(Mode("RTL", PILOT, is_autonomous=True), NOW_S)
    given_snapshot = changed(snapshot(landed=LandedState.LANDING), mode=mode, held_by=held_by)
    mission = "the autopilot flies our mission: item 5 of 5"
    assert estimate(given_snapshot, FRESHNESS, mission=mission) == Estimate(State.LANDING, why)


TIMES = st.floats(-1e9, 1e9)


def samples(values: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    return st.none() | st.builds(Sample, values, TIMES | st.just(NOW_S))


SNAPSHOTS = st.builds(
    lambda time_s, heard_s, **values: changed(Snapshot(time_s, heard_s), **values),
    time_s=TIMES | st.just(NOW_S),
    heard_s=st.none() | TIMES | st.just(NOW_S),
    armed=samples(st.booleans()),
    landed=samples(st.sampled_from(LandedState)),
    mode=samples(st.builds(Mode, st.text(max_size=5), st.sampled_from(Control))),
    estimator=samples(st.builds(Estimator, st.booleans(), st.text(max_size=5))),
    pose=samples(st.just(Pose())),
)
FRESHNESSES = st.builds(Freshness, *[st.floats(0.0, 1e3) | st.just(math.inf)] * 5)
MANOEUVRES = st.sampled_from([None, State.TAKING_OFF, State.LANDING])


@given(SNAPSHOTS, FRESHNESSES, MANOEUVRES)
def test_any_snapshot_has_a_state_a_reason_and_always_the_same(
    given_snapshot: Snapshot, freshness: Freshness, manoeuvre: State | None
) -> None:
    found = estimate(given_snapshot, freshness, manoeuvre)
    assert found.why
    assert found == estimate(given_snapshot, freshness, manoeuvre)
    assert found.is_link_up or found.state is State.UNINITIALIZED


@given(SNAPSHOTS, FRESHNESSES, MANOEUVRES)
def test_old_data_never_decides(given_snapshot: Snapshot, freshness: Freshness, manoeuvre: State | None) -> None:
    control, motion = given_snapshot.control, given_snapshot.motion
    limits = (
        (control, "armed", freshness.mode_s),
        (control, "mode", freshness.mode_s),
        (motion, "estimator", freshness.estimator_s),
        (motion, "pose", freshness.pose_s),
    )
    is_usable = all(
        (sample := getattr(group, name)) is not None and given_snapshot.time_s - sample.time_s <= limit_s
        for group, name, limit_s in limits
    )
    is_heard = given_snapshot.heard_s is not None and given_snapshot.time_s - given_snapshot.heard_s <= freshness.link_s
    found = estimate(given_snapshot, freshness, manoeuvre).state
    if not (is_usable and is_heard):
        assert found is State.UNINITIALIZED
    elif found is not State.UNINITIALIZED:
        assert control.armed is not None
        assert control.mode is not None
        landed = None if control.landed is None else control.landed.value
        assert found is table(control.armed.value, landed, control.mode.value.control, manoeuvre)


def test_a_snapshot_at_another_time_is_otherwise_the_same() -> None:
    numbers = Snapshot(*range(len(dataclasses.fields(Snapshot))))
    assert numbers.at(99.0) == numbers._replace(time_s=99.0)


LOST = Sample(Estimator(False, "no horizontal position"), NOW_S)
NO_POSITION = "the autopilot has no good position: no horizontal position"


@pytest.mark.parametrize(
    ("values", "does"),
    [
        ({}, "; it is in the air, in mode OFFBOARD"),
        (
            {"mode": Sample(Mode("LAND", Control.LAND), NOW_S), "held_by": Cause.POSITION},
            "; the autopilot lands (mode LAND): position failsafe",
        ),
        (
            {"mode": Sample(Mode("ALTCTL", PILOT), NOW_S), "held_by": Cause.POSITION},
            "; it is in the air, in mode ALTCTL: position failsafe",
        ),
        ({"armed": Sample(False, NOW_S)}, ""),
        ({"landed": Sample(ON_GROUND, NOW_S)}, ""),
        ({"mode": Sample(Mode("LAND", Control.LAND), NOW_S - FRESHNESS.mode_s - 1.0)}, None),
    ],
    ids=["takes references", "lands", "holds", "disarmed", "on the ground", "its mode is old"],
)
def test_without_a_position_the_reason_says_what_the_autopilot_does_in_the_air(
    values: dict[str, object], does: str | None
) -> None:
    found = estimate(changed(HEALTHY, estimator=LOST, **values), FRESHNESS)
    assert found.state is State.UNINITIALIZED
    assert found.why == (
        f"{NO_POSITION}{does}" if does is not None else "the autopilot has not said its mode for 4.0 s"
    )


# --- In few steps -----------------------------------------------------------------------------------------------------


AGED = st.sampled_from((0.0, 0.9, 1.0, 1.0 + 2**-40, 1.1, 1.9, 2.0, 2.1, 2.9, 3.0, 3.1, 3.9, 4.0, 4.1, 4.9, 5.0, 5.1))


def aged(values: st.SearchStrategy[object]) -> st.SearchStrategy[object]:
    """Samples of about any age limit, in most cases good ones."""
    return st.none() | st.builds(lambda value, age_s: Sample(value, NOW_S - age_s), values, AGED)


def often(value: object, *others: object) -> st.SearchStrategy[object]:
    return st.sampled_from((value,) * 6 + others)


NEARLY_AUTO = st.builds(
    lambda time_s, heard, **values: changed(Snapshot(time_s, None if heard is None else NOW_S - heard), **values),
    time_s=st.floats(NOW_S - 2.0, NOW_S),
    heard=st.none() | AGED,
    armed=aged(often(True, False)),
    landed=aged(often(*LandedState)) | aged(st.just(IN_AIR)),
    mode=aged(often(Mode("OFFBOARD", AUTO), *(Mode("a mode", control) for control in Control))),
    estimator=aged(often(Estimator(True), Estimator(False, "no GPS"))),
    pose=aged(st.just(Pose())),
    conflict=often("", "two vehicles"),
)


@given(st.one_of(SNAPSHOTS, NEARLY_AUTO), st.sampled_from(("", "; another sends")))
def test_a_note_is_added_to_what_the_data_alone_show(given_snapshot: Snapshot, note: str) -> None:
    found = estimate(given_snapshot, FRESHNESS)
    assert noted(found, note) == estimate(given_snapshot, FRESHNESS, None, note)


@given(NEARLY_AUTO, st.permutations((1.0, 2.0, 3.0, 4.0, 5.0)) | st.just([9.0] * 5))
def test_the_few_steps_of_a_stream_find_what_the_estimate_finds(snapshot_then: Snapshot, limits: list[float]) -> None:
    freshness = Freshness(*limits)
    landed = snapshot_then.control.landed
    is_in_air = landed is not None and landed.value is IN_AIR
    found = estimate(snapshot_then.at(NOW_S), freshness).state
    assert is_surely_auto(snapshot_then, NOW_S, freshness) == (found is State.FLYING_AUTO and is_in_air)


NOT_AUTO: dict[str, dict[str, object]] = {
    "nothing heard": {"heard_s": None},
    "two vehicles": {"conflict": "two vehicles"},
    "disarmed": {"armed": Sample(False, NOW_S)},
    "armed or not is not known": {"armed": None},
    "the pilot's mode": {"mode": Sample(Mode("POSCTL", PILOT), NOW_S)},
    "no mode": {"mode": None},
    "a doubtful estimate": {"estimator": Sample(Estimator(False, "no GPS"), NOW_S)},
    "no estimator": {"estimator": None},
    "no pose": {"pose": None},
    "no landed state": {"landed": None},
    **{f"landed state {each.name}": {"landed": Sample(each, NOW_S)} for each in LandedState if each is not IN_AIR},
}


@pytest.mark.parametrize("values", NOT_AUTO.values(), ids=NOT_AUTO)
def test_the_few_steps_rely_on_each_value(values: dict[str, object]) -> None:
    assert is_surely_auto(HEALTHY, NOW_S, FRESHNESS)
    assert not is_surely_auto(changed(HEALTHY, **values), NOW_S, FRESHNESS)


@pytest.mark.parametrize(
    ("value", "limit_s"),
    [
        ("heard_s", FRESHNESS.link_s),
        ("armed", FRESHNESS.mode_s),
        ("mode", FRESHNESS.mode_s),
        ("landed", FRESHNESS.landed_s),
        ("estimator", FRESHNESS.estimator_s),
        ("pose", FRESHNESS.pose_s),
    ],
)
def test_the_few_steps_rely_on_each_age_as_of_now(value: str, limit_s: float) -> None:
    def is_auto(age_s: float) -> bool:
        old = NOW_S - age_s if value == "heard_s" else Sample(value_of(HEALTHY, value).value, NOW_S - age_s)
        then = changed(HEALTHY, **{value: old}).at(NOW_S - age_s)
        return is_surely_auto(then, NOW_S, FRESHNESS)

    assert is_auto(limit_s)
    assert not is_auto(math.nextafter(limit_s, math.inf) + 1e-9)


HOME = EarthReference(FlatProjection(47.0, 8.0, 390.0), home_altitude_amsl_m=400.0)
TILTED = Quaternion.from_euler(math.radians(100.0), 0.0, 0.0)
MAY_LIE = "it stands still at the height of its home, and may lie there"
LIES = "it stands still, tilted as nothing flies, and lies on the ground"


def fallen(z_m: float, *, speed_m_s: float = 0.0, orientation: Quaternion | None = None) -> Snapshot:
    """Returns what an autopilot says in a mode of its own that takes the UAV to be in the air."""
    pose = Pose(Vector3(0.0, 0.0, z_m), orientation or Quaternion())
    velocity = Sample(Twist(Vector3(0.0, 0.0, -speed_m_s)), NOW_S)
    mode = Sample(Mode("AUTO.RTL", Control.OTHER), NOW_S)
    return changed(HEALTHY, earth=HOME, mode=mode, pose=Sample(pose, NOW_S), velocity=velocity)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (fallen(10.3), MAY_LIE),
        (fallen(15.0, orientation=TILTED), LIES),
        (fallen(15.0), ""),
        (fallen(10.3, speed_m_s=1.0), ""),
        (fallen(15.0, speed_m_s=8.0, orientation=TILTED), ""),
        (changed(fallen(10.3), earth=EarthReference()), ""),
    ],
)
def test_one_that_its_autopilot_takes_to_be_in_the_air_may_lie_on_the_ground(given: Snapshot, said: str) -> None:
    """PX4 says IN_AIR of what has fallen, for as long as anything of it turns."""
    found = estimate(given, FRESHNESS)
    assert found.state is State.FLYING_MANUAL
    assert found.why.startswith("in the air, mode AUTO.RTL does not take our references")
    assert found.why.removeprefix("in the air, mode AUTO.RTL does not take our references").strip("; ") == said


@pytest.mark.parametrize("control", [Control.OTHER, Control.LAND])
def test_stopped_motors_are_reported_at_once(control: Control) -> None:
    mode = Sample(Mode("AUTO.LAND", control), NOW_S)
    given = changed(fallen(10.3), failsafe=Cause.TERMINATION, mode=mode)
    why = estimate(given, FRESHNESS).why
    assert "the autopilot has stopped its motors" in why
    assert MAY_LIE in why
