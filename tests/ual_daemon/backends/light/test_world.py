from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial

import pytest

from tests.conftest import LIMIT_S
from tests.ual_daemon.backends.light.drone import Drone, hold, velocity
from tests.ual_daemon.stepped import Stepped, at, stepped
from ual.errors import InvalidArgumentError, WrongStateError
from ual.geometry import Twist, TwistStamped, Vector3
from ual.types import Limits, Telemetry
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend, World
from ual_daemon.backends.light.physics import SIM_STEP_S
from ual_daemon.backends.light.world import Thinning
from ual_daemon.backends.values import Snapshot
from ual_daemon.settings import ConfigError


def worlds() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "light-world"]


@contextmanager
def running(world: World, count: int) -> Iterator[list[LightBackend]]:
    with ExitStack() as stack:
        backends = [LightBackend(BackendOptions(f"uav_{i}"), world) for i in range(count)]
        for backend in backends:
            backend.open(lambda _: None)
            stack.callback(backend.close)
        yield backends


# --- Time -------------------------------------------------------------------------------------------------------------


def test_time_that_stands_still_moves_by_steps_only() -> None:
    drone = Drone()
    assert drone.world.now_s() == 0.0
    drone.sim.step(1.0)
    assert drone.world.now_s() == pytest.approx(1.0)
    assert len(drone.snapshots) == 1 + round(1.0 / SIM_STEP_S)
    assert [s.time_s for s in drone.snapshots[1:4]] == pytest.approx([SIM_STEP_S, 2 * SIM_STEP_S, 3 * SIM_STEP_S])
    drone.sim.step(1e-6)
    assert drone.world.now_s() == pytest.approx(1.0 + SIM_STEP_S)


def test_what_has_shown_after_a_command_amid_a_step_is_not_taken_back() -> None:
    """At the end of a daemon a hold showed, and then once more the mode before: it said that it left in flight."""
    options = [BackendOptions(f"uav_{i}", settings={"speed_factor": 0}) for i in range(10)]
    backends = LightBackend.fleet(options, [Vector3(3.0 * i) for i in range(10)])
    first, last, is_due = backends[0], backends[-1], False
    time, pilot = first.simulation(), last.simulation()
    assert time is not None
    assert pilot is not None
    modes: list[str] = []

    def mode(snapshot: Snapshot) -> str:
        return "" if snapshot.control.mode is None else snapshot.control.mode.value.name

    def on_first(_: Snapshot) -> None:
        if is_due:
            pilot.pilot_take_over()
            modes.append(mode(last.snapshot()))

    with ExitStack() as stack:
        first.open(on_first)
        last.open(lambda snapshot: modes.append(mode(snapshot)))
        for each in backends[1:-1]:
            each.open(lambda _: None)
        for each in backends:
            stack.callback(each.close)
        time.step(3 * SIM_STEP_S)
        modes.clear()
        is_due = True
        time.step(SIM_STEP_S)
    assert set(modes) == {"MANUAL"}


def test_a_defect_of_one_vehicle_stops_neither_time_nor_the_others(caplog: pytest.LogCaptureFixture) -> None:
    def fail() -> None:
        raise RuntimeError("a defect of one vehicle")

    world = World(math.inf)
    stepped_on = threading.Event()
    with running(world, 2):
        world.listen(0, fail)
        world.listen(1, lambda: stepped_on.set() if world.steps > 10 else None)
        assert stepped_on.wait(LIMIT_S)
    assert sum(record.exc_info is not None for record in caplog.records) == 1


@pytest.mark.parametrize("duration_s", [0.0, -1.0, math.nan, math.inf, 3601.0])
def test_an_impossible_step_is_refused(duration_s: float) -> None:
    drone = Drone()
    with pytest.raises(InvalidArgumentError, match="duration_s"):
        drone.sim.step(duration_s)
    assert drone.world.now_s() == 0.0


@pytest.mark.parametrize("factor", [-1.0, 100.1, math.nan, -math.inf])
def test_an_impossible_speed_factor_is_refused(factor: float) -> None:
    drone = Drone()
    with pytest.raises(InvalidArgumentError, match="speed_factor"):
        drone.sim.set_speed_factor(factor)
    assert drone.world.speed_factor == 0.0


def test_time_that_runs_by_itself_cannot_be_stepped() -> None:
    world = World(1.0)
    with running(world, 1) as [backend], pytest.raises(WrongStateError, match="set the speed factor to 0"):
        backend.simulation().step(1.0)


