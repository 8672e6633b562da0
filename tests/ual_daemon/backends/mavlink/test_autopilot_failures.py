"""The simulated autopilots fall, as a motor dies, a switch stops them, or a station disarms them in the air."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import LIMIT_S
from tests.simulators import ArduPilot, Px4, ardupilot, px4
from tests.simulators.ardupilot import GUIDED, STABILIZE
from tests.simulators.autopilot import Sticks
from tests.simulators.mission_store import Sender
from tests.simulators.px4 import LOITER
from tests.ual_daemon.backends.mavlink.test_autopilot_arming import selected_after_our_arming
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from tests.ual_daemon.backends.mavlink.test_autopilot_own_missions import at, landing, start
from ual.errors import TaskAbortedError, UalTimeoutError, WrongStateError
from ual.geometry import Twist, TwistStamped, Vector3
from ual.interface import Task
from ual.types import State, Telemetry
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.values import Cause

FALLS = ("dies", "killed")
BACK_S = 4.0


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    try:
        yield flight
    finally:
        flight.uav.close()


def climb(flight: Flight, height_m: float = 8.0) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.wait_for(flight._is_take_off_planned, "what a take-off needs")
    flight.uav.take_off(height_m)


def break_it(flight: Flight, how: str, *, ends: bool = False) -> None:
    if how == "killed":
        flight.autopilot.kill(not ends)
    else:
        flight.autopilot.has_thrust = ends


def height_m(flight: Flight) -> float:
    return flight.autopilot.body.ground_z_m - flight.autopilot.body.position[2]


def begin(flight: Flight, what: str) -> Task | None:
    uav = flight.uav
    if what == "go_to":
        task = uav.go_to_waypoint(flight.goal(60.0, 0.0), blocking=False)
        flight.wait_for(lambda: uav.velocity().twist.linear.norm() > 1.0, "its speed")
        return task
    if what == "mission":
        task = uav.task(start(flight, [at(flight, 60.0, 0.0, 8.0), at(flight, 90.0, 0.0, 8.0)]))
        flight.wait_for(lambda: "mission" in uav.telemetry().state_reason, "its mission")
        flight.let_pass(1.0)
        return task
    if what == "land":
        task = uav.land(blocking=False)
        flight.wait_for(lambda: uav.velocity().twist.linear.z < -0.3, "its descent")
        return task
    if what == "velocity":
        uav.vehicle.subscribe(lambda _: stream(flight))
        flight.wait_for(lambda: uav.velocity().twist.linear.norm() > 1.0, "its speed")
    return None


def stream(flight: Flight) -> None:
    with suppress(WrongStateError):  # refused once it does not follow
        flight.uav.set_velocity(Twist(Vector3(1.5, 0.0, 0.0)))


@pytest.mark.parametrize("how", FALLS)
@pytest.mark.parametrize("what", ["hold", "go_to", "mission", "land"])
def test_a_fall_is_reported_within_a_second_and_nothing_climbs_when_its_cause_ends(
    flight: Flight, what: str, how: str
) -> None:
    climb(flight)
    task = begin(flight, what)
    broken_s = flight.now_s
    break_it(flight, how)
    told_s = flight.first_s(lambda telemetry: "does not follow" in telemetry.state_reason, broken_s)
    assert told_s - broken_s < 1.3  # the heartbeat comes once a second
    flight.let_pass(0.5)
    in_air = [telemetry.state for time_s, telemetry in flight.seen if broken_s <= time_s < broken_s + 0.8]
    assert State.LANDED_ARMED not in in_air  # it stood still before, but in the air
    if task is not None:
        with pytest.raises(TaskAbortedError, match="does not follow"):
            task.wait(LIMIT_S)
    with pytest.raises(WrongStateError):
        flight.uav.go_to_waypoint(flight.goal(1.0, 0.0))
    flight.let_pass(BACK_S)
    assert height_m(flight) == 0.0
    break_it(flight, how, ends=True)
    ends_s = flight.now_s
    highest_m = 0.0
    while flight.now_s < ends_s + 6.0:
        highest_m = max(highest_m, height_m(flight))
        flight.let_pass(0.1)
    assert highest_m < 0.3
    flight.wait_for_state(State.LANDED_DISARMED)


@pytest.mark.parametrize("how", FALLS)
def test_a_fall_in_a_take_off_ends_it_and_nothing_climbs_when_its_cause_ends(flight: Flight, how: str) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.wait_for(flight._is_take_off_planned, "what a take-off needs")
    task = flight.uav.take_off(12.0, blocking=False)
    flight.wait_for(lambda: height_m(flight) > 5.0, "its climb")
    break_it(flight, how)
    with pytest.raises(TaskAbortedError, match="does not follow"):
        task.wait(LIMIT_S)
    flight.let_pass(BACK_S)
    break_it(flight, how, ends=True)
    ends_s = flight.now_s
    while flight.now_s < ends_s + 6.0:
        assert height_m(flight) < 0.3
        flight.let_pass(0.1)


def test_a_take_off_without_thrust_ends_in_a_landing_on_the_spot_and_nothing_rises_when_it_is_back(
    flight: Flight,
) -> None:
    """A real PX4 was held where it stood, and rose by 0.85 m."""
    flight.wait_for_state(State.LANDED_DISARMED)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    flight.wait_for(flight._is_take_off_planned, "what a take-off needs")
    break_it(flight, "dies")
    with pytest.raises(UalTimeoutError, match="is to land on the spot now") as caught:
        flight.uav.take_off(5.0)
    assert caught.value.metadata["by"] == "no way"
    ended_s = flight.now_s
    break_it(flight, "dies", ends=True)
    while flight.now_s < ended_s + 6.0:
        assert height_m(flight) < 0.05
        flight.let_pass(0.1)
    flight.wait_for_state(State.LANDED_DISARMED)
    assert flight.uav.telemetry().state_reason == "not armed"


def test_a_fall_in_a_flight_that_our_arming_has_begun_is_ended_without_a_task() -> None:
    flight = Flight("px4")
    try:
        selected_after_our_arming(flight)
        flight.wait_for(lambda: height_m(flight) > 2.0, "its climb")
        broken_s = flight.now_s
        break_it(flight, "dies")
        flight.first_s(lambda telemetry: "does not follow" in telemetry.state_reason, broken_s)
        flight.let_pass(BACK_S)
        break_it(flight, "dies", ends=True)
        ends_s = flight.now_s
        while flight.now_s < ends_s + 6.0:
            assert height_m(flight) < 0.3
            flight.let_pass(0.1)
    finally:
        flight.uav.close()


@pytest.mark.parametrize("what", ["land", "go_to", "mission that lands"])
def test_disarmed_in_the_air_is_no_landing(flight: Flight, what: str) -> None:
    climb(flight)
    if what == "mission that lands":
        items = [at(flight, 4.0, 0.0, 8.0), landing(flight, 4.0, 0.0)]
        task: Task | None = flight.uav.task(start(flight, items))
        flight.wait_for(lambda: flight.uav.velocity().twist.linear.z < -0.3, "its descent")
    else:
        task = begin(flight, what)
    assert task is not None
    disarmed_s = flight.now_s
    assert flight.autopilot.pilot_disarm(is_forced=True)
    with pytest.raises(TaskAbortedError, match="disarmed"):
        task.wait(LIMIT_S)
    flight.first_s(lambda telemetry: "disarmed in the air" in telemetry.state_reason, disarmed_s)
    flight.wait_for(lambda: flight.uav.telemetry().state_reason.startswith("not armed"), "that it lies still")
    assert height_m(flight) == 0.0


def restarted_without_motors(flight: Flight) -> None:
    """The motors are stopped in a hover, while no daemon runs; the next one starts once it lies on the ground."""
    climb(flight)
    flight.kill()
    flight.autopilot.kill()
    flight.autopilot.run(3.0)
    flight.start()


def test_a_daemon_that_is_new_tells_that_the_motors_are_stopped(flight: Flight) -> None:
    """ArduPilot says it once only, by a text: the daemon said FLYING_AUTO, and took a go-to, which climbed."""
    restarted_without_motors(flight)
    told_s = flight.first_s(lambda telemetry: "does not follow" in telemetry.state_reason, flight.started_s)
    seen_s = flight.first_s(lambda telemetry: telemetry.state is not State.UNINITIALIZED, flight.started_s)
    assert told_s - seen_s < (2.0 if isinstance(flight.autopilot, ArduPilot) else 8.5)  # PX4 had begun to land
    with pytest.raises(WrongStateError, match="stopped"):
        flight.uav.go_to_waypoint(flight.goal(1.0, 0.0))
    with pytest.raises(WrongStateError, match="stopped"):
        flight.uav.recover_from_manual()
    assert flight.commands_since(flight.started_s) == set()


@pytest.mark.parametrize("what", ["hold", "land"])
@pytest.mark.parametrize("fallen_s", [0.2, 3.0])
def test_a_daemon_that_is_new_refuses_motions_from_when_the_autopilot_tells_that_its_motors_are_stopped(
    flight: Flight, what: str, fallen_s: float
) -> None:
    """The watch of the motion needs a look more, and in a landing up to 8 s. Until then a go-to was accepted."""
    climb(flight, 20.0)
    begin(flight, what)
    flight.kill()
    flight.autopilot.kill()
    flight.autopilot.run(fallen_s)
    flight.start()
    refusals: list[str | None] = []

    def ask(telemetry: Telemetry) -> None:
        """Plans a motion, in each update that has the autopilot's word."""
        is_known = telemetry.state is not State.UNINITIALIZED
        if is_known and flight.backend.snapshot().control.failsafe is Cause.TERMINATION:
            refusals.append(refusal_of_motion(flight))

    flight.uav.vehicle.subscribe(ask)
    flight.wait_for(lambda: len(refusals) > 50, "a while after it is told")
    assert all(each is not None and "stopped" in each for each in refusals), refusals


