"""The exchange of what is flown, with callers, updates, pauses, the lease and the shutdown interleaved line by line."""

from __future__ import annotations

import inspect
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from itertools import chain, repeat
from types import ModuleType
from typing import Any, cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typing_extensions import override

from tests.interleaving import Interleaving
from tests.snapshots import changed, value_of
from tests.ual_daemon.stepped import stepped
from ual.errors import GeofenceError, LeaseHeldError, TaskAbortedError, UalError, WrongStateError
from ual.geometry import Vector3
from ual.types import TaskKind
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Cause, Control, Mode, PositionSetpoint, Sample, Setpoint, Snapshot
from ual_daemon.flight import flight as flight_module
from ual_daemon.flight import setpoint_sender, stepper
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.current_manoeuvre import CurrentManoeuvre
from ual_daemon.flight.flight import CommandOrigin, Flight
from ual_daemon.flight.manoeuvres import fly_reference
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre, Step
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import LimitSettings
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import Hold
from ual_daemon.vehicle.vehicle import Vehicle

UPDATE_S = 0.02
HEIGHT_M = 3.0
INTERLEAVED: tuple[ModuleType, ...] = (flight_module, stepper, setpoint_sender, fly_reference)


class Wire:
    """A backend whose data stand still, and that keeps what is sent through it."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self.now = backend.snapshot()
        self.sent: list[PositionSetpoint] = []
        self.holds_count = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._backend, name)

    def snapshot(self) -> Snapshot:
        return self.now

    def send(self, setpoint: Setpoint) -> None:
        assert isinstance(setpoint, PositionSetpoint)
        self.sent.append(setpoint)

    def hold(self) -> Future[None]:
        self.holds_count += 1
        return Future()


class ObservedFlight(CurrentManoeuvre):
    """Keeps all that was flown, in its order."""

    def __init__(self) -> None:
        self.seen: list[Manoeuvre | None] = []
        super().__init__()

    def __setattr__(self, name: str, value: object) -> None:
        super().__setattr__(name, value)
        if name == "manoeuvre":
            self.seen.append(cast("Manoeuvre | None", value))


class Scripted(Manoeuvre):
    """A task that sends a place of its own, and ends or hands over in a step of its own."""

    why_not_pausable = ""

    def __init__(self, task: VehicleTask, x_m: float, steps_count: int, then: Manoeuvre | None = None) -> None:
        super().__init__(f"go_to_{x_m:g}", task)
        self._hold, self._left_count, self._then = Hold(Vector3(x_m, 0.0, HEIGHT_M), 0.0), steps_count, then

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        setpoint = self._hold.setpoint(snapshot)
        if self.is_paused:
            return Step(setpoint)
        self._left_count -= 1
        if self._left_count > 0:
            return Step(setpoint)
        if self._then is not None:
            return Step(handover=Handover(self._then, lambda: None))
        return Step(setpoint, has_ended=True, next_reference=self._hold)

    @override
    def current_reference(self) -> Hold:
        return self._hold


class World:
    """A flight in the air, and what its callers do to it."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.wire = Wire(vehicle.backend)
        backend = cast("Backend", self.wire)
        self.flight = Flight(backend, CurrentLimits(backend, LimitSettings()), vehicle._flight.geofence)
        self.interleaving = Interleaving(inspect.getfile(each) for each in INTERLEAVED)
        self.flown = ObservedFlight()
        self.flown.lock = cast("Any", self.interleaving.lock)
        self.flight._flown = self.flight._stepper._flown = self.flight.sender._flown = self.flown
        self.flight.authority.begin()
        self.tasks: list[VehicleTask] = []
        self.ended: list[VehicleTask] = []
        self.paused: list[VehicleTask] = []
        self.newest_x_m = 0.0
        """The place of the newest command."""

    def _x_m(self) -> float:
        self.newest_x_m += 1.0
        return self.newest_x_m

    def _new_task(self) -> VehicleTask:
        task = VehicleTask(TaskKind.GO_TO_WAYPOINT, "", self.wire._backend.clock)
        self.tasks.append(task)
        task.future.add_done_callback(lambda _: self.ended.append(task))
        return task

    def _passed(self, command: Callable[[], object]) -> None:
        """Gives a command without a lease. It is refused from when the lease is held, or UAL shuts down."""
        must_fail = self.flight.is_closing or self.flight.lease.info is not None
        try:
            command()
        except (WrongStateError, LeaseHeldError):
            return
        assert not must_fail

    def go(self) -> None:
        self._passed(partial(self.flight.begin, Scripted(self._new_task(), self._x_m(), 2), CommandOrigin()))

    def go_in_two_parts(self) -> None:
        task = self._new_task()
        second = Scripted(task, self._x_m(), 1)
        self._passed(partial(self.flight.begin, Scripted(task, self._x_m(), 2, second), CommandOrigin()))

    def set_pose(self) -> None:
        hold = Hold(Vector3(self._x_m(), 0.0, HEIGHT_M), 0.0)
        self._passed(partial(self.flight.begin_reference, hold, "set_pose", self.wire.now, CommandOrigin()))

    def cancel_newest(self) -> None:
        if self.tasks:
            with suppress(LeaseHeldError):
                self.flight.drop_task(self.tasks[-1].id, "cancel", NOBODY)

    def pause(self) -> None:
        with suppress(WrongStateError):  # nothing runs that can be paused
            self.paused.append(self.flight.pause())

    def lease(self) -> None:
        self.flight.lease.acquire("survey", "", take=True, lasts_s=1e6)
        self.flight.stop_for_lease("survey has acquired the lease")

    def shut_down(self) -> None:
        self.flight.prepare_shutdown()

    def update(self) -> None:
        now = self.wire.now
        time_s = now.time_s + UPDATE_S
        later: dict[str, Any] = {
            name: Sample(sample.value, time_s)
            for name in ("armed", "landed", "mode", "estimator", "pose", "velocity")
            if (sample := value_of(now, name)) is not None
        }
        self.wire.now = changed(now, time_s=time_s, heard_s=time_s, updated_s=time_s, **later)
        self.flight.step(self.wire.now)