@pytest.mark.parametrize("factor", [1.0, 50.0, math.inf])
def test_time_runs_while_anyone_listens_and_stands_otherwise(factor: float) -> None:
    world = World(factor)
    reached = threading.Event()
    backend = LightBackend(BackendOptions("uav_1"), world)
    backend.open(lambda snapshot: reached.set() if snapshot.time_s > 0.2 else None)
    assert reached.wait(LIMIT_S)
    backend.close()
    stopped_s = world.now_s()
    assert not worlds()
    assert world.now_s() == stopped_s


def test_the_speed_can_be_changed_while_it_runs() -> None:
    drone = Drone()
    passed = threading.Event()
    world = drone.world
    world.listen(-1, lambda: passed.set() if world.now_s() % 20.0 < SIM_STEP_S else None)
    for _ in range(5):
        begin_s = world.now_s()
        drone.sim.set_speed_factor(math.inf)
        passed.clear()
        assert passed.wait(LIMIT_S)
        drone.sim.set_speed_factor(0.0)
        stopped_s = world.now_s()
        assert stopped_s > begin_s
        drone.sim.step(1.0)
        assert world.now_s() == pytest.approx(stopped_s + 1.0)
    world.unlisten(-1)


@pytest.mark.parametrize("factor", [1.0, 100.0, math.inf])
def test_what_the_pilot_did_shows_once_his_call_returns(factor: float) -> None:
    with running(World(factor), 1) as [backend]:
        for is_armed, act in 20 * ((True, backend.pilot_arm), (False, backend.pilot_disarm)):
            act()
            armed = backend.snapshot().control.armed
            assert armed is not None
            assert armed.value is is_armed


# --- Threads ----------------------------------------------------------------------------------------------------------


def test_one_thread_runs_any_number_of_vehicles_and_none_is_left_behind() -> None:
    before = threading.active_count()
    for count in (1, 50):
        with running(World(1.0), count):
            assert len(worlds()) == 1
            assert threading.active_count() == before + 1
        assert threading.active_count() == before


def test_it_can_be_closed_from_its_own_update_and_opened_again() -> None:
    world = World(math.inf)
    backend = LightBackend(BackendOptions("uav_1"), world)
    for _ in range(3):
        closed = threading.Event()

        def close_at_once(_: object, closed: threading.Event = closed) -> None:
            if not closed.is_set():
                backend.close()
                closed.set()

        backend.open(close_at_once)
        assert closed.wait(LIMIT_S)
    backend.close()
    for thread in worlds():
        thread.join(LIMIT_S)  # the one that closed itself ends a moment later
    assert not worlds()


def test_no_update_comes_after_close() -> None:
    world = World(math.inf)
    with running(world, 1):
        updates = []
        backend = LightBackend(BackendOptions("uav_2"), world)
        come, later = threading.Event(), threading.Event()

        def update(snapshot: object) -> None:
            updates.append(snapshot)
            come.set()

        backend.open(update)
        assert come.wait(LIMIT_S)
        backend.close()
        count, closed_s = len(updates), world.now_s()
        world.listen(-1, lambda: later.set() if world.now_s() > closed_s + 1.0 else None)
        assert later.wait(LIMIT_S)
        world.unlisten(-1)
        assert len(updates) == count


# --- The same every time ----------------------------------------------------------------------------------------------


def flight(uav: Stepped) -> None:
    uav.fly(3.0)
    uav.prepare.go_to_waypoint(at(4.0, -2.0, 3.0, 2.0)).begin()
    uav.run(2.0)
    uav.end(uav.prepare.follow_path([at(2, 2, 4), at(0, 2, 3), at(0, 0, 3)], corner_radius_m=0.5).begin().future)
    uav.vehicle.commands.setpoints.set_velocity(
        TwistStamped(Twist(Vector3(0.5, 0.5, 0.1), Vector3(0, 0, 0.5)), "uav_1/base_link")
    )
    uav.run(3.0)
    uav.end(uav.prepare.land().begin().future)
    uav.run(5.0)


def reported(seed: int) -> list[Telemetry]:
    """Everything that a flight tells, but what is from outside its world: wall-clock stamps and the names of tasks."""
    light = {"position_noise_m": 0.02, "velocity_noise_m_s": 0.01, "seed": seed, "wind_m_s": [1.0, 0.5, 0.0]}
    with stepped(light=light) as uav:
        uav.update_each_step()
        uav.keep_samples()
        flight(uav)
        return [replace(s, stamp_s=0.0, odometry=None, transform=None, task=None) for s in uav.samples]


def test_two_flights_in_stepped_time_are_the_same_to_the_last_bit() -> None:
    first, second, other = reported(seed=7), reported(seed=7), reported(seed=8)
    assert len(first) > 1000
    assert first == second
    assert first != other


def positions(drone: Drone) -> list[Vector3]:
    return [s.motion.pose.value.position for s in drone.snapshots if s.motion.pose is not None]


