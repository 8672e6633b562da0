"""Peculiarities of DJI: control authority, landing confirmation, refusals, the local frame, and the handling of
faults.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import pytest
from typing_extensions import override

from tests.simulators.dji import AUTO_LANDING, P_GPS, STEP_S, Aircraft, OsdkSdkNode, OsdkVehicleNode, Psdk
from tests.simulators.dji_node import OneThreadBridge
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk, LockstepOsdkVehicle, LockstepPsdk
from tests.simulators.rosbridge import Message, RefusedError, Service
from tests.waiting import LIMIT_S, until
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual.geometry import Pose
from ual.types import GpsFix, Limits, State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.rosbridge.url import BridgeUrl
from ual_daemon.backends.rosbridge.websocket import BridgeTransport
from ual_daemon.backends.values import Snapshot

KINDS = (LockstepPsdk, LockstepOsdk, LockstepOsdkVehicle)


@contextmanager
def ready(kind: type[LockstepDji] = LockstepPsdk, speed: float = 20.0) -> Iterator[tuple[UAL, LockstepDji]]:
    backend = kind(BackendOptions("uav_1"), speed)
    with UAL(backend, allow_arming=True) as uav:
        until(uav.is_ready)
        yield uav, backend


def fly(uav: UAL, height_m: float = 3.0) -> None:
    uav.arm()
    uav.take_off(height_m)


def record_states(uav: UAL, backend: LockstepDji) -> list[tuple[float, State]]:
    """Returns the list to which each update adds the aircraft's time and the state."""
    told: list[tuple[float, State]] = []
    update = backend._loop.on_update
    assert update is not None

    def record(snapshot: Snapshot) -> None:
        update(snapshot)
        told.append((backend.aircraft.now_s, uav.state()))

    backend._loop.on_update = record
    return told


def wait(backend: LockstepDji, seconds: float) -> None:
    """Waits for the aircraft's time to pass."""
    end_s = backend.aircraft.now_s + seconds
    until(lambda: backend.aircraft.now_s >= end_s)


def test_a_landing_is_confirmed_only_when_it_was_requested() -> None:
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


@contextmanager
def refused_landing(backend: LockstepDji) -> Iterator[None]:
    """The aircraft refuses to land."""

    def refuse() -> None:
        raise RefusedError

    land, backend.aircraft.land = backend.aircraft.land, refuse  # type: ignore[method-assign]
    yield
    backend.aircraft.land = land  # type: ignore[method-assign]


def begin_landing_of_others(backend: LockstepDji) -> None:
    with backend.lock:
        aircraft = backend.aircraft
        aircraft.display, aircraft._confirmed, aircraft._hold = AUTO_LANDING, False, None


def test_a_landing_that_was_refused_is_not_confirmed_when_the_pilot_lands() -> None:
    with ready() as (uav, backend):
        fly(uav)
        with refused_landing(backend), pytest.raises(RejectedByAutopilotError):
            uav.land()
        with backend.lock:
            backend.aircraft.pilot_takes_over()
        until(lambda: uav.state() is State.FLYING_MANUAL)
        begin_landing_of_others(backend)
        wait(backend, 8.0)
        assert backend.aircraft.confirmations_count == 0


def test_a_landing_that_the_pilot_ended_confirms_no_later_one() -> None:
    with ready() as (uav, backend):
        fly(uav, 5.0)
        task = uav.land(blocking=False)
        wait(backend, 1.5)
        with backend.lock:
            backend.aircraft.pilot_takes_over()
        with pytest.raises(TaskAbortedError, match="safety pilot"):
            task.wait(LIMIT_S)
        with backend.lock:
            backend.aircraft.obtain()  # another program
            backend.aircraft.land()
        wait(backend, 12.0)
        assert backend.aircraft.confirmations_count == 0
        assert 0.2 < backend.aircraft.height_m < 0.8


