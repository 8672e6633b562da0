"""Bridge, MAVROS and topics that fail, in flight and on the ground; and the pilot who takes over in each manoeuvre."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise

import pytest

from tests.conftest import LIMIT_S
from tests.simulators.ardupilot import ArduPilot
from tests.simulators.lockstep_mavros import LockstepMavros
from tests.simulators.mavros import Mavros
from tests.simulators.ports import MemoryPort
from tests.simulators.px4 import OFFBOARD, Px4
from tests.simulators.rosbridge import Answer, Message, Service
from tests.waiting import until
from ual.errors import LinkLostError, TaskAbortedError, UalError, UalTimeoutError
from ual.geometry import Pose
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions

LOST_S, HEALED_S = 1.5, 3.0
ATTITUDE_QUATERNION = 31
IN_THE_AIR = (State.FLYING_AUTO, State.FLYING_MANUAL, State.LANDING)
_GOAL = Pose.at(12.0, 6.0, 4.0)


class Flight:
    """A UAV through MAVROS, and the clock of its autopilot."""

    def __init__(self, backend: LockstepMavros, uav: UAL) -> None:
        self.backend = backend
        self.uav = uav

    def now_s(self) -> float:
        return self.backend.clock.now_s()

    def until(self, condition: Callable[[], bool]) -> float:
        """Waits, and returns how long it took by the autopilot's clock."""
        begun_s = self.now_s()
        until(condition, seen=self.uav.telemetry)
        return self.now_s() - begun_s

    def mark(self) -> tuple[int, float]:
        """Now: how many changes of the state there were before the present one, and the time."""
        return max(0, len(self.backend.history) - 1), self.now_s()

    def until_state(self, *states: State, since: tuple[int, float] | None = None) -> float:
        """Waits until one of the states has been seen since a mark, and returns how long after it that was."""
        index, begun_s = self.mark() if since is None else since

        def first_s() -> float | None:
            return next((time_s for time_s, state in self.backend.history[index:] if state in states), None)

        self.until(lambda: first_s() is not None)
        found_s = first_s()
        assert found_s is not None
        return found_s - begun_s

    def fly(self, height_m: float = 3.0) -> None:
        self.backend.autopilot.pilot_readies()
        self.until(self.uav.is_ready)
        self.uav.arm()
        self.uav.take_off(height_m)

    @property
    def setpoints_count(self) -> int:
        return len(self.backend.node.setpoints)


def make(kind: str, ros: int | None = None) -> LockstepMavros:
    port = MemoryPort()
    autopilot = Px4(port, is_terse=True) if kind == "px4" else ArduPilot(port)
    usual = 2 if kind == "px4" else 1
    return LockstepMavros(BackendOptions("uav_1"), autopilot, port, usual if ros is None else ros)


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    backend = make(request.param)
    with UAL(backend, allow_arming=True) as uav:
        yield Flight(backend, uav)


@pytest.fixture
def px4() -> Iterator[Flight]:
    backend = make("px4")
    with UAL(backend, allow_arming=True) as uav:
        yield Flight(backend, uav)


def test_arming_that_a_mavros_took_with_it_is_not_reported_as_refused() -> None:
    """With ROS 1 rosbridge says at once that the call was lost. Whether the autopilot got it is not known."""
    backend = make("px4", 1)
    with UAL(backend, allow_arming=True) as uav:
        backend.autopilot.pilot_readies()
        until(uav.is_ready, "a UAV that is ready", seen=uav.telemetry)
        backend.node.dies_in = "cmd/arming"
        with pytest.raises(
            UalTimeoutError, match="MAVROS has not answered the command to arm, which may still be exec"
        ):
            uav.arm()


def test_a_bridge_that_goes_in_flight_is_reported_and_heals_by_itself(flight: Flight) -> None:
    flight.fly()
    task = flight.uav.go_to_waypoint(_GOAL, blocking=False)
    gone = flight.mark()
    flight.backend.is_bridge_gone = True
    assert flight.until_state(State.UNINITIALIZED, since=gone) < LOST_S
    flight.until(lambda: flight.backend.link().lost_count == 1)
    back = flight.mark()
    flight.backend.is_bridge_gone = False
    assert flight.until_state(*IN_THE_AIR, since=back) < HEALED_S
    with pytest.raises(LinkLostError):
        task.wait(LIMIT_S)
    assert flight.backend.link().lost_count == 1