def test_vehicles_of_one_world_do_not_disturb_each_other() -> None:
    def fly(drone: Drone) -> None:
        drone.fly(3.0)
        drone.run(4.0, hold(3.0, 4.0, 2.0, 1.0))

    alone = Drone(wind_m_s=[1.0, 0.0, 0.0], position_noise_m=0.01)
    fly(alone)

    world = World(0.0)
    crowd = [Drone(world, f"uav_{i}", seed=i, response_s=0.2 + i / 10, position_noise_m=0.1) for i in range(1, 4)]
    one = Drone(world, wind_m_s=[1.0, 0.0, 0.0], position_noise_m=0.01)
    for other in crowd:
        other.sim.pilot_arm()
        other.backend.take_off(3.0, Limits())
        other.backend.send(velocity(1.0, 1.0, 1.0))
    crowd[0].sim.set_wind(Vector3(20.0, 0.0, 0.0))
    fly(one)
    assert positions(one) == positions(alone)
    assert all(other.true("position")[2] > 0.3 for other in crowd)


def test_a_vehicle_may_join_and_leave_a_world_in_flight() -> None:
    world = World(0.0)
    first = Drone(world)
    first.fly(3.0)
    second = Drone(world, "uav_2", start=[5.0, 5.0, 0.0])
    assert second.true("position")[0] == 5.0
    first.run(1.0, hold(0.0, 0.0, 3.0))
    second.backend.close()
    count = len(second.snapshots)
    first.run(1.0, hold(0.0, 0.0, 3.0))
    assert len(second.snapshots) == count
    assert first.pose.position.z == pytest.approx(3.0, abs=0.02)