COMMANDS = ("go", "go_in_two_parts", "set_pose", "cancel_newest", "pause", "lease", "shut_down")


@pytest.fixture(scope="module")
def vehicle() -> Iterator[Vehicle]:
    with stepped() as uav:
        uav.fly(HEIGHT_M)
        yield uav.vehicle


def x_of(manoeuvre: Manoeuvre | None) -> float | None:
    """The place that is a manoeuvre's own."""
    reference = None if manoeuvre is None else manoeuvre.current_reference()
    return reference.position.x if isinstance(reference, Hold) else None


def check(world: World) -> None:
    """Checks what holds whatever was done, once all have returned."""
    flown = world.flown.manoeuvre

    # Each task that is not flown has ended: once, and with a reason. (A future cannot be ended twice: that raises.)
    open_ids = {task.id for task in world.tasks if not task.future.done()}
    assert open_ids == ({flown.task.id} if flown is not None and flown.task is not None else set())
    assert len(world.ended) == len({task.id for task in world.ended})
    for task in world.ended:
        error = task.future.exception()
        assert error is None or isinstance(error, UalError)
        assert not isinstance(error, TaskAbortedError) or error.metadata["by"]
        assert not (task in world.paused and error is None)  # a paused task does not arrive

    # What is flown was sent last, if it was sent at all.
    places = [setpoint.position.x for setpoint in world.wire.sent]
    if (x_m := x_of(flown)) is not None and x_m in places:
        assert places[-1] == x_m

    # What began without the lease does not go on under it.
    if world.flight.lease.info is not None:
        assert flown is None or flown.name in ("lease", "stop")


def at_each_statement(vehicle: Vehicle, prepare: list[str], first: str, second: str) -> Iterator[World]:
    """The worlds in which `first` is interrupted at each of its lines, and `second` then runs to its end."""
    lines_count = interrupted_after = 0
    while interrupted_after <= lines_count:
        world = World(vehicle)
        for name in prepare:
            getattr(world, name)()
        schedule = chain(repeat(0, interrupted_after), repeat(1))
        lines_count = world.interleaving.run([getattr(world, first), getattr(world, second)], schedule)[0]
        interrupted_after += 1
        check(world)
        yield world


SITUATIONS = {
    "it sends": ["set_pose"],
    "it steps": ["go"],
    "it ends": ["go", "update"],
    "it hands over": ["go_in_two_parts", "update"],
    "it does nothing": [],
}
"""Steps of an update, by the situation before."""


@pytest.mark.parametrize("command", ["go", "set_pose"])
@pytest.mark.parametrize("situation", SITUATIONS)
def test_a_command_during_an_update_is_what_is_executed_after(vehicle: Vehicle, situation: str, command: str) -> None:
    for world in at_each_statement(vehicle, SITUATIONS[situation], "update", command):
        assert x_of(world.flown.manoeuvre) == world.newest_x_m