def test_a_mavros_that_is_killed_and_started_again_is_found_again(
    flight: Flight, caplog: pytest.LogCaptureFixture
) -> None:
    flight.fly()
    gone = flight.mark()
    flight.backend.node.is_gone = True
    assert flight.until_state(State.UNINITIALIZED, since=gone) < LOST_S
    flight.until(lambda: flight.now_s() > gone[1] + 8.0)
    assert flight.backend.snapshot().control.other_sender == ""
    back = flight.mark()
    flight.backend.node.restart()
    flight.backend.node.is_gone = False
    assert flight.until_state(*IN_THE_AIR, since=back) < 2.0 * HEALED_S
    troubles = [
        getattr(each, "ual_fields", {})["why"]
        for each in caplog.records
        if getattr(each, "ual_event", "") == "mavros_trouble"
    ]
    assert len(troubles) == len(set(troubles))


def test_a_daemon_that_finds_a_px4_without_setpoints_takes_control_back() -> None:
    """The daemon before was killed. ROS 1 does not tell that PX4 was asked for OFFBOARD."""
    port = MemoryPort()
    autopilot = Px4(port, is_terse=True)
    first = LockstepMavros(BackendOptions("uav_1"), autopilot, port)
    with UAL(first, allow_arming=True) as uav:
        Flight(first, uav).fly()
    backend = LockstepMavros(BackendOptions("uav_1"), autopilot, port)
    autopilot.intention, autopilot.sticks_s = OFFBOARD, math.inf  # a daemon that is killed leaves it there
    until(lambda: autopilot.failsafe is not None, between=backend.advance)
    with UAL(backend) as uav:
        Flight(backend, uav).until(lambda: "failsafe" in uav.telemetry().state_reason)
        uav.recover_from_manual()
        assert uav.state() is State.FLYING_AUTO


@pytest.mark.parametrize(
    ("topic", "within_s", "text"),
    [
        ("state", 3.0, "whether it is armed"),
        ("extended_state", 2.0, "landed"),
        ("local_position/pose", 1.7, "its pose"),
        ("local_position/velocity_local", 1.6, "velocity"),
        ("imu/data", 1.9, "attitude"),
        ("estimator_status", 3.5, "whether its position is good"),
    ],
)
def test_a_topic_that_stops_is_reported_by_name(px4: Flight, topic: str, within_s: float, text: str) -> None:
    px4.until_state(State.LANDED_DISARMED)
    px4.until(lambda: px4.now_s() > 8.0)
    stopped = px4.mark()
    px4.backend.bridge.faults.silent_topics.add(f"/mavros/{topic}")
    assert px4.until_state(State.UNINITIALIZED, since=stopped) < within_s
    px4.until(lambda: text in px4.uav.telemetry().state_reason)
    px4.backend.bridge.faults.silent_topics.clear()
    px4.until_state(State.LANDED_DISARMED)


@pytest.mark.parametrize(
    "topic", ["sys_status", "battery", "rc/in", "vfr_hud", "timesync_status", "global_position/global"]
)
def test_what_need_not_come_need_not_come(px4: Flight, topic: str) -> None:
    px4.until_state(State.LANDED_DISARMED)
    px4.backend.bridge.faults.silent_topics.add(f"/mavros/{topic}")
    px4.fly(2.0)
    assert px4.uav.telemetry().state is State.FLYING_AUTO


def test_motors_that_a_switch_stops_are_reported_by_the_outputs_where_its_text_is_lost() -> None:
    backend = make("ardupilot")
    with UAL(backend, allow_arming=True) as uav:
        flight = Flight(backend, uav)
        flight.fly(8.0)
        backend.autopilot.is_killed = True
        flight.until(lambda: "has stopped its motors" in uav.telemetry().state_reason)


def record(flight: Flight, name: str) -> list[tuple[float, Message]]:
    """Returns a list that gets the calls of a service from now on, with their times."""
    node, found = flight.backend.node, []
    services = type(node).services.fget  # type: ignore[attr-defined]

    class Recorded(type(node)):  # type: ignore[misc]
        @property
        def services(self) -> Mapping[str, Service]:
            def call(message: Message) -> Answer:
                found.append((flight.now_s(), message))
                return known[f"/mavros/{name}"](message)

            known: Mapping[str, Service] = services(self)
            return {**known, f"/mavros/{name}": call}

    node.__class__ = Recorded
    return found


def record_modes(flight: Flight) -> list[tuple[float, Message]]:
    """Returns a list that gets the modes that MAVROS is asked for from now on."""
    return record(flight, "set_mode")


