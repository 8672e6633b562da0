"""Effects of a lease on a flight: whenever it begins or ends, the UAV holds, and nobody but its holder moves it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any

import pytest

from tests.snapshots import changed
from tests.ual_daemon.stepped import STEP_S, UPDATE_S, Stepped, at, stepped
from ual.errors import LeaseHeldError, LeaseLostError, TaskAbortedError
from ual.geometry import Twist, TwistStamped, Vector3
from ual.types import State
from ual_daemon.backends.values import Cause, Setpoint, Snapshot
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import VehicleSettings
from ual_daemon.vehicle.equipment import PayloadDevice

FAR = at(60.0, 0.0, 3.0)
LONG_S = 1e6
"""A lease lasts in real time, which a busy machine has too little of: none of these must expire by itself."""
EAST = TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)))


@pytest.fixture
def uav() -> Iterator[Stepped]:
    with stepped() as uav:
        yield uav


def in_progress(uav: Stepped, lease_id: str = NOBODY) -> VehicleTask:
    """A go-to that has begun to move."""
    task = uav.by(lease_id).go_to_waypoint(FAR).begin()
    uav.until(lambda: uav.speed > 1.0)
    return task


def holds(uav: Stepped) -> bool:
    """Returns whether it comes to rest where it is."""
    uav.until(lambda: uav.speed < 0.05, 10.0)
    before = uav.pose.position
    uav.run(2.0)
    return (uav.pose.position - before).norm() < 0.1


def ended_by_lease(task: VehicleTask, why: str) -> bool:
    error = task.future.exception()
    return isinstance(error, TaskAbortedError) and error.metadata["by"] == "lease" and why in error.message


def test_what_another_program_flies_ends_when_one_acquires_the_lease(uav: Stepped) -> None:
    uav.fly()
    task = in_progress(uav)
    uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    assert ended_by_lease(task, "survey has acquired the lease")
    assert holds(uav)
    assert uav.state is State.FLYING_AUTO


def test_an_arming_that_has_not_left_ends_when_another_acquires_the_lease(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It left up to 4.5 s later, and the motors started for a program that had lost the UAV."""
    waiting: Future[None] = Future()
    monkeypatch.setattr(uav.vehicle.backend, "arm", lambda: waiting)
    arming = uav.vehicle.commands.arm()
    uav.run(0.5)
    assert not arming.done()
    uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    with pytest.raises(TaskAbortedError, match=r"survey has acquired the lease; .*it may still be executed"):
        arming.result(0)
    assert waiting.cancelled()


