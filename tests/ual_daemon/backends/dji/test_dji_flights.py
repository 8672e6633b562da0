"""What is DJI's own: control authority, landing confirmation, refusals, the local frame, and what becomes of faults."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import pytest
from typing_extensions import override

import ual
from tests.simulators.dji import P_GPS, STEP_S, OsdkSdkNode
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk, LockstepOsdkVehicle, LockstepPsdk
from tests.simulators.rosbridge import Message, Service
from ual.errors import RejectedByAutopilotError, TaskAbortedError
from ual.geometry import Pose
from ual.types import GpsFix, State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.values import Snapshot

KINDS = (LockstepPsdk, LockstepOsdk, LockstepOsdkVehicle)
LIMIT_S = 60.0


@contextmanager
def ready(kind: type[LockstepDji] = LockstepPsdk, speed: float = 20.0) -> Iterator[tuple[UAL, LockstepDji]]:
    backend = kind(BackendOptions("uav_1"), speed)
    with UAL(backend, allow_arming=True) as uav:
        until(uav.is_ready)
        yield uav, backend


def until(condition: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.002)


def fly(uav: UAL, height_m: float = 3.0) -> None:
    uav.arm()
    uav.take_off(height_m)


@pytest.mark.parametrize("kind", KINDS)
def test_the_pilot_takes_over_at_random_moments(kind: type[LockstepDji]) -> None:
    """100 times in all: told within 0.2 s, and nothing is sent after."""
    noise = random.Random(7)
    with ready(kind) as (uav, backend):
        fly(uav)
        told = record_states(uav, backend)
        for _ in range(34):
            goal = Pose.at(noise.uniform(-20.0, 20.0), noise.uniform(-20.0, 20.0), noise.uniform(3.0, 8.0))
            task = uav.go_to_waypoint(goal, blocking=False)
            wait(backend, noise.uniform(0.05, 1.0))
            with backend.lock:
                told.clear()
                backend.aircraft.pilot_takes_over()
                taken_s = backend.aircraft.now_s
            wait(backend, 0.5)
            assert min(time_s for time_s, state in told if state is State.FLYING_MANUAL) <= taken_s + 0.2
            late = [time_s for time_s, _, _ in backend.aircraft.setpoints if time_s > taken_s + 0.2]
            assert not late
            with pytest.raises(TaskAbortedError, match="safety pilot"):
                task.wait(LIMIT_S)
            uav.recover_from_manual()
        uav.land()


def record_states(uav: UAL, backend: LockstepDji) -> list[tuple[float, State]]:
    """Returns the list to which each update adds the aircraft's time and the state."""
    told: list[tuple[float, State]] = []
    update = backend._on_update
    assert update is not None

    def record(snapshot: Snapshot) -> None:
        update(snapshot)
        told.append((backend.aircraft.now_s, uav.state()))

    backend._on_update = record
    return told


def wait(backend: LockstepDji, seconds: float) -> None:
    """Waits for the aircraft's time to pass."""
    end_s = backend.aircraft.now_s + seconds
    until(lambda: backend.aircraft.now_s >= end_s)


def test_a_landing_is_confirmed_only_when_it_was_asked_for() -> None:
    with ready() as (uav, backend):
        fly(uav)
        with backend.lock:
            backend.aircraft.land()  # another program with our authority
        wait(backend, 8.0)
        assert 0.2 < backend.aircraft.height_m < 0.8
        assert uav.state() is State.LANDING
        with backend.lock:
            backend.aircraft.display = P_GPS
        until(lambda: uav.state() is State.FLYING_AUTO)
        uav.land()
        assert uav.state() is State.LANDED_DISARMED


@pytest.mark.parametrize("kind", [LockstepPsdk, LockstepOsdkVehicle])
def test_a_refusal_is_told_in_the_words_of_the_firmware(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):
        backend.aircraft.refusal = "Could not turn on motors. In a no-fly zone. Error code is: 68719476736"
        with pytest.raises(RejectedByAutopilotError):
            uav.arm()
        until(lambda: "no-fly zone" in backend.snapshot().status_text)


def test_the_end_of_the_daemon_releases_the_authority() -> None:
    with ready() as (uav, backend):
        fly(uav)
    assert backend.aircraft.device == 0
    assert not backend.aircraft.body.is_on_ground


def test_a_flight_that_was_not_commanded_gets_nothing() -> None:
    with ready() as (uav, backend):
        with backend.lock:
            backend.aircraft.obtain()
            backend.aircraft.take_off()
        until(lambda: uav.state() is State.FLYING_AUTO)
        wait(backend, 2.0)
        assert backend.aircraft.setpoints == []
    assert backend.aircraft.device == 4  # another's authority is not released


def test_the_app_that_flies_is_told() -> None:
    with ready() as (uav, backend):
        fly(uav)
        backend.aircraft.device = 1
        until(lambda: uav.state() is State.FLYING_MANUAL)
        held_by = backend.snapshot().held_by
        assert held_by is not None
        assert held_by.value == "ground station"


def test_it_returns_to_the_home_of_the_aircraft() -> None:
    with ready() as (uav, backend):
        fly(uav)
        uav.go_to_waypoint(Pose.at(6.0, 4.0, 5.0))
        uav.return_to_launch()
        north, east, _ = backend.aircraft.body.position
        assert math.hypot(north, east) < 1.0