def test_services_that_never_answer_leave_the_state_true(px4: Flight) -> None:
    px4.backend.bridge.calls_in_new_thread = True  # as docs/reference/backends/mavros.md starts it
    px4.fly()
    names = ("cmd/command", "set_mode", "vehicle_info_get", "param/get_parameters", "set_message_interval")
    px4.backend.bridge.faults.dead_services |= {f"/mavros/{name}" for name in names}
    px4.uav.go_to_waypoint(_GOAL)
    with pytest.raises(UalError):
        px4.uav.land()
    assert px4.uav.telemetry().state is State.FLYING_AUTO
    px4.backend.bridge.faults.dead_services.clear()
    px4.until(lambda: px4.uav.telemetry().state is State.FLYING_AUTO)
    px4.uav.land()


@pytest.mark.parametrize(
    ("kind", "gone"),
    [("px4", "cmd/arming"), ("px4", "set_mode"), ("ardupilot", "cmd/arming"), ("ardupilot", "cmd/takeoff")],
)
def test_a_service_of_mavros_that_is_not_there_is_named(kind: str, gone: str) -> None:
    class Lacking(Mavros):
        @property
        def services(self) -> Mapping[str, Service]:
            return {name: call for name, call in super().services.items() if not name.endswith(gone)}

    backend = make(kind)
    backend.node.__class__ = Lacking
    with UAL(backend, allow_arming=True) as uav, pytest.raises(UalError, match=f"/mavros/{gone}.*does not exist"):
        Flight(backend, uav).fly()


def test_a_call_that_is_never_answered_blocks_no_later_one(px4: Flight) -> None:
    """MAVROS is restarted while one of its services is called: rosbridge waits for the answer without a limit."""
    px4.until(px4.uav.is_ready)
    px4.backend.bridge.faults.dead_services.add("/mavros/cmd/command")
    px4.until(lambda: any(each.is_held_up for each in px4.backend.bridge.sessions))
    px4.backend.bridge.faults.dead_services.clear()
    px4.until_state(State.UNINITIALIZED)  # the connection is made anew
    px4.until_state(State.LANDED_DISARMED)
    px4.backend.autopilot.pilot_readies()
    px4.uav.arm()


def test_an_acknowledgement_that_is_lost_holds_up_no_setpoint(px4: Flight) -> None:
    """MAVROS waits 5 s for it, and rosbridge with ROS 2 executes nothing more of the connection meanwhile."""
    px4.fly()
    task = px4.uav.go_to_waypoint(Pose.at(40.0, 0.0, 5.0), blocking=False)
    lost = px4.mark()
    px4.backend.bridge.faults.slow_services["/mavros/cmd/command"] = 5.0
    px4.until(lambda: px4.now_s() > lost[1] + 7.0)
    sent_s = [time_s for time_s, _ in px4.backend.node.setpoints if time_s > lost[1]]
    assert max(b - a for a, b in pairwise(sent_s)) < 0.5
    task.wait(LIMIT_S)
    assert px4.backend.history[-1][1] is State.FLYING_AUTO
    assert State.FLYING_MANUAL not in [state for _, state in px4.backend.history[lost[0] :]]


def test_a_pilot_who_takes_over_during_a_call_gets_no_setpoint_that_waited(px4: Flight) -> None:
    px4.fly()
    go(px4.uav)
    px4.backend.bridge.faults.slow_services["/mavros/cmd/command"] = 5.0
    px4.until(lambda: any(each.is_held_up for each in px4.backend.bridge.sessions))
    taken = px4.mark()
    px4.backend.autopilot.pilot_take_over()
    told_s = taken[1] + px4.until_state(State.FLYING_MANUAL, since=taken)
    assert told_s - taken[1] < 1.5  # PX4 sends a heartbeat a second, and the call that asks for more is waiting
    px4.until(lambda: px4.now_s() > told_s + 6.0)
    assert not [time_s for time_s, _ in px4.backend.node.setpoints if time_s > told_s + 0.02]


def test_a_mode_is_not_requested_where_the_call_would_wait_until_the_pilot_has_taken_over(px4: Flight) -> None:
    px4.fly()
    modes = record_modes(px4)
    px4.backend.bridge.faults.slow_services["/mavros/cmd/command"] = 5.0
    px4.until(lambda: any(each.is_held_up for each in px4.backend.bridge.sessions))
    task = px4.uav.land(blocking=False)
    asked = px4.mark()
    px4.until(lambda: px4.now_s() > asked[1] + 0.3)
    px4.backend.autopilot.pilot_take_over()
    px4.until_state(State.FLYING_MANUAL, since=asked)
    px4.until(lambda: px4.now_s() > asked[1] + 7.0)
    assert modes == []
    with pytest.raises(UalError):
        task.wait(LIMIT_S)
    assert px4.uav.telemetry().state is State.FLYING_MANUAL


