"""Recorded flights of a real PX4, frame by frame: the states come when the flights' events say."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, UTC_S, Harness
from tests.ual_daemon.backends.mavlink.traces import Trace, load
from ual.types import State
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.policy.jumps import JumpDetector
from ual_daemon.flight.state import estimate
from ual_daemon.frames.local_frame import LocalFrame
from ual_daemon.geodesy import FlatProjection, SphereProjection

TICK_S = 0.02
SOON_S = 0.3
"""Lateness in seconds of a change that the stream shows early: PX4 tells of arming by an event."""
HEARTBEAT_S = 1.1
"""Lateness in seconds of a change that only a heartbeat shows: nobody was there to ask the recorded autopilots for more
than one a second.
"""


@dataclass(frozen=True)
class Change:
    time_s: float
    state: State
    why: str


def fly(trace: Trace, observe: Callable[[Snapshot], None] = lambda _: None) -> tuple[list[Change], Harness]:
    """The changes of the state during a recorded flight, as seen every `TICK_S`."""
    harness = Harness()
    changes = [Change(0.0, State.UNINITIALIZED, "")]
    frames = iter(trace.frames)
    frame = next(frames, None)
    while frame is not None:
        harness.now_s += TICK_S
        while frame is not None and frame[0] <= harness.now_s:
            harness.discovery.receiver.receive(frame[1], ADDRESS, frame[0], UTC_S + frame[0])
            frame = next(frames, None)
        harness.discovery.tick(harness.now_s)
        if harness.discovery.session is None:
            continue
        observe(harness.snapshot())
        found = estimate(harness.snapshot(), harness.session.dialect.freshness)
        if found.state is not changes[-1].state:
            changes.append(Change(harness.now_s, found.state, found.why))
    assert harness.discovery.receiver.corrupt_count == 0
    return changes, harness


def assert_changes(changes: list[Change], expected: list[tuple[State, float, float]]) -> None:
    """The states come in this order, each not before and not much after a time."""
    assert [change.state for change in changes] == [state for state, _, _ in expected]
    for change, (_, earliest_s, latest_s) in zip(changes, expected, strict=True):
        assert earliest_s - 0.05 <= change.time_s <= latest_s, change


def test_an_automatic_flight_that_ends_in_a_return() -> None:
    trace = load("px4_auto_takeoff_loiter_rtl")
    changes, harness = fly(trace)
    at = trace.time_s
    armed_s, lift_off_s, touch_down_s = at("pilot_arms"), at("truth_lift_off"), at("truth_touch_down")
    landing_s, disarmed_s = at("autopilot_begins_landing"), at("autopilot_disarmed")
    assert_changes(
        changes,
        [
            (State.UNINITIALIZED, 0.0, 0.0),
            (State.LANDED_DISARMED, at("first_heartbeat"), at("estimator_converged") + 0.1),
            (State.LANDED_ARMED, armed_s, armed_s + SOON_S),
            (State.TAKING_OFF, armed_s + 1.0, lift_off_s),
            # the recorder saw it in a heartbeat, CURRENT_MODE says it before
            (State.FLYING_MANUAL, at("autopilot_loiters") - HEARTBEAT_S, at("autopilot_loiters") + 0.1),
            (State.LANDING, landing_s, landing_s + 0.1),
            (State.LANDED_ARMED, touch_down_s, touch_down_s + 4.1),
            (State.LANDED_DISARMED, disarmed_s - HEARTBEAT_S, disarmed_s + 0.1),
        ],
    )
    assert changes[4].why == "in the air, mode AUTO.LOITER does not take our references"
    info = harness.session.info()
    assert (info.autopilot, info.autopilot_version, info.is_simulation) == ("PX4", "1.17.0", True)
    assert info.limits == Px4().limits({})  # nobody asked the recorded PX4 for its parameters
    assert isinstance(harness.snapshot().earth.projection, SphereProjection)


def test_an_offboard_flight_taken_twice_by_the_pilot_and_recovered() -> None:
    trace = load("px4_offboard_manual_recover")
    changes, harness = fly(trace)
    at = trace.time_s
    armed_s, disarmed_s = at("pilot_arms"), at("autopilot_disarmed")
    taken, recovered = "pilot_sets_mode", "companion_recovers_from_manual"
    mode_s = 0.2  # CURRENT_MODE tells a change at once, the heartbeat later
    assert_changes(
        changes,
        [
            (State.UNINITIALIZED, 0.0, 0.0),
            (State.LANDED_DISARMED, at("first_heartbeat"), at("estimator_converged") + 0.1),
            (State.LANDED_ARMED, armed_s, armed_s + SOON_S),
            # PX4 says that it is in the air before it has left the ground
            (State.FLYING_AUTO, armed_s + 1.0, at("truth_lift_off")),
            (State.FLYING_MANUAL, at(taken), at(taken) + mode_s),
            (State.FLYING_AUTO, at(recovered), at(recovered) + mode_s),
            (State.FLYING_MANUAL, at(taken, 1), at(taken, 1) + mode_s),
            (State.FLYING_AUTO, at(recovered, 1), at(recovered, 1) + mode_s),
            (State.LANDING, at("companion_begins_landing"), at("companion_begins_landing") + 0.1),
            (State.LANDED_ARMED, at("truth_touch_down"), at("truth_touch_down") + 4.5),
            (State.LANDED_DISARMED, disarmed_s - HEARTBEAT_S, disarmed_s + 0.1),
        ],
    )
    assert "POSCTL" in changes[4].why
    assert "ALTCTL" in changes[6].why
    assert harness.snapshot().condition.battery is not None


def test_a_lost_position_is_reported_though_positions_keep_coming() -> None:
    trace = load("px4_gps_loss_in_offboard")
    changes, harness = fly(trace)
    at = trace.time_s
    armed_s, lost_s = at("pilot_arms"), at("gps_lost")
    assert_changes(
        changes,
        [
            (State.UNINITIALIZED, 0.0, 0.0),
            (State.LANDED_DISARMED, at("first_heartbeat"), at("estimator_converged") + 0.1),
            (State.LANDED_ARMED, armed_s, armed_s + SOON_S),
            (State.FLYING_AUTO, armed_s + 1.0, at("companion_ends_takeoff")),
            (State.FLYING_MANUAL, lost_s, lost_s + 6.0),  # the failsafe's mode comes before the estimator's word
            (State.UNINITIALIZED, lost_s, lost_s + 6.0),
        ],
    )
    assert changes[-1].why == (
        "the autopilot has no good position: no horizontal velocity, horizontal position; "
        "it is in the air, in mode ALTCTL: position failsafe"
    )
    snapshot = harness.snapshot()
    assert snapshot.time_s - snapshot.motion.pose.time_s < 0.1
    assert snapshot.control.armed.value is False


def test_an_ardupilot_flight_taken_by_the_pilot_and_recovered() -> None:
    trace = load("ardupilot_guided_manual_recover")
    changes, harness = fly(trace)
    at = trace.time_s
    armed_s, landed_s, disarmed_s = at("pilot_arms"), at("autopilot_reports_on_ground"), at("autopilot_disarmed")
    assert_changes(
        changes,
        [
            (State.UNINITIALIZED, 0.0, 0.0),
            (State.LANDED_DISARMED, at("first_heartbeat"), at("estimator_converged") + SOON_S),
            # arming pushes no heartbeat, and the recorded one was at 1 Hz
            (State.LANDED_ARMED, armed_s, armed_s + HEARTBEAT_S),
            (State.TAKING_OFF, at("companion_begins_takeoff"), at("lift_off") + SOON_S),
            (State.FLYING_AUTO, at("companion_ends_takeoff") - SOON_S, at("companion_ends_takeoff") + SOON_S),
            # the recorder noted the switch; the autopilot took it 0.2 s later
            (State.FLYING_MANUAL, at("pilot_switches_to_loiter"), at("pilot_switches_to_loiter") + SOON_S),
            (State.FLYING_AUTO, at("companion_recovers_from_manual"), at("companion_recovers_from_manual") + SOON_S),
            (State.LANDING, at("companion_begins_landing"), at("companion_begins_landing") + SOON_S),
            (State.LANDED_ARMED, landed_s - SOON_S, landed_s + SOON_S),
            (State.LANDED_DISARMED, disarmed_s - SOON_S, disarmed_s + SOON_S),
        ],
    )
    assert changes[3].why == "the autopilot takes off (mode GUIDED)"
    assert "LOITER" in changes[5].why
    info = harness.session.info()
    assert (info.autopilot, info.flies_takeoff_on_setpoints) == ("ArduPilot", False)
    snapshot = harness.snapshot()
    assert isinstance(snapshot.earth.projection, FlatProjection)
    assert snapshot.earth.home_altitude_amsl_m == pytest.approx(488.08)  # 2 cm below the origin, since it was armed
    assert snapshot.condition.battery is not None
    here = snapshot.earth.projection.to_local(
        snapshot.motion.position_geo.latitude_deg,
        snapshot.motion.position_geo.longitude_deg,
        snapshot.motion.position_geo.altitude_amsl_m,
    )
    assert (here - snapshot.motion.pose.value.position).norm() < 0.05


@pytest.mark.parametrize(
    "name",
    ["px4_auto_takeoff_loiter_rtl", "px4_offboard_manual_recover", "ardupilot_guided_manual_recover"],
)
def test_stamps_of_a_recorded_flight_never_go_back_and_stay_close_to_when_it_was_received(name: str) -> None:
    harness = Harness()
    stamps = []
    for time_s, frame in load(name).frames:
        harness.discovery.receiver.receive(frame, ADDRESS, time_s, UTC_S + time_s)
        if harness.discovery.session is None:
            continue
        snapshot = harness.session.snapshot(time_s)
        if snapshot.motion.pose is not None and snapshot.motion.pose.time_s == time_s:
            stamps.append((time_s, snapshot.motion.stamp_s - UTC_S))
    assert len(stamps) > 1000
    assert all(0.0 <= received_s - stamp_s < 0.1 for received_s, stamp_s in stamps)
    assert all(later > earlier for (_, earlier), (_, later) in itertools.pairwise(stamps))


def test_home_stays_where_it_is_when_an_ardupilot_boots_elsewhere() -> None:
    trace = load("ardupilot_reboot_elsewhere")
    frame, jumps = LocalFrame(), JumpDetector()
    losses: list[float] = []

    def observe(snapshot: Snapshot) -> None:
        frame.update(snapshot)
        assert jumps.observe(snapshot) is None
        is_lost = frame.home.loss is not None
        if is_lost is not bool(len(losses) % 2):
            losses.append(snapshot.time_s)

    _, harness = fly(trace, observe)
    lost_s, known_s = losses
    assert trace.time_s("autopilot_powered_on") <= lost_s <= trace.time_s("first_heartbeat_after_reboot") + 3.5
    assert known_s <= trace.time_s("estimator_converged", 1)
    assert tuple(frame.home.local) == pytest.approx((-20.0, 0.0, 0.0), abs=0.05)
    assert harness.session.telemetry.plausibility.counts == {}
