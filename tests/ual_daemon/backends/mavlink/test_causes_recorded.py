"""Recorded failsafes and take-overs of real autopilots: what took the control is named, and when."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, UTC_S, Harness
from tests.ual_daemon.backends.mavlink.test_replay import fly
from tests.ual_daemon.backends.mavlink.traces import Trace, load
from ual.types import State
from ual_daemon.backends.values import Cause, Control, Snapshot
from ual_daemon.flight.external_silence import ExternalSilence
from ual_daemon.flight.manoeuvres.manoeuvre import taken_over
from ual_daemon.flight.position_watch import PositionWatch
from ual_daemon.flight.state import estimate

TICK_S = 0.02


class Held(NamedTuple):
    """Since when the mode is one that does not take our references, what holds it, and what a task would say."""

    time_s: float
    mode: str
    by: Cause | None
    failsafe: Cause | None
    why: str
    error: str


def held(trace: Trace) -> tuple[list[Held], Harness]:
    """The holders of the control in a recorded flight, while it was armed, in another mode than ours."""
    harness = Harness()
    found: list[Held] = []
    frames = iter(trace.frames)
    frame = next(frames, None)
    while frame is not None:
        harness.now_s += TICK_S
        while frame is not None and frame[0] <= harness.now_s:
            harness.discovery.receiver.receive(frame[1], ADDRESS, frame[0], UTC_S + frame[0])
            frame = next(frames, None)
        if harness.discovery.session is None:
            continue
        snapshot = harness.snapshot()
        if (
            snapshot.control.mode is None
            or not snapshot.control.armed.value
            or snapshot.control.mode.value.control is Control.REFERENCES
        ):
            continue
        why = estimate(snapshot, harness.session.dialect.freshness).why
        error = str(taken_over(snapshot, "go_to_waypoint"))
        new = Held(
            harness.now_s,
            snapshot.control.mode.value.name,
            snapshot.control.held_by,
            snapshot.control.failsafe,
            why,
            error,
        )
        if not found or found[-1][1:3] != new[1:3]:
            found.append(new)
    return found, harness


@pytest.mark.parametrize(
    ("name", "modes", "cause"),
    [
        ("px4_rc_loss_in_offboard", ["AUTO.LOITER", "AUTO.RTL"], Cause.RC),
        ("px4_battery_critical_in_offboard", ["AUTO.LOITER", "AUTO.RTL"], Cause.BATTERY),
        ("px4_geofence_breach_in_offboard", ["AUTO.LOITER", "AUTO.RTL"], Cause.FENCE),
        ("px4_gps_loss_in_offboard", ["ALTCTL"], Cause.POSITION),
        ("ardupilot_battery_failsafe_in_guided", ["RTL"], Cause.BATTERY),
        ("ardupilot_fence_breach_in_guided", ["RTL"], Cause.FENCE),
    ],
)
def test_a_failsafe_is_named_as_soon_as_its_mode_shows(name: str, modes: list[str], cause: Cause) -> None:
    found, _ = held(load(name))
    flown = [each for each in found if each.by is not None]  # PX4 was armed by hand, in POSCTL
    assert [(each.mode, each.by) for each in flown] == [(mode, cause) for mode in modes]
    assert "safety pilot" not in flown[0].error
    assert f"taken by the autopilot: {cause.value}" in flown[0].error
    assert "force" in flown[0].error
    if "gps" not in name:  # without a position the state says that instead
        assert cause.value in flown[0].why


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("px4_pilot_lands_by_hand", [("POSCTL", Cause.SAFETY_PILOT)]),
        ("px4_offboard_manual_recover", [("POSCTL", Cause.SAFETY_PILOT), ("ALTCTL", Cause.SAFETY_PILOT)]),
        ("ardupilot_guided_manual_recover", [("LOITER", Cause.SAFETY_PILOT)]),
    ],
)
def test_a_mode_that_is_executed_by_sticks_is_the_safety_pilots_at_once(
    name: str, expected: list[tuple[str, Cause]]
) -> None:
    found, harness = held(load(name))
    flown = [(each.mode, each.by) for each in found if each.by is not None and "LAND" not in each.mode]
    assert flown == expected
    assert harness.snapshot().control.failsafe is None


def test_another_mode_without_a_failsafe_or_a_switch_is_the_ground_stations() -> None:
    found, _ = held(load("px4_auto_takeoff_loiter_rtl"))
    last = found[-1]
    assert (last.mode, last.by, last.failsafe) == ("AUTO.RTL", Cause.GROUND_STATION, None)
    assert "the ground station took over" in last.error


def test_the_failsafe_is_active_while_it_flies_and_its_sensor_fails() -> None:
    _, harness = held(load("ardupilot_battery_failsafe_in_guided"))
    snapshot = harness.snapshot()
    assert estimate(snapshot, harness.session.dialect.freshness).state is State.LANDED_DISARMED
    assert snapshot.control.failsafe is Cause.BATTERY  # it stands with an empty battery
    assert snapshot.condition.health.is_ready_to_arm is False
    assert snapshot.condition.health.failing_checks == ("battery", "Battery 1 low voltage failsafe", "Battery failsafe")


def test_a_breached_fence_is_no_failsafe_any_more_once_the_uav_is_inside_but_its_return_is_still_its_own() -> None:
    trace = load("ardupilot_fence_breach_in_guided")
    found, harness = held(trace)
    assert harness.snapshot().control.failsafe is None
    assert found[-1].by is Cause.FENCE


def test_a_ground_stations_target_in_guided_is_another_senders() -> None:
    trace = load("ardupilot_gcs_takes_guided")
    seen: list[tuple[float, str]] = []
    harness = Harness()
    for time_s, frame in trace.frames:
        harness.now_s = time_s
        harness.discovery.receiver.receive(frame, ADDRESS, time_s, UTC_S + time_s)
        if harness.discovery.session is not None:
            text = harness.snapshot().control.other_sender
            if not seen or text != seen[-1][1]:
                seen.append((time_s, text))
    # What flew it was not UAL: from the first target in the air on.
    assert [bool(text) for _, text in seen] == [False, True, False]
    assert "UAL has sent none" in seen[1][1]


@pytest.mark.parametrize(
    ("name", "texts", "troubles"),
    [
        ("px4_gps_loss_in_offboard", ["failsafe enter autopilot disengaged"], ["no satellite fix (NONE)"]),
        ("px4_rc_loss_in_offboard", ["failsafe enter hold", "failsafe enter generic"], []),
        ("ardupilot_guided_manual_recover", [], []),
    ],
)
def test_only_what_is_severe_learns_of_recorded_flights(name: str, texts: list[str], troubles: list[str]) -> None:
    watch, trace, lost_s = PositionWatch(ExternalSilence()), load(name), list[float]()
    said, told = dict[str, None](), dict[str, None]()

    def observe(snapshot: Snapshot) -> None:
        watch.update(snapshot)
        said.update(dict.fromkeys(each.text for each in snapshot.condition.severe_texts))
        if watch.trouble:
            lost_s.append(snapshot.time_s)
            told[watch.trouble.partition(",")[0]] = None

    fly(trace, observe)
    assert (list(said), list(told)) == (texts, troubles)
    if troubles:
        assert lost_s[0] - trace.time_s("gps_lost") < 1.0