def test_a_landing_that_is_commanded_in_a_short_stall_of_the_bridge_overrules_no_pilot(flight: Flight) -> None:
    """The first sign of life after it may come before the new mode, and with an old one that had waited."""
    flight.fly(6.0)
    modes, node = record_modes(flight), flight.backend.node
    step, stalls_s = node.step, flight.now_s() + 0.02
    has_taken_over: list[bool] = []

    def stall_and_take_over(now_s: float) -> Iterable[tuple[str, Message]]:
        flight.backend.is_stalled = 0.0 <= now_s - stalls_s < 0.74
        if now_s - stalls_s >= 0.38 and not has_taken_over:
            has_taken_over.append(True)
            flight.backend.autopilot.pilot_take_over()
        return step(now_s)

    node.step = stall_and_take_over  # type: ignore[method-assign]
    flight.until(lambda: flight.now_s() >= stalls_s + 0.42)
    with pytest.raises(TaskAbortedError, match="safety pilot"):
        flight.uav.land(blocking=False).wait(LIMIT_S)
    flight.until(lambda: flight.now_s() >= stalls_s + 6.0)
    assert modes == []
    assert flight.uav.telemetry().state is State.FLYING_MANUAL


@pytest.mark.parametrize(("kind", "after_s"), [("px4", 0.1), ("px4", 0.6), ("ardupilot", 0.6)])
def test_a_landing_that_is_commanded_while_mavros_stalls_overrules_no_pilot(kind: str, after_s: float) -> None:
    """The bridge answers, and gets what MAVROS executes after it. What has left just before it said nothing may be."""
    backend = make(kind, 1)
    with UAL(backend, allow_arming=True) as uav:
        it = Flight(backend, uav)
        it.fly(6.0)
        modes, bridge, stalls_s = record_modes(it), backend.bridge, it.now_s()
        bridge.faults.silent_topics |= set(backend.node.topics)
        for service in backend.node.services:
            bridge.occupy(service, stalls_s + 6.0)
        it.until(lambda: it.now_s() >= stalls_s + after_s)
        has_left = it.now_s() < stalls_s + 0.25
        with pytest.raises(LinkLostError, match="if it had left, it may still be executed"):
            uav.land(blocking=False).wait(LIMIT_S)
        backend.autopilot.pilot_take_over()
        it.until(lambda: it.now_s() >= stalls_s + 6.0)
        bridge.faults.silent_topics.clear()
        it.until(lambda: it.now_s() >= stalls_s + 9.0)
        if not has_left:
            assert modes == []
            assert uav.telemetry().state is State.FLYING_MANUAL


def test_a_pilot_who_takes_back_at_once_is_not_overruled(px4: Flight) -> None:
    """PX4 enters OFFBOARD, and the pilot leaves it before PX4 sends a heartbeat unasked."""
    px4.fly()
    px4.backend.autopilot.pilot_take_over()
    px4.until(lambda: px4.uav.telemetry().state is State.FLYING_MANUAL)
    modes, node = record_modes(px4), px4.backend.node
    step = node.step
    taken_s: list[float] = []

    def take_over_after_a_mode(now_s: float) -> Iterable[tuple[str, Message]]:
        if modes and not taken_s and px4.now_s() >= modes[0][0] + 0.06:
            taken_s.append(px4.now_s())
            px4.backend.autopilot.pilot_take_over()
        return step(now_s)

    node.step = take_over_after_a_mode  # type: ignore[method-assign]
    with contextlib.suppress(UalError):
        px4.uav.recover_from_manual()
    px4.until(lambda: bool(taken_s) and px4.now_s() > taken_s[0] + 5.0)
    assert len(modes) == 1
    assert px4.uav.telemetry().state is State.FLYING_MANUAL


def test_topics_that_need_not_come_are_not_requested_in_flight(px4: Flight) -> None:
    """MAVROS executes no mode with ROS 2 while it waits for the acknowledgement of such a request."""
    px4.fly()
    intervals = record(px4, "set_message_interval")
    px4.backend.bridge.faults.silent_topics |= {"/mavros/vfr_hud", "/mavros/imu/data"}
    silent_s = px4.now_s()
    px4.until(lambda: px4.now_s() > silent_s + 6.0)
    assert {message["message_id"] for _, message in intervals} == {ATTITUDE_QUATERNION}