def refusal_of_motion(flight: Flight) -> str | None:
    """Returns why a motion is refused; None where one is possible."""
    try:
        flight.uav.vehicle.commands.plan(TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)), ""))
    except WrongStateError as error:
        return str(error)
    return None


def test_a_daemon_that_is_new_does_not_arm_what_falls_after_it_was_disarmed_in_the_air(flight: Flight) -> None:
    """Only a fall of 6 m/s was one to it: below that the UAV may be carried."""
    climb(flight, 60.0)
    flight.kill()
    assert flight.autopilot.pilot_disarm(is_forced=True)
    flight.autopilot.run(0.3)
    flight.start()
    refusals: list[WrongStateError] = []

    def arm(telemetry: Telemetry) -> None:
        if telemetry.state is State.LANDED_DISARMED and not refusals:
            with pytest.raises(WrongStateError, match=r"the UAV falls at \d+ m/s; it is armed again") as caught:
                flight.uav.vehicle.commands.arm()
            refusals.append(caught.value)

    flight.uav.vehicle.subscribe(arm)
    flight.wait_for(lambda: bool(refusals), "a refusal in the first update that has a state")
    assert mavlink.MAV_CMD_COMPONENT_ARM_DISARM not in flight.commands_since(flight.started_s)
    flight.wait_for(lambda: flight.uav.telemetry().state_reason == "not armed" and height_m(flight) == 0.0, "its rest")
    flight.uav.arm()