@pytest.mark.parametrize("command", ["arm", "disarm"])
def test_one_that_is_allowed_just_before_its_lease_ends_is_not_sent(
    uav: Stepped, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was not watched yet when the lease ended, and so was sent: in the flight of another program."""
    if command == "disarm":
        uav.arm()
    commands, state = uav.vehicle.commands, uav.state
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    require_state = commands._preconditions.require_state

    def require_and_end(*args: Any) -> Snapshot:
        snapshot = require_state(*args)
        uav.vehicle.release_lease(lease_id)
        return snapshot

    monkeypatch.setattr(commands._preconditions, "require_state", require_and_end)
    with pytest.raises(LeaseLostError, match=f"{command}: the lease has ended: it was released"):
        getattr(commands, command)(lease_id)
    uav.run(1.0)
    assert uav.state is state


def test_an_arming_that_shows_is_done_when_another_acquires_the_lease(uav: Stepped) -> None:
    arming = uav.vehicle.commands.arm()
    uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    uav.run(STEP_S)
    assert arming.result(0) is None


@pytest.mark.parametrize("how", ["lease", "cancel", "abort", "stuck"])
def test_one_that_has_touched_down_by_references_keeps_its_stream(how: str) -> None:
    """Nothing was sent any more, and the autopilot's failsafe began while its motors ran on the ground."""
    with stepped(VehicleSettings(floor_m=None), light={"disarm_after_landing_s": 100.0}) as uav:
        uav.fly()
        task = uav.prepare.go_to_waypoint(at(1.0, 0.0, -1.0)).begin()
        uav.until(lambda: uav.state is State.LANDED_ARMED)
        sent: list[Setpoint] = []
        uav.vehicle.observe_setpoints(sent.append)
        if how == "lease":
            uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
        elif how == "cancel":
            uav.vehicle.commands.cancel(task)
        elif how == "abort":
            uav.vehicle.commands.abort(task_id=task.id)
        uav.until(task.future.done)
        sent.clear()
        uav.run(1.0)
        assert uav.state is State.LANDED_ARMED
        assert len(sent) > 0.8 / UPDATE_S


@pytest.mark.parametrize("how", ["released", "taken"])
def test_what_its_holder_flies_ends_with_the_lease(uav: Stepped, how: str) -> None:
    uav.fly()
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    task = in_progress(uav, lease_id)
    if how == "released":
        uav.vehicle.release_lease(lease_id)
    else:
        uav.vehicle.acquire_lease("film", "local", take=True, lasts_s=LONG_S)
    assert ended_by_lease(task, "released the lease" if how == "released" else "film has acquired the lease")
    assert holds(uav)
    with pytest.raises(LeaseLostError):
        uav.vehicle.commands.setpoints.set_velocity(EAST, lease_id)


@pytest.mark.parametrize("how", ["acquired", "taken", "released"])
def test_a_release_that_waits_ends_with_the_lease(uav: Stepped, how: str) -> None:
    """It waits for a silence to end, or for an earlier order: it would leave in the flight of another program."""
    lease_id = NOBODY if how == "acquired" else uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    sent: Future[None] = Future()
    claw = PayloadDevice("gripper", "claw")
    release = uav.vehicle.equipment.give(claw, "release", lambda: sent, holds=False, require=lambda: None)
    if how == "released":
        uav.vehicle.release_lease(lease_id)
    else:
        uav.vehicle.acquire_lease("film", "local", take=True, lasts_s=LONG_S)
    assert sent.cancelled()
    error = release.exception(0)
    assert isinstance(error, TaskAbortedError)
    assert error.metadata == {"by": "lease"}


def test_a_velocity_ends_with_the_lease(uav: Stepped) -> None:
    uav.fly()
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    for _ in range(50):
        uav.vehicle.commands.setpoints.set_velocity(EAST, lease_id)
        uav.run(STEP_S)
    assert uav.speed > 0.5
    uav.vehicle.release_lease(lease_id)
    with pytest.raises(LeaseLostError):
        uav.vehicle.commands.setpoints.set_velocity(EAST, lease_id)
    assert holds(uav)


def test_one_that_is_not_kept_ends_by_itself(uav: Stepped, caplog: pytest.LogCaptureFixture) -> None:
    uav.fly()
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=0.05)
    task = uav.by(lease_id).go_to_waypoint(FAR).begin()
    uav.until(lambda: uav.vehicle.lease() is None)  # its time is the computer's
    assert ended_by_lease(task, "the lease of survey was not kept")
    assert holds(uav)
    assert [record for record in caplog.records if vars(record).get("ual_event") == "lease_ends"]


def test_one_that_is_kept_too_late_ends_and_the_uav_holds(uav: Stepped) -> None:
    uav.fly()
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=0.2)
    task = uav.by(lease_id).go_to_waypoint(FAR).begin()
    while True:  # its time is the computer's, and no update comes meanwhile
        try:
            uav.vehicle.keep_lease("another")
        except LeaseLostError:
            if uav.vehicle.lease() is None:
                break
    assert ended_by_lease(task, "the lease of survey was not kept")
    with pytest.raises(LeaseLostError, match=r"not kept for 0\.2 s"):
        uav.vehicle.keep_lease(lease_id)
    assert holds(uav)


def test_one_that_was_not_kept_can_be_acquired_while_time_stands_still(uav: Stepped) -> None:
    uav.vehicle.acquire_lease("survey", "local", lasts_s=0.0)
    assert uav.vehicle.acquire_lease("film", "local", lasts_s=LONG_S)