@pytest.mark.parametrize(("kind", "ros"), [("ardupilot", 1), ("ardupilot", 2), ("px4", 2)])
def test_no_streams_are_requested_in_flight_after_a_reconnection(kind: str, ros: int) -> None:
    backend = make(kind, ros)
    with UAL(backend, allow_arming=True) as uav:
        it = Flight(backend, uav)
        it.fly()
        it.until(lambda: backend.autopilot.elapsed_s > 60.0)
        intervals = record(it, "set_message_interval")
        backend.is_bridge_gone = True
        it.until(lambda: uav.telemetry().state is State.UNINITIALIZED)
        backend.is_bridge_gone = False
        it.until(lambda: uav.telemetry().state in IN_THE_AIR)
        back_s = it.now_s()
        it.until(lambda: it.now_s() > back_s + 5.0)
        assert intervals == []


def test_messages_that_come_late_and_out_of_order_are_executed_with(flight: Flight) -> None:
    flight.until(flight.uav.is_ready)
    flight.backend.bridge.faults.delay_s, flight.backend.bridge.faults.jitter_s = 0.03, 0.06
    flight.fly()
    flight.uav.go_to_waypoint(_GOAL)
    assert flight.uav.telemetry().state is State.FLYING_AUTO
    flight.uav.land()


@pytest.mark.parametrize("back_s", [3.0, 9.0])
def test_a_clock_of_the_ros_computer_that_is_set_back_ends_no_flight(px4: Flight, back_s: float) -> None:
    px4.fly()
    task = px4.uav.go_to_waypoint(Pose.at(30.0, 0.0, 4.0), blocking=False)
    index, _ = px4.mark()
    px4.backend.node.clock_error_s = -back_s
    task.wait(LIMIT_S)
    assert {state for _, state in px4.backend.history[index:]} == {State.FLYING_AUTO}


def test_data_that_are_seconds_late_are_no_data(px4: Flight) -> None:
    px4.until_state(State.LANDED_DISARMED)
    px4.until(lambda: px4.now_s() > 8.0)
    late = px4.mark()
    px4.backend.bridge.faults.delay_s = 3.0
    px4.until_state(State.UNINITIALIZED, since=late)


def go(uav: UAL) -> None:
    uav.go_to_waypoint(_GOAL, blocking=False)


def test_a_reboot_is_observed_though_mavros_does_not_notice_it(px4: Flight) -> None:
    px4.until_state(State.LANDED_DISARMED)
    before = px4.backend.snapshot().link.boots_count
    booted = px4.mark()
    px4.backend.autopilot.reboot()
    px4.until_state(State.UNINITIALIZED, since=booted)
    px4.until(lambda: px4.backend.snapshot().link.boots_count != before)


def test_a_wrong_target_system_is_named() -> None:
    backend = make("px4")
    backend.node.target_system = 7
    with UAL(backend) as uav:
        it = Flight(backend, uav)
        it.until(lambda: "tgt_system" in uav.telemetry().status_text)
        assert uav.telemetry().state is State.UNINITIALIZED


def test_a_mavros_that_is_not_there_is_named() -> None:
    backend = make("px4")
    backend.node.is_gone = True
    with UAL(backend) as uav:
        it = Flight(backend, uav)
        it.until(lambda: "does not exist" in uav.telemetry().status_text)


@pytest.mark.parametrize(("kind", "ros"), [("px4", 1), ("ardupilot", 2)])
def test_the_other_ros_flies_as_well(kind: str, ros: int) -> None:
    backend = make(kind, ros)
    with UAL(backend, allow_arming=True) as uav:
        it = Flight(backend, uav)
        it.until(lambda: uav.info().limits.climb_speed_m_s >= 2.0)
        it.fly()
        uav.go_to_waypoint(_GOAL)
        uav.land()


def test_altitudes_are_above_mean_sea_level_again(flight: Flight) -> None:
    flight.until(flight.uav.is_ready)
    flight.until(lambda: flight.backend.snapshot().earth.projection is not None)
    origin = flight.backend.snapshot().earth.projection
    assert origin is not None
    assert origin.altitude_amsl_m == pytest.approx(flight.backend.autopilot.projection.altitude_amsl_m, abs=0.05)