def test_a_landing_that_was_replaced_by_control_is_not_confirmed() -> None:
    with ready() as (uav, backend):
        fly(uav, 5.0)
        backend.land(Limits()).result(LIMIT_S)
        until(lambda: uav.state() is State.LANDING)
        with backend.lock:
            backend.aircraft.display = P_GPS
        backend.take_control().result(LIMIT_S)
        begin_landing_of_others(backend)
        wait(backend, 8.0)
        assert backend.aircraft.confirmations_count == 0


def test_a_landing_that_is_commanded_again_and_refused_goes_on() -> None:
    with ready() as (uav, backend):
        fly(uav)
        uav.land(blocking=False)
        until(lambda: backend.aircraft.display == AUTO_LANDING)
        with refused_landing(backend), pytest.raises(RejectedByAutopilotError):
            backend.land(Limits()).result(LIMIT_S)
        until(lambda: uav.state() is State.LANDED_DISARMED)


def test_a_landing_with_a_silence_in_it_is_confirmed_after_it() -> None:
    with ready() as (uav, backend):
        fly(uav)
        uav.land(blocking=False)
        until(lambda: uav.state() is State.LANDING)
        backend.bridge.faults.silent_topics.update(backend.bridge.nodes[0].topics)
        wait(backend, 5.0)
        assert backend.aircraft.confirmations_count == 0
        backend.bridge.faults.silent_topics.clear()
        until(lambda: uav.state() is State.LANDED_DISARMED)


def test_a_landing_with_a_long_silence_in_it_may_be_that_of_others() -> None:
    with ready() as (uav, backend):
        fly(uav)
        uav.land(blocking=False)
        until(lambda: uav.state() is State.LANDING)
        backend.bridge.faults.silent_topics.update(backend.bridge.nodes[0].topics)
        wait(backend, 12.0)
        backend.bridge.faults.silent_topics.clear()
        until(lambda: uav.state() is State.LANDING)
        until(lambda: "the landing was given up" in backend.snapshot().condition.status_text)
        wait(backend, 5.0)
        assert backend.aircraft.confirmations_count == 0
        assert 0.2 < backend.aircraft.height_m < 0.8


def test_authority_that_was_abandoned_is_not_released_again() -> None:
    with ready() as (uav, backend):
        fly(uav)
        backend.hold().result(LIMIT_S)
        until(lambda: uav.state() is State.FLYING_MANUAL)
        backend.aircraft.obtain()  # another program
    assert backend.aircraft.device == 4


@pytest.mark.parametrize("topic", ["height_above_ground", "display_mode", "control_mode"])
def test_what_is_old_confirms_no_landing(topic: str) -> None:
    with ready() as (uav, backend):
        fly(uav)
        asked_s: list[float] = []

        def refuse() -> None:
            asked_s.append(backend.aircraft.now_s)
            raise RefusedError

        backend.aircraft.confirm_landing = refuse  # type: ignore[method-assign]
        uav.land(blocking=False)
        until(lambda: len(asked_s) >= 3)  # it is asked again and again
        backend.bridge.faults.silent_topics.add(f"/psdk_ros2/{topic}")
        silent_s = backend.aircraft.now_s
        wait(backend, 5.0)
        assert asked_s[-1] <= silent_s + 2.0


def test_the_vehicle_node_is_never_blocked_by_a_landing() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        bridge = backend.bridge
        assert isinstance(bridge, OneThreadBridge)
        fly(uav)
        task = uav.land(blocking=False)
        until(lambda: uav.state() is State.LANDING)
        longest = 0
        while uav.state() is State.LANDING:
            longest = max(longest, bridge.waiting_count)
            wait(backend, STEP_S)
        assert longest == 0
        task.wait(LIMIT_S)
        assert uav.state() is State.LANDED_DISARMED
        assert backend.aircraft.device == 4
    assert backend.aircraft.device == 0