@pytest.mark.parametrize("command", ["go", "set_pose"])
@pytest.mark.parametrize("situation", SITUATIONS)
def test_an_update_during_a_command_changes_nothing(vehicle: Vehicle, situation: str, command: str) -> None:
    for world in at_each_statement(vehicle, SITUATIONS[situation], command, "update"):
        assert x_of(world.flown.manoeuvre) == world.newest_x_m


@pytest.mark.parametrize("situation", ["it steps", "it ends", "it hands over"])
def test_a_task_that_is_paused_during_an_update_continues(vehicle: Vehicle, situation: str) -> None:
    for world in at_each_statement(vehicle, SITUATIONS[situation], "update", "pause"):
        flown = world.flown.manoeuvre
        for task in world.paused:
            assert flown is not None
            assert flown.task is task


@pytest.mark.parametrize("command", COMMANDS)
def test_one_of_two_callers_comes_first(vehicle: Vehicle, command: str) -> None:
    for world in at_each_statement(vehicle, ["go"], "set_pose", command):
        assert world.tasks[0].future.done()


@pytest.mark.parametrize("end", ["lease", "shut_down", "cancel_newest"])
@pytest.mark.parametrize("situation", SITUATIONS)
def test_what_ends_a_task_during_an_update_ends_it(vehicle: Vehicle, situation: str, end: str) -> None:
    for world in at_each_statement(vehicle, SITUATIONS[situation], "update", end):
        assert all(task.future.done() for task in world.tasks)


class Commanding(Scripted):
    """Gives the autopilot a command in its step, `just_before` which another thread does something."""

    def __init__(self, task: VehicleTask, just_before: Callable[[], None]) -> None:
        super().__init__(task, 1.0, 2)
        self._just_before = just_before
        self.acknowledgement: Future[None] = Future()

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        self._just_before()
        self.command = AutopilotCommand("fly the mission")
        self.command.send(lambda: self.acknowledgement)
        return super().step(snapshot, estimate)


@pytest.mark.parametrize("end", ["lease", "shut_down", "set_pose", "nothing"])
def test_what_ends_a_task_as_it_commands_the_autopilot_withdraws_that(vehicle: Vehicle, end: str) -> None:
    """The task had ended before it kept its command: the autopilot flew its mission for nobody."""
    world = World(vehicle)
    world.flown.lock = threading.Lock()
    commanding = Commanding(world._new_task(), getattr(world, end, lambda: None))
    world.flight.begin(commanding, CommandOrigin())
    world.update()
    assert commanding.acknowledgement.cancelled() is (end != "nothing")


class Refitted(Scripted):
    """Ends as the world changes, for which the autopilot is to hold by itself: a take-off that it flies by itself."""

    @override
    def fit(self, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy) -> Step:
        return Step(has_ended=True, error=GeofenceError("this has changed in flight"), is_autopilot_to_hold=True)


@pytest.mark.parametrize("is_taken", [True, False])
def test_the_autopilot_is_not_reported_to_hold_over_a_pilot_who_has_just_taken_over(
    vehicle: Vehicle, is_taken: bool
) -> None:
    """The world changed in the half second in which the cause of the mode is found out."""
    world = World(vehicle)
    world.flown.lock = threading.Lock()
    world.flight.begin(Refitted(world._new_task(), 1.0, 2), CommandOrigin())
    if is_taken:
        pilots = Sample(Mode("LOITER", Control.OTHER), world.wire.now.time_s)
        world.wire.now = changed(world.wire.now, mode=pilots, held_by=Cause.OPEN)
    world.flight.step(world.wire.now)
    assert world.wire.holds_count == (0 if is_taken else 1)


CALLER = st.lists(st.sampled_from(COMMANDS), min_size=1, max_size=3)
BURSTS = st.lists(st.tuples(st.integers(0, 2), st.integers(1, 40)), max_size=20)
"""Threads that go on, and by how many lines."""


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.tuples(CALLER, CALLER), st.integers(1, 4), BURSTS)
def test_whatever_two_callers_do_during_updates(
    vehicle: Vehicle, callers: tuple[list[str], list[str]], updates_count: int, bursts: list[tuple[int, int]]
) -> None:
    world = World(vehicle)

    def do(names: list[str]) -> None:
        for name in names:
            getattr(world, name)()

    actions = [*(partial(do, names) for names in callers), partial(do, ["update"] * updates_count)]
    world.interleaving.run(actions, chain.from_iterable(repeat(thread, count) for thread, count in bursts))
    check(world)
