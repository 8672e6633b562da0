"""Authority to fly: a daemon that was not commanded in this flight sends nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace

import pytest

from tests.snapshots import changed
from tests.ual_daemon.stepped import UPDATE_S, Stepped, at, stepped
from ual.errors import PermissionDeniedError, TaskAbortedError, WrongStateError
from ual.geometry import TwistStamped, Vector3
from ual.simulation import LinkLost
from ual.types import State
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import (
    Cause,
    Control,
    LandedState,
    Mode,
    PositionSetpoint,
    Sample,
    Setpoint,
    SetpointLoss,
)
from ual_daemon.flight.policy.authority import LONGEST_LINK_GAP_S
from ual_daemon.vehicle.vehicle import Vehicle


class Sent:
    """Setpoints that a backend was given to send."""

    def __init__(self, backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
        self.setpoints: list[Setpoint] = []
        self.holds_count = 0
        send, hold = backend.send, backend.hold

        def on_send(setpoint: Setpoint) -> None:
            self.setpoints.append(setpoint)
            send(setpoint)

        def on_hold() -> object:
            self.holds_count += 1
            return hold()

        monkeypatch.setattr(backend, "send", on_send)
        monkeypatch.setattr(backend, "hold", on_hold)


@pytest.fixture
def uav() -> Iterator[Stepped]:
    with stepped() as uav:
        yield uav


def restarted(uav: Stepped, *, watch_only: bool = False) -> Stepped:
    """Returns the same UAV, in flight, with a new daemon."""
    uav.vehicle.close()
    vehicle = Vehicle(uav.vehicle.backend, watch_only=watch_only)
    vehicle.open()
    new = Stepped(vehicle, uav.world)
    new.run(0.1)
    return new


def other_program(backend: Backend, setpoint: Setpoint) -> Callable[[], None]:
    """Sends a setpoint as another program does, not through UAL."""
    send = backend.send
    return lambda: send(setpoint)


def test_a_daemon_started_in_a_flight_sends_nothing_until_it_is_commanded(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    uav.fly()
    new = restarted(uav)
    sent = Sent(new.vehicle.backend, monkeypatch)
    new.sim.pilot_give_back()  # its mode stays GUIDED, as ArduPilot's does
    new.run(5.0)
    assert new.state is State.FLYING_AUTO
    assert sent.setpoints == []
    assert (
        "UAL has not been commanded in this flight since it was started, and sends nothing"
        in new.vehicle.telemetry().state_reason
    )
    new.vehicle.commands.abort()
    new.run(1.0)
    assert len(sent.setpoints) >= 0.9 / UPDATE_S
    assert "sends nothing" not in new.vehicle.telemetry().state_reason


def test_a_command_continues_after_long_without_updates(uav: Stepped) -> None:
    """A light UAV of which nobody wants to know anything is not updated. That is no silence of its autopilot."""
    uav.fly()
    uav.sim.pilot_take_over()
    uav.run(0.1)
    uav.sim.pilot_give_back()
    uav.run(0.1)
    uav.run(LONGEST_LINK_GAP_S + 4.0)
    uav.vehicle.commands.setpoints.set_pose(at(5.0, 0.0, 3.0))
    uav.run(10.0)
    assert uav.state is State.FLYING_AUTO
    assert uav.pose.position.x == pytest.approx(5.0, abs=0.1)


def test_the_flight_of_another_program_goes_on_when_a_daemon_starts_and_ends(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    uav.fly()
    new = restarted(uav)
    goal = new.pose.position + Vector3(10.0, 0.0, 0.0)
    other = other_program(new.vehicle.backend, PositionSetpoint(goal, 0.0))
    sent = Sent(new.vehicle.backend, monkeypatch)
    for _ in range(200):
        other()
        new.run(0.1)
    assert (new.pose.position - goal).norm() < 0.5
    done = new.vehicle.prepare_shutdown()
    assert done.done()
    new.run(0.5)
    assert sent.setpoints == []
    assert sent.holds_count == 0
    assert new.vehicle.telemetry().flight_mode == "GUIDED"


def test_a_daemon_that_flies_hands_over_at_its_end(uav: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    uav.fly()
    sent = Sent(uav.vehicle.backend, monkeypatch)
    uav.end(uav.vehicle.prepare_shutdown())
    assert sent.holds_count == 1
    assert uav.state is State.FLYING_MANUAL


def test_a_flight_begun_by_a_command_ends_when_it_is_disarmed(uav: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    uav.fly()
    uav.end(uav.prepare.land().begin().future)
    uav.until(lambda: uav.is_in(State.LANDED_DISARMED))
    backend = uav.vehicle.backend
    uav.arm()
    sent = Sent(backend, monkeypatch)
    uav.sim.pilot_give_back()  # the mode, by another program
    up = uav.pose.position + Vector3(0.0, 0.0, 3.0)
    for _ in range(80):
        backend.world.fleet.set_setpoint(0, PositionSetpoint(up, 0.0), backend.clock.now_s())  # type: ignore[attr-defined]
        uav.run(0.1)
    assert uav.state is State.FLYING_AUTO
    assert sent.setpoints == []


def test_what_was_taken_and_returned_waits_for_a_command(uav: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.run(1.0)
    sent = Sent(uav.vehicle.backend, monkeypatch)
    uav.sim.pilot_give_back()  # or a ground station that flies by itself now
    uav.run(3.0)
    assert uav.state is State.FLYING_AUTO
    assert sent.setpoints == []
    reason = uav.vehicle.telemetry().state_reason
    assert "UAL sends nothing until it is commanded anew" in reason
    assert "has not been commanded" not in reason
    uav.end(uav.prepare.go_to_waypoint(at(2.0, 0.0, 3.0)).begin().future)
    assert "sends nothing" not in uav.vehicle.telemetry().state_reason


def test_a_task_that_ended_with_a_lost_link_leaves_a_uav_that_is_stopped_when_the_link_is_back(uav: Stepped) -> None:
    uav.fly()
    task = uav.prepare.go_to_waypoint(at(40.0, 0.0, 3.0)).begin()
    uav.run(4.0)
    fault = uav.sim.begin_fault(LinkLost())
    uav.run(0.8)
    assert task.future.done()
    uav.sim.end_fault(fault)
    uav.run(3.0)
    assert uav.vehicle.telemetry().reference_pose is not None
    assert uav.speed < 0.1


def test_an_autopilot_that_falls_without_setpoints_is_held_at_once(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    uav.fly()
    backend = uav.vehicle.backend
    info = backend.info()
    monkeypatch.setattr(backend, "info", lambda: replace(info, setpoint_loss=SetpointLoss.FALLS))
    uav.vehicle.close()
    vehicle = Vehicle(backend)
    vehicle.open()
    new = Stepped(vehicle, uav.world)
    sent = Sent(backend, monkeypatch)
    new.run(1.0)
    assert len(sent.setpoints) >= 0.9 / UPDATE_S
    new.end(vehicle.prepare_shutdown())
    assert sent.holds_count == 1


def test_a_daemon_that_only_watches_refuses_every_command_and_sends_nothing(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    uav.fly()
    new = restarted(uav, watch_only=True)
    sent = Sent(new.vehicle.backend, monkeypatch)
    commands = new.vehicle.commands
    attempts: list[Callable[[], object]] = [
        commands.arm,
        commands.disarm,
        lambda: new.prepare.take_off(3.0),
        new.prepare.land,
        lambda: new.prepare.go_to_waypoint(at(1.0, 0.0, 3.0)),
        lambda: new.prepare.follow_path([at(1.0, 0.0, 3.0)]),
        lambda: commands.setpoints.set_pose(at(1.0, 0.0, 3.0)),
        lambda: commands.setpoints.set_velocity(TwistStamped()),
        commands.recover_from_manual,
        commands.abort,
    ]
    for attempt in attempts:
        with pytest.raises(PermissionDeniedError, match="--watch-only"):
            attempt()
    new.run(1.0)
    assert new.vehicle.prepare_shutdown().done()
    assert sent.setpoints == []
    assert sent.holds_count == 0
    assert new.vehicle.info().is_arming_allowed is False


@pytest.mark.parametrize(("mode", "is_withdrawn"), [("HOLD", True), ("GUIDED", False)])
def test_a_command_from_just_before_the_mode_changed_is_withdrawn_while_nobody_knows_who_took_it(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch, mode: str, is_withdrawn: bool
) -> None:
    uav.fly()
    backend, answer = uav.vehicle.backend, Future[None]()
    monkeypatch.setattr(backend, "land", lambda *_: answer)
    uav.prepare.land().begin()
    now = backend.snapshot()
    uav.vehicle._flight.step(changed(now, mode=Sample(Mode(mode, Control.OTHER), now.time_s), held_by=Cause.OPEN))
    assert answer.cancelled() is is_withdrawn


@pytest.mark.parametrize(
    ("control", "landed", "state"),
    [
        (Control.LAND, LandedState.IN_AIR, State.LANDING),
        (Control.TAKE_OFF, LandedState.IN_AIR, State.TAKING_OFF),
        (Control.OTHER, LandedState.LANDING, State.LANDING),  # PX4's AUTO.RTL above its home
    ],
)
def test_a_task_that_a_ground_stations_landing_ended_does_not_advise_to_recover_which_would_be_refused(
    uav: Stepped, control: Control, landed: LandedState, state: State
) -> None:
    uav.fly()
    task = uav.prepare.go_to_waypoint(at(40.0, 0.0, 3.0)).begin()
    now = uav.vehicle.backend.snapshot()
    theirs, how = Sample(Mode("THEIRS", control, is_autonomous=True), now.time_s), Sample(landed, now.time_s)
    uav.vehicle._flight.step(changed(now, mode=theirs, landed=how, held_by=Cause.GROUND_STATION))
    with pytest.raises(TaskAbortedError, match="the ground station took over") as caught:
        task.future.result(0.0)
    assert f"the state is {state.name}: only the safety pilot or a ground station can end that" in str(caught.value)
    assert "recover_from_manual" not in str(caught.value)
    assert caught.value.metadata["state"] == state.name


@pytest.mark.parametrize(
    ("held_by", "control", "says"),
    [
        (Cause.SAFETY_PILOT, Control.OTHER, "; recover_from_manual takes control back"),
        (Cause.SETPOINTS, Control.OTHER, "; recover_from_manual takes control back"),
        (Cause.RC, Control.OTHER, "; recover_from_manual takes control back only with force"),
        (Cause.GROUND_STATION, Control.LAND, "; only the safety pilot or a ground station can end that"),
    ],
)
def test_a_command_that_is_refused_as_others_fly_the_uav_says_how_that_ends(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch, held_by: Cause, control: Control, says: str
) -> None:
    uav.fly()
    now = uav.vehicle.backend.snapshot()
    theirs = changed(now, mode=Sample(Mode("THEIRS", control), now.time_s), held_by=held_by)
    monkeypatch.setattr(uav.vehicle.backend, "snapshot", lambda: theirs)
    with pytest.raises(WrongStateError) as caught:
        uav.prepare.go_to_waypoint(at(1.0, 0.0, 3.0))
    assert caught.value.message.endswith(f": {held_by.value}{says}")


def test_a_take_off_that_is_refused_as_others_fly_does_not_advise_to_recover_in_the_air(uav: Stepped) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.run(1.0)
    with pytest.raises(WrongStateError) as caught:
        uav.prepare.take_off(3.0)
    assert "recover_from_manual" not in caught.value.message


def test_a_flight_that_others_took_and_gave_back_is_not_reported_as_one_that_ual_was_not_commanded_in(
    uav: Stepped,
) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.run(1.0)
    uav.sim.pilot_give_back()
    uav.run(1.0)
    assert uav.state is State.FLYING_AUTO
    reason = uav.vehicle.telemetry().state_reason
    assert "took it (mode MANUAL): UAL sends nothing until it is commanded anew" in reason
    assert "has not been commanded" not in reason
    uav.vehicle.commands.abort()
    uav.run(0.1)
    assert "sends nothing" not in uav.vehicle.telemetry().state_reason


def test_the_next_flight_knows_nothing_of_who_took_the_last_one(uav: Stepped) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.run(1.0)
    uav.sim.pilot_move_sticks(up=-0.5)
    uav.until(lambda: uav.is_in(State.LANDED_ARMED))
    uav.sim.pilot_disarm()
    uav.run(0.1)
    assert uav.is_in(State.LANDED_DISARMED)
    assert uav.vehicle._flight.authority.taken == ""


def test_a_landing_that_no_update_has_assessed_is_not_taken_off_again(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A take-off that a client repeats came in the moment between the data and their update, and was accepted."""
    uav.fly()
    seen = uav.vehicle.backend.snapshot()
    landed = changed(seen, landed=Sample(LandedState.ON_GROUND, seen.time_s))
    monkeypatch.setattr(uav.vehicle.backend, "snapshot", lambda: landed)
    assert uav.state is State.LANDED_ARMED
    with pytest.raises(WrongStateError, match="whether others have flown it"):
        uav.prepare.take_off(3.0)