def test_a_home_that_is_not_set_or_not_near_is_not_used() -> None:
    with ready() as (_, backend):
        until(lambda: backend.snapshot().home_geo is not None)
        backend.aircraft.is_home_set = False
        until(lambda: backend.snapshot().home_geo is None)
        backend.aircraft.is_home_set = True
        until(lambda: backend.snapshot().home_geo is not None)
        backend.aircraft.home_deg = (0.0, 0.0)
        until(lambda: backend.snapshot().home_geo is None)


def test_obstacle_avoidance_that_brakes_is_told() -> None:
    with ready() as (uav, backend):
        fly(uav)
        backend.aircraft.obstacle_front_m = 4.0
        north = Pose.at(0.0, 30.0, 3.0)
        task = uav.go_to_waypoint(north, blocking=False)
        until(lambda: "obstacle avoidance brakes: an obstacle 4.0 m to the front" in backend.snapshot().status_text)
        backend.aircraft.obstacle_front_m = math.inf
        task.wait(LIMIT_S)


def test_rtk_is_used_where_there_is_one() -> None:
    with ready() as (uav, backend):
        backend.aircraft.has_rtk = True
        until(lambda: backend.snapshot().gps is not None and backend.snapshot().gps.fix is GpsFix.RTK_FIXED)  # type: ignore[union-attr]
        assert uav.state() is State.LANDED_DISARMED


def test_a_poor_position_makes_it_uninitialized() -> None:
    with ready() as (uav, backend):
        backend.aircraft.gps_level = 1
        until(lambda: uav.state() is State.UNINITIALIZED)
        backend.aircraft.gps_level = 5
        until(lambda: uav.state() is State.LANDED_DISARMED)


@pytest.mark.parametrize(
    "topic",
    [
        "attitude",
        "gps_position_fused",
        "altitude_sea_level",
        "velocity_ground_fused",
        "flight_status",
        "display_mode",
        "control_mode",
        "gps_control_level",
    ],
)
def test_a_topic_that_stops_is_noticed_and_healed(topic: str) -> None:
    with ready() as (uav, backend):
        fly(uav)
        backend.bridge.faults.silent_topics.add(f"/psdk_ros2/{topic}")
        until(lambda: uav.state() is State.UNINITIALIZED)
        backend.bridge.faults.silent_topics.clear()
        until(lambda: uav.state() is State.FLYING_AUTO)


@pytest.mark.parametrize("topic", ["altitude_sea_level", "velocity_ground_fused"])
def test_a_topic_that_stops_in_a_climb_ends_the_climb(topic: str) -> None:
    with ready() as (uav, backend):
        fly(uav)
        task = uav.go_to_waypoint(Pose.at(0.0, 0.0, 30.0), blocking=False)
        wait(backend, 2.0)
        backend.bridge.faults.silent_topics.add(f"/psdk_ros2/{topic}")
        with pytest.raises(TaskAbortedError):
            task.wait(LIMIT_S)
        wait(backend, 2.0)
        height_m = backend.aircraft.height_m
        wait(backend, 5.0)
        assert backend.aircraft.height_m < height_m + 0.2


class _Beginning(OsdkSdkNode):
    """It publishes before it subscribes and serves."""

    @property
    @override
    def subscriptions(self) -> Mapping[str, tuple[str, Callable[[Message], None]]]:
        return super().subscriptions if self.aircraft.now_s > 3.0 else {}

    @property
    @override
    def services(self) -> Mapping[str, Service]:
        return super().services if self.aircraft.now_s > 4.0 else {}


class _LockstepBeginning(LockstepOsdk):
    front = _Beginning


def test_a_wrapper_that_has_just_begun_is_not_taken_for_another() -> None:
    with ready(_LockstepBeginning) as (uav, backend):
        assert backend.aircraft.now_s > 4.0
        assert uav.info().autopilot == "DJI through dji_osdk_ros (dji_sdk_node)"


def test_a_node_that_goes_and_comes_back() -> None:
    with ready() as (uav, backend):
        fly(uav)
        with backend.lock:
            node = backend.bridge.nodes.pop()
        until(lambda: uav.state() is State.UNINITIALIZED)
        with backend.lock:
            backend.bridge.nodes.append(node)
        until(lambda: uav.state() is State.FLYING_AUTO)
        uav.land()


def test_a_service_that_never_answers_is_judged_by_its_effect() -> None:
    with ready() as (uav, backend):
        backend.bridge.faults.dead_services.add("/psdk_ros2/turn_on_motors")
        with pytest.raises(ual.UalError):
            uav.arm()
        assert uav.state() is State.LANDED_DISARMED


def test_late_and_overtaking_messages_do_not_disturb_a_flight() -> None:
    with ready() as (uav, backend):
        backend.bridge.faults.delay_s, backend.bridge.faults.jitter_s = 0.02, 3 * STEP_S
        fly(uav)
        uav.go_to_waypoint(Pose.at(3.0, 2.0, 4.0))
        uav.land()


@pytest.mark.parametrize("kind", [LockstepOsdk, LockstepOsdkVehicle])
def test_a_pilot_who_lifts_off_by_hand_after_the_motors_were_armed_flies(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):
        uav.arm()
        with backend.lock:
            backend.aircraft.pilot_takes_over()
            backend.aircraft.sticks = (0.0, 0.0, -1.0)
        until(lambda: not backend.aircraft.body.is_on_ground)
        wait(backend, 0.5)
        assert uav.state() is State.FLYING_MANUAL