@pytest.mark.parametrize("manoeuvre", ["take_off", "land"])
def test_a_take_off_and_a_landing_go_on(uav: Stepped, manoeuvre: str) -> None:
    if manoeuvre == "land":
        uav.fly()
    else:
        uav.arm()
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    by = uav.by(lease_id)
    task = (by.land() if manoeuvre == "land" else by.take_off(3.0)).begin()
    uav.run(0.5)
    uav.vehicle.release_lease(lease_id)
    uav.end(task.future)


def test_control_is_not_taken_back_from_the_pilot_by_a_recover_whose_lease_has_ended(
    uav: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While it is open what took the UAV, the command has not left yet."""
    uav.fly()
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    uav.sim.pilot_take_over()
    uav.run(0.5)
    backend, step, open_ = uav.vehicle.backend, uav.vehicle._flight.step, {"held_by": Cause.OPEN}
    snapshot = backend.snapshot
    monkeypatch.setattr(backend, "snapshot", lambda: changed(snapshot(), **open_))
    monkeypatch.setattr(uav.vehicle._flight, "step", lambda found: step(changed(found, **open_)))
    recovered = uav.vehicle.commands.recover_from_manual(lease_id).begin()
    uav.run(0.2)
    uav.vehicle.release_lease(lease_id)
    open_.clear()
    uav.run(2.0)
    assert uav.state is State.FLYING_MANUAL
    assert isinstance(recovered.exception(0), TaskAbortedError)


def test_a_take_off_that_waits_for_the_arming_does_not_begin_without_its_owner(uav: Stepped) -> None:
    uav.vehicle.commands.is_armed_automatically = True
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    task = uav.by(lease_id).take_off(3.0).begin()
    uav.run(0.2)
    uav.vehicle.release_lease(lease_id)
    assert ended_by_lease(task, "released")
    uav.arm()
    uav.run(3.0)
    assert uav.state is State.LANDED_ARMED


def test_what_was_planned_before_does_not_begin_after(uav: Stepped) -> None:
    uav.fly()
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    prepared = uav.by(lease_id).go_to_waypoint(FAR)
    uav.vehicle.release_lease(lease_id)
    with pytest.raises((LeaseLostError, TaskAbortedError)):
        prepared.begin()
    assert holds(uav)


def test_others_are_refused_whatever_they_command(uav: Stepped) -> None:
    uav.fly()
    uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    commands = uav.vehicle.commands
    for command in (
        uav.prepare.land,
        lambda: uav.prepare.go_to_waypoint(FAR),
        uav.prepare.return_to_launch,
        lambda: commands.setpoints.set_velocity(EAST),
        lambda: commands.setpoints.set_pose(FAR),
        commands.abort,
        commands.recover_from_manual,
        commands.set_home,
        commands.arm,
        commands.disarm,
        lambda: commands.setpoints.plan_velocity(EAST),
    ):
        with pytest.raises(LeaseHeldError, match="survey"):
            command()


def test_others_cannot_pause_or_cancel_a_task_of_the_holder(uav: Stepped) -> None:
    uav.fly()
    lease_id = uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    task = in_progress(uav, lease_id)
    commands = uav.vehicle.commands
    stops: list[Callable[[], None]] = [
        lambda: commands.pause(task.id),
        lambda: commands.cancel(task),
        lambda: commands.abort(task_id=task.id),
    ]
    for command in stops:
        with pytest.raises(LeaseHeldError):
            command()
    assert not uav.vehicle.commands.abandon(task)
    uav.end(task.future)


def test_in_a_flight_of_others_nothing_is_sent(uav: Stepped) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.run(0.5)
    assert uav.state is State.FLYING_MANUAL
    sent: list[object] = []
    uav.vehicle.observe_setpoints(sent.append)
    uav.vehicle.release_lease(uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S))
    uav.run(1.0)
    assert sent == []
    assert uav.state is State.FLYING_MANUAL


def test_the_safety_pilot_needs_no_lease(uav: Stepped) -> None:
    uav.fly()
    uav.vehicle.acquire_lease("survey", "local", lasts_s=LONG_S)
    uav.sim.pilot_take_over()
    uav.run(0.2)
    assert uav.state is State.FLYING_MANUAL