def test_a_daemon_that_is_new_takes_no_take_off_of_what_was_armed_again_in_its_fall() -> None:
    """A real ArduCopter fell at 8 m/s, on the ground by its own word, and the take-off began."""
    flight = Flight("ardupilot")
    try:
        climb(flight, 60.0)
        flight.kill()
        assert flight.autopilot.pilot_disarm(is_forced=True)
        flight.autopilot.has_thrust = False
        assert flight.autopilot.pilot_arm()
        flight.autopilot.run(0.3)
        flight.start()
        refusals: list[str] = []

        def take_off(telemetry: Telemetry) -> None:
            if telemetry.state is State.LANDED_ARMED and not refusals:
                with pytest.raises(WrongStateError, match=r"take_off: the UAV falls at \d+ m/s") as caught:
                    flight.uav.take_off(3.0, blocking=False)
                refusals.append(caught.value.metadata["state"])

        flight.uav.vehicle.subscribe(take_off)
        flight.wait_for(lambda: bool(refusals), "a refusal in the first update that has a state")
        assert refusals == [State.LANDED_ARMED.name]
        assert flight.commands_since(flight.started_s) == set()
    finally:
        flight.uav.close()


def test_a_daemon_that_is_new_takes_no_motion_after_the_motors_were_stopped_until_it_is_disarmed() -> None:
    flight = Flight("ardupilot")
    try:
        restarted_without_motors(flight)
        flight.first_s(lambda telemetry: "does not follow" in telemetry.state_reason, flight.started_s)
        flight.autopilot.kill(False)
        flight.wait_for(lambda: "had stopped its motors" in flight.uav.telemetry().state_reason, "that they turn")
        with pytest.raises(WrongStateError, match="had stopped its motors"):
            flight.uav.go_to_waypoint(flight.goal(1.0, 0.0))
        assert flight.commands_since(flight.started_s) == set()
        flight.wait_for(lambda: "still now" in flight.uav.telemetry().state_reason, "that it stands")
        with pytest.raises(WrongStateError, match="may lie on the ground: land it"):
            flight.uav.recover_from_manual()
        flight.wait_for(lambda: flight.uav.telemetry().state_reason == "not armed", "that it is disarmed")
        flight.uav.arm()
    finally:
        flight.uav.close()