# --- Settings ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"speed_factor": 101}, "light.speed_factor"),
        ({"speed_factor": "fast"}, "light.speed_factor"),
        ({"response_s": 0.0}, "light.response_s"),
        ({"battery_percent": 101}, "light.battery_percent"),
        ({"start": [0, 0]}, "light.start"),
        ({"start_yaw_rad": math.nan}, "light.start_yaw_rad"),
        ({"origin_geo": [91, 0, 0]}, "light.origin_geo[0]"),
        ({"seed": 0.5}, "light.seed"),
        ({"sped_factor": 1}, "light.sped_factor"),
    ],
)
def test_a_setting_that_cannot_be_is_refused_by_its_name(settings: dict[str, object], key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        LightBackend(BackendOptions("uav_1", settings=settings))
    assert caught.value.key == key


def test_as_fast_as_it_can_is_called_max() -> None:
    assert LightBackend(BackendOptions("uav_1", settings={"speed_factor": "max"})).world.speed_factor == math.inf


# --- More vehicles than the computer can update -----------------------------------------------------------------------


def test_updates_are_thinned_where_steps_take_too_long_and_come_back_when_they_do_not() -> None:
    thinning = Thinning()

    def run(update_share: float) -> int:
        """Steps for which all updates together take such a part of a step's time."""
        for _ in range(1000):
            thinning.add(0.02 + update_share / thinning.every)
        return thinning.every

    assert run(0.4) == 1
    assert run(1.0) == 2
    assert run(1.0) == 2  # and stays
    assert run(1.7) == 3
    assert run(100.0) == 5
    assert run(1.0) in (2, 3)
    assert run(0.3) == 1


def test_one_long_pause_thins_nothing() -> None:
    thinning = Thinning()
    for _ in range(100):
        thinning.add(0.5)
    assert not thinning.add(1000.0)
    assert thinning.every == 1


def test_thinning_does_not_swing() -> None:
    for tenths in range(60):
        thinning = Thinning()
        found = []
        for _ in range(5000):
            thinning.add(0.02 + 0.1 * tenths / thinning.every)
            found.append(thinning.every)
        assert found == sorted(found)


def test_thinned_updates_alternate_and_changes_are_reported_at_once() -> None:
    world = World(0.0)
    updates: dict[int, list[int]] = {0: [], 1: [], 2: []}

    def note(number: int, snapshot: Snapshot) -> None:
        updates[number].append(snapshot.sequence)

    backends = [LightBackend(BackendOptions(f"uav_{i}"), world) for i in range(3)]
    with ExitStack() as stack:
        for number, backend in enumerate(backends):
            backend.open(partial(note, number))
            stack.callback(backend.close)
        world.step(SIM_STEP_S)
        for steps in updates.values():
            steps.clear()
        for _ in range(9):
            world._step_once(every=3)
        assert sorted(updates[0] + updates[1] + updates[2]) == list(range(2, 11))
        assert all(len(steps) == 3 for steps in updates.values())
        backends[1].pilot_arm()
        for steps in updates.values():
            steps.clear()
        world._step_once(every=1000)
        assert updates == {0: [], 1: [11], 2: []}


# --- Parts of a fleet -------------------------------------------------------------------------------------------------


def fleet_of(part: range) -> list[LightBackend]:
    """A part of a fleet of six, as one of several processes makes it."""
    settings = {"position_noise_m": 0.1, "velocity_noise_m_s": 0.1, "speed_factor": 0.0, "seed": 7}
    options = [BackendOptions(f"uav_{i}", settings=settings) for i in part]
    found = LightBackend.fleet(options, [Vector3(3.0 * i) for i in part], part.start)
    return [each for each in found if isinstance(each, LightBackend)]


def test_what_a_uav_of_a_fleet_measures_does_not_depend_on_who_flies_it() -> None:
    whole, parts = fleet_of(range(6)), [*fleet_of(range(2)), *fleet_of(range(2, 6))]
    snapshots = [
        (one.snapshot().motion.pose, other.snapshot().motion.pose) for one, other in zip(whole, parts, strict=True)
    ]
    assert all(one is not None and other is not None and one.value == other.value for one, other in snapshots)
    assert len({one.value.position for one, _ in snapshots if one is not None}) == 6


def test_the_end_of_one_waits_for_no_step_of_the_others() -> None:
    """Each of a large fleet would wait for a step otherwise, and a step of a large fleet takes long."""
    world = World()
    is_stepping, may_go_on = threading.Event(), threading.Event()

    def long_step(_: Snapshot) -> None:
        is_stepping.set()
        assert may_go_on.wait(LIMIT_S)

    first, *others = (LightBackend(BackendOptions(f"uav_{i}"), world) for i in range(4))
    first.open(long_step)
    for other in others:
        other.open(lambda _: None)
    assert is_stepping.wait(LIMIT_S)
    for other in others:
        closing = threading.Thread(target=other.close)
        closing.start()
        closing.join(LIMIT_S)
        assert not closing.is_alive()
    may_go_on.set()
    first.close()


def test_the_end_of_one_waits_for_its_own_callback() -> None:
    with running(World(math.inf), 2) as [one, _]:
        is_called, has_returned = threading.Event(), threading.Event()

        def note(_: Snapshot) -> None:
            has_returned.clear()
            is_called.set()
            has_returned.set()

        one.close()
        one.open(note)
        assert is_called.wait(LIMIT_S)
        one.close()
        assert has_returned.is_set()


def test_an_update_that_fails_ends_neither_the_world_nor_the_updates_of_others(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def fail(_: Snapshot) -> None:
        raise RuntimeError("a defect of the layers above")

    options = [BackendOptions(ns, settings={"speed_factor": 0}) for ns in ("uav_1", "uav_2")]
    first, second = LightBackend.fleet(options, [Vector3(), Vector3(2.0)])
    assert isinstance(first, LightBackend)
    updates: list[Snapshot] = []
    first.open(fail)
    second.open(updates.append)
    first.world.step(0.1)
    assert len(updates) == 5
    assert sum("a defect of the layers above" in str(record.exc_info) for record in caplog.records) == 1
    first.close()
    second.close()


# --- Time that falls behind -------------------------------------------------------------------------------------------


def test_time_that_falls_behind_is_reported_once_per_doubling_and_in_health(caplog: pytest.LogCaptureFixture) -> None:
    world = World(0.0)
    backend = LightBackend(BackendOptions("uav_1"), world)
    epoch_s = world.epoch_s
    for _ in range(40):  # to 4 s
        world._fall_behind(0.1)
    told = [each for each in caplog.records if "simulated_time_behind" in each.getMessage()]
    assert len(told) == 3
    health = backend.snapshot().condition.health
    assert health is not None
    assert health.failing_checks == ("simulated time is 4.0 s behind",)
    assert (health.is_ready_to_arm, world.epoch_s) == (True, epoch_s)
    world.set_speed_factor(0.0)
    assert world.lag_s == 0.0


def test_stamps_skip_ahead_and_the_flight_does_not() -> None:
    world = World(0.0, skips_lag=True)
    backend = LightBackend(BackendOptions("uav_1"), world)
    before, epoch_s = backend.snapshot(), world.epoch_s
    world._fall_behind(0.4)
    assert world.epoch_s == epoch_s
    world._fall_behind(0.4)
    after = backend.snapshot()
    assert world.epoch_s - epoch_s == pytest.approx(0.8)
    assert world.lag_s == 0.0
    assert (after.time_s, after.motion.pose, world.steps) == (before.time_s, before.motion.pose, 0)
    assert after.motion.stamp_s == pytest.approx(before.motion.stamp_s + 0.8)