def test_the_pilot_ends_a_landing_by_velocities() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav)
        task = uav.land(blocking=False)
        wait(backend, 1.5)
        with backend.lock:
            backend.aircraft.pilot_takes_over()
            taken_s = backend.aircraft.now_s
        with pytest.raises(TaskAbortedError, match="safety pilot"):
            task.wait(LIMIT_S)
        wait(backend, 3.0)
        assert uav.state() is State.FLYING_MANUAL
        assert not [time_s for time_s, _, _ in backend.aircraft.setpoints if time_s > taken_s + 0.2]


def test_a_landing_that_is_held_above_the_ground_asks_for_the_pilot() -> None:
    with ready(LockstepOsdkVehicle) as (uav, backend):
        fly(uav)
        backend.aircraft.protects_landing = True
        task = uav.land(blocking=False)
        until(lambda: "lands it by hand" in task.info().description)
        assert uav.state() is State.LANDING


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (LockstepPsdk, "no-fly zone"),
        (LockstepOsdk, "ack_data 1; DJI's reason is on the console of the node"),
        (LockstepOsdkVehicle, "DJI's reason is on the console of the node"),
    ],
)
def test_a_refusal_is_reported_in_the_words_of_the_firmware(kind: type[LockstepDji], text: str) -> None:
    with ready(kind) as (uav, backend):
        backend.aircraft.refusal = "Could not turn on motors. In a no-fly zone. Error code is: 68719476736"
        with pytest.raises(RejectedByAutopilotError, match=text):
            uav.arm()


def test_the_aircraft_itself_is_queried_whether_its_motors_start() -> None:
    with ready() as (uav, backend):
        backend.aircraft.motor_error = 1
        until(lambda: "compass" in str(backend.snapshot().condition.health))
        backend.aircraft.refusal = "Could not turn on motors"
        text = "motor start error 1: the compass.*it said: Could not turn on motors"
        with pytest.raises(RejectedByAutopilotError, match=text):
            uav.arm()
        backend.aircraft.refusal = ""
        uav.arm()
        assert uav.state() is State.LANDED_ARMED


def test_what_was_logged_is_reported_for_a_while() -> None:
    with ready() as (uav, backend):
        backend.aircraft.refusal = "In a no-fly zone"
        with pytest.raises(RejectedByAutopilotError):
            uav.arm()
        assert "no-fly zone" in backend.snapshot().condition.status_text
        wait(backend, 11.0)
        assert backend.snapshot().condition.status_text == ""


class _Breaking(LockstepPsdk):
    """The bridge can be ended."""

    is_gone = False

    @override
    def _connect(self, url: BridgeUrl, wait: Callable[[], None]) -> BridgeTransport:
        transport = super()._connect(url, wait)
        receive, send = transport.receive, transport.send

        def receive_or_fail(timeout_s: float) -> Sequence[str | bytes]:
            found = receive(timeout_s)
            self._check()
            return found

        def send_or_fail(text: bytes, *, is_perishable: bool = False) -> bool:
            self._check()
            return send(text, is_perishable=is_perishable)

        transport.receive, transport.send = receive_or_fail, send_or_fail  # type: ignore[method-assign]
        return transport

    def _check(self) -> None:
        if self.is_gone:
            raise ConnectionResetError("the bridge is gone")


def test_a_command_without_a_link_says_that_the_link_is_lost() -> None:
    with ready(_Breaking) as (_, backend):
        backend.is_gone = True  # type: ignore[attr-defined]
        with pytest.raises((LinkLostError, UalTimeoutError), match=r"may still be executed|gone"):
            backend.land(Limits()).result(LIMIT_S)
        until(lambda: not backend._link.is_up)
        for command in (backend.arm, backend.take_control, backend.hold):
            with pytest.raises(LinkLostError, match="gone"):
                command().result(LIMIT_S)


def without(topic: str) -> type[LockstepPsdk]:
    """The wrapper without a topic."""

    class Lacking(Psdk):
        def __init__(self, aircraft: Aircraft) -> None:
            super().__init__(aircraft)
            del self._kinds[f"{self.prefix}{topic}"]

    class LockstepLacking(LockstepPsdk):
        front = Lacking

    return LockstepLacking