def assert_only_a_landing_is_accepted(flight: Flight) -> None:
    """PX4 lifted off 2.8 m/s sideways: in the air as it takes itself to be, it flies to any pose."""
    uav, goal = flight.uav, flight.goal(3.0, 0.0, 2.0)
    motions: tuple[Callable[[], object], ...] = (
        uav.recover_from_manual,
        partial(uav.go_to_waypoint, goal),
        partial(uav.set_pose, goal),
        partial(uav.set_velocity, Twist(Vector3(1.0, 0.0, 0.0))),
        uav.return_to_launch,
    )
    asked_s = flight.now_s
    for motion in motions:
        with pytest.raises(WrongStateError) as caught:
            motion()
        assert "lie" in str(caught.value) or caught.value.metadata["needed"] == State.FLYING_AUTO.name
    assert flight.commands_since(asked_s) == set()
    flight.uav.land(blocking=False)
    flight.wait_for_state(State.LANDING)


@pytest.fixture
def never_lands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both take what has fallen to be in the air for as long as anything of it turns."""
    monkeypatch.setattr(px4, "_LANDED_S", math.inf)
    monkeypatch.setattr(ardupilot, "_LANDED_S", math.inf)


@pytest.mark.usefixtures("never_lands")
def test_what_has_fallen_takes_no_motion_while_it_may_lie_on_the_ground() -> None:
    """Once its landing on the spot has ended, as PX4 chose a mode by itself, the control could be asked back."""
    flight = Flight("px4")
    try:
        climb(flight)
        break_it(flight, "dies")
        flight.wait_for_state(State.LANDING)
        flight.wait_for(lambda: height_m(flight) == 0.0, "its impact")
        break_it(flight, "dies", ends=True)
        flight.let_pass(2.0)
        assert isinstance(flight.autopilot, Px4)
        assert flight.autopilot.request_mode(LOITER)
        flight.wait_for_state(State.FLYING_MANUAL)
        flight.wait_for(lambda: "it may lie on the ground" in flight.uav.telemetry().state_reason, "that it may lie")
        assert_only_a_landing_is_accepted(flight)
    finally:
        flight.uav.close()


@pytest.mark.usefixtures("never_lands")
def test_a_daemon_that_is_new_takes_no_motion_of_what_may_lie_on_the_ground() -> None:
    """The daemon said just that it was in the air, and after recover_from_manual it lifted off by any motion."""
    flight = Flight("px4")
    try:
        climb(flight)
        flight.uav.go_to_waypoint(flight.goal(15.0, 0.0))  # above its home PX4 lands
        flight.autopilot.has_thrust = False
        flight.wait_for(lambda: height_m(flight) == 0.0, "its impact")
        flight.kill()
        flight.autopilot.run(3.0)
        flight.start()
        flight.wait_for_state(State.FLYING_MANUAL)
        flight.wait_for(lambda: "may lie there" in flight.uav.telemetry().state_reason, "that it may lie")
        assert_only_a_landing_is_accepted(flight)
    finally:
        flight.uav.close()


def test_a_daemon_that_is_new_takes_none_also_where_the_autopilot_takes_its_references() -> None:
    flight = Flight("ardupilot")
    try:
        climb(flight)
        flight.kill()
        flight.autopilot.has_thrust = False
        flight.autopilot.run(1.3)
        flight.start()
        flight.first_s(
            lambda told: told.state is State.FLYING_AUTO and "may lie there" in told.state_reason, flight.started_s
        )
        assert_only_a_landing_is_accepted(flight)
    finally:
        flight.uav.close()


def select(flight: Flight, mode: int) -> None:
    assert isinstance(flight.autopilot, ArduPilot)
    with flight.autopilot.lock:
        flight.autopilot.set_mode(mode)


def drop_by_hand(flight: Flight) -> None:
    """The pilot takes over and drops it. With the throttle above its lowest ArduCopter calls itself in the air."""
    select(flight, STABILIZE)
    flight.wait_for_state(State.FLYING_MANUAL)
    flight.autopilot.has_thrust = False
    flight.wait_for(lambda: height_m(flight) == 0.0, "its impact")
    flight.autopilot.has_thrust = True
    flight.wait_for(lambda: "may lie there" in flight.uav.telemetry().state_reason, "that it may lie")


@pytest.mark.usefixtures("never_lands")
def test_a_uav_that_its_pilot_has_dropped_takes_no_motion_once_control_is_returned() -> None:
    """A real ArduCopter was lifted off by the go-to of a client 0.1 s later, as UAL had seen its take-off."""
    flight = Flight("ardupilot")
    try:
        climb(flight)
        drop_by_hand(flight)
        select(flight, GUIDED)
        flight.wait_for_state(State.FLYING_AUTO)
        assert_only_a_landing_is_accepted(flight)
    finally:
        flight.uav.close()


@pytest.mark.usefixtures("never_lands")
def test_a_uav_that_its_pilot_has_lifted_again_takes_motions() -> None:
    flight = Flight("ardupilot")
    try:
        climb(flight)
        drop_by_hand(flight)
        flight.autopilot.pilot_moves(Sticks(up=0.5))
        flight.wait_for(lambda: height_m(flight) > 1.5, "its climb")
        flight.autopilot.pilot_moves(Sticks())
        select(flight, GUIDED)
        flight.wait_for_state(State.FLYING_AUTO)
        flight.uav.go_to_waypoint(flight.goal(1.0, 0.0))
    finally:
        flight.uav.close()


def test_a_daemon_that_is_new_flies_on_what_hovers_low() -> None:
    """Higher than what may lie at the height of its home."""
    flight = Flight("px4")
    try:
        climb(flight, 1.2)
        flight.kill()
        flight.start()
        flight.wait_for_state(State.FLYING_AUTO, State.FLYING_MANUAL)
        flight.uav.go_to_waypoint(flight.goal(1.0, 0.0))
    finally:
        flight.uav.close()


VELOCITY_ONLY = 0b010111000111
OTHER = mavlink.MAVLink_set_position_target_local_ned_message(
    0, 1, 1, 1, VELOCITY_ONLY, 0.0, 0.0, 0.0, 3.0, -3.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0
)


def another_sends_too(flight: Flight, each: int = 1) -> None:
    """Another program sends a velocity right after each setpoint of ours, or after one in `each`."""
    handlers, count = flight.autopilot._handlers, itertools.count()
    ours = handlers[mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED]

    def both(message: Message, sender: Sender) -> None:
        ours(message, sender)
        OTHER.target_system = flight.autopilot.system_id
        if next(count) % each == 0:
            ours(OTHER, sender)

    handlers[mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED] = both


@pytest.mark.parametrize("each", [1, 3])
@pytest.mark.parametrize("what", ["hold", "go_to", "velocity"])
def test_another_sender_is_named_within_a_second_by_the_target_that_the_autopilot_tells(
    flight: Flight, what: str, each: int
) -> None:
    climb(flight)
    begin(flight, what)
    begun_s = flight.now_s
    another_sends_too(flight, each)
    told_s = flight.first_s(lambda telemetry: "another program sends" in telemetry.state_reason, begun_s)
    assert told_s - begun_s < 1.0


@pytest.mark.parametrize("what", ["hold", "go_to", "velocity"])
def test_another_sender_of_setpoints_is_reported_within_a_second_of_the_path_that_it_drags(
    flight: Flight, what: str
) -> None:
    climb(flight)
    task = begin(flight, what)
    begun_s = flight.now_s
    another_sends_too(flight)
    told_s = flight.first_s(lambda telemetry: "another sender" in telemetry.state_reason, begun_s)
    assert told_s - begun_s < 2.0
    if task is not None:
        with pytest.raises(TaskAbortedError, match="another sender"):
            task.wait(LIMIT_S)
    with pytest.raises(WrongStateError, match="another sender"):
        flight.uav.go_to_waypoint(flight.goal(1.0, 0.0))