@pytest.mark.parametrize(
    "topic", ["attitude", "altitude_sea_level", "gps_position_fused", "velocity_ground_fused", "gps_control_level"]
)
def test_a_topic_of_the_position_that_is_missing_is_named_in_the_state(topic: str) -> None:
    backend = without(topic)(BackendOptions("uav_1"), 20.0)
    with UAL(backend, allow_arming=True) as uav:
        until(lambda: f"nobody publishes /psdk_ros2/{topic}" in uav.telemetry().state_reason)
        assert f"nobody publishes /psdk_ros2/{topic}" in uav.telemetry().status_text
        assert uav.state() is State.UNINITIALIZED


@pytest.mark.parametrize("topic", ["flight_status", "display_mode", "control_mode"])
def test_a_topic_of_the_state_that_is_missing_is_named(topic: str) -> None:
    backend = without(topic)(BackendOptions("uav_1"), 20.0)
    with UAL(backend, allow_arming=True) as uav:
        until(lambda: f"nobody publishes /psdk_ros2/{topic}" in uav.telemetry().status_text)


def test_a_topic_that_has_stopped_is_named_until_it_comes() -> None:
    with ready() as (_, backend):
        backend.bridge.faults.silent_topics.add("/psdk_ros2/attitude")
        until(lambda: backend.snapshot().condition.status_text == "nothing comes on /psdk_ros2/attitude")
        wait(backend, 5.0)
        assert backend.snapshot().condition.status_text == "nothing comes on /psdk_ros2/attitude"
        backend.bridge.faults.silent_topics.clear()
        until(lambda: backend.snapshot().condition.status_text == "")


def test_the_end_of_the_daemon_releases_the_authority() -> None:
    with ready() as (uav, backend):
        fly(uav)
    assert backend.aircraft.device == 0
    assert not backend.aircraft.body.is_on_ground


def test_authority_that_the_pilot_took_is_not_released_in_the_flight_of_another() -> None:
    with ready() as (uav, backend):
        fly(uav)
        with backend.lock:
            backend.aircraft.pilot_takes_over()
        until(lambda: uav.state() is State.FLYING_MANUAL)
        backend.aircraft.obtain()  # another program
        until(lambda: uav.state() is State.FLYING_AUTO)
    assert backend.aircraft.device == 4


@pytest.mark.parametrize("kind", KINDS)
def test_authority_is_released_after_a_landing(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):
        fly(uav)
        uav.land()
        wait(backend, 1.0)
    assert backend.aircraft.device == 0


@pytest.mark.parametrize("kind", [LockstepOsdk, LockstepOsdkVehicle])
def test_authority_that_was_observed_lost_is_not_released(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):
        fly(uav)
        with backend.lock:
            backend.aircraft.pilot_takes_over()
        until(lambda: uav.state() is State.FLYING_MANUAL)
        backend.aircraft.obtain()  # another program
    assert backend.aircraft.device == 4


@pytest.mark.parametrize("kind", KINDS)
def test_authority_is_released_where_the_rest_of_a_command_is_refused(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, backend):

        def refuse() -> None:
            raise RefusedError

        backend.aircraft.start_motors = refuse  # type: ignore[method-assign]
        with pytest.raises(RejectedByAutopilotError):
            uav.arm()
        until(lambda: backend.aircraft.device == 0)


class _WithoutJoystick(OsdkVehicleNode):
    """It refuses the mode in which it takes velocities."""

    @property
    @override
    def services(self) -> Mapping[str, Service]:
        return {**super().services, "/set_joystick_mode": lambda _: {"result": False}}


class _LockstepWithoutJoystick(LockstepOsdkVehicle):
    front = _WithoutJoystick


def test_authority_is_released_where_velocities_are_refused() -> None:
    with ready(_LockstepWithoutJoystick) as (uav, backend):
        with pytest.raises(RejectedByAutopilotError):
            uav.arm()
        until(lambda: backend.aircraft.device == 0)


def test_a_flight_that_was_not_commanded_gets_nothing() -> None:
    with ready() as (uav, backend):
        with backend.lock:
            backend.aircraft.obtain()
            backend.aircraft.take_off()
        until(lambda: uav.state() is State.FLYING_AUTO)
        wait(backend, 2.0)
        assert backend.aircraft.setpoints == []
    assert backend.aircraft.device == 4  # another's authority is not released


def test_the_app_that_flies_is_reported() -> None:
    with ready() as (uav, backend):
        fly(uav)
        backend.aircraft.device = 1
        until(lambda: uav.state() is State.FLYING_MANUAL)
        held_by = backend.snapshot().control.held_by
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
        until(lambda: backend.snapshot().earth.home_geo is not None)
        backend.aircraft.is_home_set = False
        until(lambda: backend.snapshot().earth.home_geo is None)
        backend.aircraft.is_home_set = True
        until(lambda: backend.snapshot().earth.home_geo is not None)
        backend.aircraft.home_deg = (0.0, 0.0)
        until(lambda: backend.snapshot().earth.home_geo is None)


def test_obstacle_avoidance_that_brakes_is_reported() -> None:
    with ready() as (uav, backend):
        fly(uav)
        backend.aircraft.obstacle_front_m = 4.0
        north = Pose.at(0.0, 30.0, 3.0)
        task = uav.go_to_waypoint(north, blocking=False)
        until(
            lambda: (
                "obstacle avoidance brakes: an obstacle 4.0 m to the front" in backend.snapshot().condition.status_text
            )
        )
        backend.aircraft.obstacle_front_m = math.inf
        task.wait(LIMIT_S)
        until(lambda: backend.snapshot().condition.status_text == "")


def test_rtk_is_used_where_there_is_one() -> None:
    with ready() as (uav, backend):
        backend.aircraft.has_rtk = True
        until(lambda: (gps := backend.snapshot().condition.gps) is not None and gps.fix is GpsFix.RTK_FIXED)
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


@pytest.mark.parametrize("kind", KINDS)
def test_it_takes_off_again_after_a_landing(kind: type[LockstepDji]) -> None:
    with ready(kind) as (uav, _):
        for _ in range(3):
            fly(uav)
            uav.go_to_waypoint(Pose.at(1.0, 1.0, 3.0))
            uav.land()


@contextmanager
def thread_paused(backend: LockstepDji) -> Iterator[None]:
    """Keeps the thread that hears the aircraft from running while the block runs."""
    blocked, go_on = threading.Event(), threading.Event()
    update = backend._loop.on_update
    assert update is not None

    def block(snapshot: Snapshot) -> None:
        blocked.set()
        assert go_on.wait(LIMIT_S)
        update(snapshot)

    backend._loop.on_update = block
    assert blocked.wait(LIMIT_S)
    yield
    backend._loop.on_update = update
    go_on.set()


class _BreaksOnce(LockstepPsdk):
    """The connection breaks once, while the backend subscribes."""

    is_broken = False

    @override
    def _connect(self, url: BridgeUrl, wait: Callable[[], None]) -> BridgeTransport:
        transport = super()._connect(url, wait)
        send = transport.send

        def break_once(text: bytes, *, is_perishable: bool = False) -> bool:
            if not self.is_broken and b'"subscribe"' in text and b"psdk_ros2/display_mode" in text:
                self.is_broken = True
                raise ConnectionResetError
            return send(text, is_perishable=is_perishable)

        transport.send = break_once  # type: ignore[method-assign]
        return transport


def test_a_connection_that_breaks_in_the_first_subscription_is_healed() -> None:
    with ready(_BreaksOnce) as (uav, backend):
        assert backend.is_broken  # type: ignore[attr-defined]
        fly(uav)


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
