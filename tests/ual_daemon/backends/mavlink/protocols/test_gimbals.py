"""The gimbals of a vehicle: a manager may be anywhere, lose messages, lie, vanish, and be another program's."""

from __future__ import annotations

import math
import random
from concurrent.futures import Future
from dataclasses import astuple
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.protocols.simulated_gimbal import (
    AUTOPILOT,
    BUSY,
    CAPABILITIES,
    DENIED,
    OURS,
    OWN,
    Bench,
)
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, UalTimeoutError
from ual.geometry import Quaternion, Vector3, wrap_angle
from ual.gimbals import AngleRange, GimbalAbility, GimbalAngles, GimbalControl, GimbalReference, GimbalStatus
from ual.wire import gimbal as wire
from ual_daemon.backends.firmwares.gimbal_protocol import attitude_of, failures_of
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.protocols import gimbal_values
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message

BODY, HORIZON, EARTH = GimbalReference.BODY, GimbalReference.HORIZON, GimbalReference.EARTH
TURN, CONFIGURE = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
IN_VEHICLE, FROM_NORTH = (
    mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME,
    mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME,
)
LOCKED = mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK
DOWN = GimbalAngles(0.0, 0.4, 0.2)


# --- Finding ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dialect", [Px4(), ArduCopter()], ids=["px4", "ardupilot"])
@pytest.mark.parametrize("source", [AUTOPILOT, OWN, MessageSource(7, 191 + 1)])
def test_it_is_found_wherever_its_manager_is(source: MessageSource, dialect: Dialect) -> None:
    bench = Bench(source, dialect)
    link = bench.found()
    info = link.info(bench.now_s)
    assert (info.number, info.is_connected, info.note) == (0, True, "")
    assert info.pitch is not None
    assert info.yaw is not None
    assert astuple(info.pitch) == pytest.approx((-0.5, 1.6))  # up and down change places
    assert astuple(info.yaw) == pytest.approx((-3.2, 3.2))
    assert info.roll is None
    assert {GimbalAbility.PITCH, GimbalAbility.YAW, GimbalAbility.EARTH, GimbalAbility.RETRACT} <= info.abilities
    assert GimbalAbility.ROLL not in info.abilities
    assert (GimbalAbility.BODY in info.abilities) is (source != AUTOPILOT or isinstance(dialect, Px4))


def test_it_is_found_on_a_link_that_loses_every_third_message() -> None:
    for seed in range(10):
        Bench(loss=0.3, seed=seed).found()


def test_a_px4_that_says_that_it_manages_none_is_not_queried() -> None:
    bench = Bench(AUTOPILOT, Px4())
    bench.gimbals._means = bench.gimbals._means._replace(says_manager=lambda: False)
    bench.step(40.0)
    assert bench.requests == []


def test_a_px4_that_sends_the_status_of_a_manager_is_queried() -> None:
    """Its version says that it manages gimbals with MNT_MODE_IN 4, and not with 0 (automatic)."""
    bench = Bench(AUTOPILOT, Px4())
    bench.gimbals._means = bench.gimbals._means._replace(says_manager=lambda: False)
    bench.manager.streamed[mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS] = 0.5
    assert bench.found().manager == AUTOPILOT


def test_one_that_has_none_is_queried_three_times() -> None:
    bench = Bench(AUTOPILOT)
    bench.manager.is_there = False
    bench.step(60.0)
    assert len(bench.requests) == 3


def test_a_camera_with_a_gimbal_is_found_by_its_status() -> None:
    """Cameras are not asked, as they would take the refusal for one of their own requests."""
    bench = Bench(MessageSource(7, 100))
    bench.step(20.0)
    assert bench.gimbals.found == ()
    bench.manager.streamed[mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS] = 1.0
    assert bench.found().manager.component_id == 100


def test_the_attitude_of_a_device_with_a_component_of_its_own_is_taken_from_that() -> None:
    bench = Bench(AUTOPILOT)
    bench.manager.device_id = 154
    bench.step(8.0)
    (link,) = bench.gimbals.found
    assert link.attitude is None  # what the manager says is of another one
    nan = math.nan
    status = mavlink.MAVLink_gimbal_device_attitude_status_message(
        0, 0, 1, IN_VEHICLE, (1.0, 0.0, 0.0, 0.0), nan, nan, nan, 0
    )
    bench.receive(OWN, status)
    assert link.attitude is not None


def test_two_of_one_manager_have_numbers_of_their_own() -> None:
    bench = Bench(AUTOPILOT)
    bench.found()
    bench.manager.device_id = 2
    bench.manager.inform()
    bench.step()
    assert [(each.number, each.device_id) for each in bench.gimbals.found] == [(0, 1)]  # one message finds none
    bench.manager.inform()
    bench.step()
    assert [(each.number, each.device_id) for each in bench.gimbals.found] == [(0, 1), (1, 2)]


# --- Where it looks ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("flags", "reference", "looks"),
    [
        (IN_VEHICLE, HORIZON, (0.0, 30.0, -20.0)),
        (IN_VEHICLE | LOCKED, HORIZON, (0.0, 30.0, -20.0)),
        (0, HORIZON, (0.0, 30.0, -20.0)),
        (FROM_NORTH, EARTH, (0.0, 30.0, 70.0)),
        (LOCKED, EARTH, (0.0, 30.0, 70.0)),
    ],
)
def test_its_flags_say_from_what_its_yaw_counts(
    flags: int, reference: GimbalReference, looks: tuple[float, float, float]
) -> None:
    """It looks 30 degrees down, and 20 degrees to the right of the nose or of north."""
    bench = Bench()
    bench.manager.pointing(0.0, -30.0, 20.0, flags)
    link = bench.found()
    attitude = link.attitude_at(bench.now_s)
    assert attitude is not None
    assert attitude.reference is reference
    assert tuple(map(math.degrees, attitude.orientation.to_euler())) == pytest.approx(looks)


@pytest.mark.parametrize(("kind", "reference"), [(0.0, EARTH), (1.0, BODY), (2.0, HORIZON)])
def test_px4_says_the_angles_of_servos_that_it_steadies_itself(kind: float, reference: GimbalReference) -> None:
    """MNT_DO_STAB: 0 passes on what was ordered, 1 takes the lean off all axes, 2 the heading off yaw."""
    bench = Bench(AUTOPILOT, Px4())
    bench.manager.kind = kind
    bench.manager.pointing(0.0, -30.0, 20.0, LOCKED)
    attitude = bench.found().attitude
    assert attitude is not None
    assert attitude.reference is reference


@pytest.mark.parametrize(("kind", "reference"), [(1.0, BODY), (7.0, HORIZON), (4.0, HORIZON)])
def test_ardupilot_says_the_angles_of_servos_that_it_steadies_itself(kind: float, reference: GimbalReference) -> None:
    """MNT1_TYPE 1 are servos, 7 gimbals that steady themselves: flown with a tilt of 15 degrees."""
    bench = Bench(AUTOPILOT, ArduCopter())
    bench.manager.kind = kind
    attitude = bench.found().attitude
    assert attitude is not None
    assert attitude.reference is reference


def test_where_it_points_is_not_reported_while_its_kind_is_not_known() -> None:
    bench = Bench(AUTOPILOT, ArduCopter())
    bench.manager.kind = None
    bench.step(20.0)
    (link,) = bench.gimbals.found
    assert link.attitude is None
    assert link.info(bench.now_s).note == "its kind is not known yet, so where it looks is not told"
    bench.manager.kind = 1.0
    bench.step(4.0)
    assert link.attitude is not None


def test_where_it_points_is_forgotten_when_it_does_not_say_it_and_requested() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.streamed.clear()
    bench.step(1.5)
    assert link.attitude_at(bench.now_s) is None
    bench.step(2.5)
    assert link.attitude_at(bench.now_s) is not None


def test_one_that_never_says_it_is_queried_ever_less() -> None:
    bench = Bench(AUTOPILOT)
    bench.found()
    bench.manager.is_there = False
    bench.step(300.0)
    before = len(bench.requests)
    bench.step(100.0)
    assert len(bench.requests) - before <= 2 * 11


@pytest.mark.parametrize("q", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0), (9.0, 0.0, 0.0, 0.0)])
def test_an_orientation_that_cannot_be_is_not_reported(q: tuple[float, float, float, float]) -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.q = q
    bench.step()
    assert link.attitude_at(bench.now_s) is None
    assert link.info(bench.now_s).note == "it says an orientation that cannot be"


def test_its_failures_are_reported() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.failures = (
        mavlink.GIMBAL_DEVICE_ERROR_FLAGS_AT_PITCH_LIMIT | mavlink.GIMBAL_DEVICE_ERROR_FLAGS_MOTOR_ERROR
    )
    bench.step()
    assert link.failures == ("its pitch is at a limit", "its motor fails")


@pytest.mark.parametrize(
    ("pitch", "words"),
    [
        ((-90.0, 90.0), "pitch -90 to 90 rad"),
        ((0.0, 0.0), "pitch -0 to -0 rad"),
        ((math.nan, 1.0), "pitch -1 to nan rad"),
    ],
)
def test_limits_that_cannot_be_are_not_used_and_that_is_reported(pitch: tuple[float, float], words: str) -> None:
    bench = Bench()
    bench.manager.limits = (0.0, 0.0, *pitch, -1.0, 2.0)
    info = bench.found().info(bench.now_s)
    assert info.pitch is None
    assert info.yaw == AngleRange(-2.0, 1.0)
    assert info.note == f"its limits cannot be, and are not used: {words}"


# --- Orders -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reference", "yaw_deg", "flags"),
    [
        (HORIZON, math.degrees(-0.2), 4 + 8 + 32),
        (EARTH, math.degrees(math.pi / 2.0 - 0.2), 4 + 8 + 16 + 64),
        (BODY, math.degrees(-0.2), 32),
    ],
)
def test_angles_are_sent_as_mavlink_means_them(reference: GimbalReference, yaw_deg: float, flags: int) -> None:
    bench = Bench()
    link = bench.found()
    bench.ended(lambda future: link.turn(DOWN, reference, future))
    ((command, params),) = bench.manager.orders
    assert command == TURN
    assert params[:2] == pytest.approx((math.degrees(-0.4), yaw_deg))
    assert all(map(math.isnan, params[2:4]))
    assert params[4:] == (flags, 0.0, 1.0)


def test_rates_neutral_and_retracted() -> None:
    bench = Bench()
    link = bench.found()
    bench.ended(lambda future: link.turn_at_rates(0.1, 0.2, future))
    bench.ended(lambda future: link.rest(future, is_retracted=False))
    bench.ended(lambda future: link.rest(future, is_retracted=True))
    rates, neutral, retracted = (params for _, params in bench.manager.orders)
    assert all(map(math.isnan, rates[:2]))
    assert rates[2:4] == pytest.approx((math.degrees(-0.1), math.degrees(-0.2)))
    assert (neutral[4], retracted[4]) == (2.0, 1.0)


def test_a_roll_is_sent_once_the_other_angles_were_accepted() -> None:
    bench = Bench()
    link = bench.found()
    bench.ended(lambda future: link.turn(GimbalAngles(0.3, 0.4, 0.0), HORIZON, future))
    bench.step()
    (aim,) = bench.manager.aims
    w, x, y, z = aim.q
    assert Quaternion(x, y, z, w).to_euler() == pytest.approx((0.3, -0.4, 0.0), abs=1e-6)
    bench.manager.result = DENIED
    with pytest.raises(RejectedByAutopilotError):
        bench.ended(lambda future: link.turn(GimbalAngles(0.3, 0.4, 0.0), HORIZON, future))
    bench.step()
    assert len(bench.manager.aims) == 1


@given(
    roll=st.floats(-1.0, 1.0),
    pitch=st.floats(-1.5, 1.5),
    yaw=st.floats(-3.0, 3.0),
    reference=st.sampled_from([HORIZON, EARTH]),
)
def test_what_is_aimed_at_is_what_is_observed(
    roll: float, pitch: float, yaw: float, reference: GimbalReference
) -> None:
    """A device that does as it is told says the angles that it was told."""
    angles = GimbalAngles(roll, pitch, yaw)
    aim = gimbal_values.aiming(OWN, angles, reference, 1)
    nan = math.nan
    flags = FROM_NORTH if reference is EARTH else IN_VEHICLE
    said = mavlink.MAVLink_gimbal_device_attitude_status_message(0, 0, 1, flags, aim.q, nan, nan, nan, 0)
    found = attitude_of(said.flags, said.q)
    assert found is not None
    orientation, said_reference = found
    assert said_reference is reference
    for axis in (Vector3(1.0), Vector3(0.0, 1.0)):
        assert tuple(orientation.rotate(axis)) == pytest.approx(tuple(angles.orientation.rotate(axis)), abs=1e-6)


def test_it_is_acknowledged_on_a_link_that_loses_every_third_message() -> None:
    for seed in range(20):
        bench = Bench(loss=0.3, seed=seed)
        link = bench.found()
        bench.ended(lambda future, link=link: link.turn(DOWN, HORIZON, future))  # type: ignore[misc]


def test_one_that_answers_twice_answers_no_other_order() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.answers_twice = True
    bench.ended(lambda future: link.turn(DOWN, HORIZON, future))
    bench.manager.ignored = {TURN}
    with pytest.raises(UalTimeoutError, match="did not answer to DO_GIMBAL_MANAGER_PITCHYAW in 10 tries"):
        bench.ended(lambda future: link.turn(DOWN, HORIZON, future))


def test_a_late_answer_to_an_order_that_was_repeated_answers_no_other_one() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.answers_after_s = 0.6  # later than the first repetition
    bench.ended(lambda future: link.turn(DOWN, HORIZON, future))
    bench.manager.ignored = {TURN}
    with pytest.raises(UalTimeoutError):
        bench.ended(lambda future: link.turn(DOWN, HORIZON, future))


def test_one_that_is_busy_without_an_end_is_abandoned() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.result = BUSY
    with pytest.raises(UalTimeoutError, match="was busy"):
        bench.ended(lambda future: link.turn(DOWN, HORIZON, future))


def test_a_newer_order_replaces_the_one_that_waits() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.ignored = {TURN}
    first: Future[None] = Future()
    link.turn(DOWN, HORIZON, first)
    bench.step(0.2)
    bench.manager.ignored = set()
    bench.ended(lambda future: link.rest(future, is_retracted=False))
    with pytest.raises(TaskAbortedError, match="a newer order to gimbal 1 of component 154 has replaced this one"):
        first.result(0)


def test_a_late_answer_to_an_order_that_was_replaced_answers_no_other_one() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.answers_after_s = 0.3
    first: Future[None] = Future()
    link.turn(DOWN, HORIZON, first)
    bench.step(0.2)
    bench.manager.ignored = {TURN}
    with pytest.raises(UalTimeoutError):
        bench.ended(lambda future: link.rest(future, is_retracted=False))
    with pytest.raises(TaskAbortedError):
        first.result(0)


def test_orders_that_replace_one_another_leave_at_once() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.answers_after_s = 0.3
    ordered: list[Future[None]] = []
    for _ in range(10):
        ordered.append(Future())
        link.turn(DOWN, HORIZON, ordered[-1])
        bench.step(0.1)
    assert len(bench.manager.orders) == 10
    bench.step(2.0)
    assert ordered[-1].result(0) is None


# --- Control ----------------------------------------------------------------------------------------------------------


def test_its_control_is_taken_by_our_ids_and_abandoned() -> None:
    """PX4 takes -2, which means the sender, for itself."""
    bench = Bench()
    link = bench.found()
    assert link.control == (GimbalControl.FREE, "")
    bench.ended(link.take)
    assert bench.manager.orders[-1] == (CONFIGURE, (*map(float, OURS), -1.0, -1.0, 0.0, 0.0, 1.0))
    assert link.control == (GimbalControl.OURS, "this daemon")
    bench.ended(link.release)
    assert bench.manager.orders[-1][1][:2] == (-3.0, -3.0)
    assert link.control == (GimbalControl.FREE, "")
    bench.manager.controller = (255, 190)
    bench.step()
    bench.manager.streamed.pop(mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS)
    bench.ended(link.release)  # what is another one's stays so
    assert link.control == (GimbalControl.OTHER, "system 255, component 190")


def test_a_daemon_that_ends_gives_its_control_up_and_its_streams_back() -> None:
    bench = Bench()
    link = bench.found()
    bench.ended(link.take)
    bench.gimbals.release()
    bench.gimbals.drop("the daemon ends")
    bench.deliver()
    assert bench.manager.orders[-1][1][:2] == (-3.0, -3.0)
    assert bench.manager.controller == (0, 0)
    assert set(bench.manager.streamed.values()) == {0.0}


def test_a_daemon_that_ends_leaves_the_control_that_it_never_took() -> None:
    """Another daemon may have the same ids."""
    bench = Bench()
    link = bench.found()
    bench.manager.controller = OURS
    bench.step()
    assert link.control[0] is GimbalControl.OURS
    bench.gimbals.release()
    bench.deliver()
    assert bench.manager.orders == []
    bench.ended(link.take)
    bench.ended(link.release)
    before = list(bench.manager.orders)
    bench.gimbals.release()
    bench.deliver()
    assert bench.manager.orders == before


# --- Vanishing --------------------------------------------------------------------------------------------------------


def test_one_that_vanishes_is_reported_and_not_waited_for() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.is_there = False
    with pytest.raises(LinkLostError, match="is not heard: its last message came"):
        bench.ended(lambda future: link.turn(DOWN, HORIZON, future))
    assert not link.info(bench.now_s).is_connected
    assert link.attitude_at(bench.now_s) is None


def test_one_that_comes_back_has_its_number_and_is_requested_anew() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.is_there = False
    bench.step(10.0)
    bench.manager.is_there = True
    bench.manager.limits = (0.0, 0.0, -1.0, 1.0, -1.0, 1.0)
    bench.step(10.0)
    assert bench.gimbals.found == (link,)
    info = link.info(bench.now_s)
    assert info.is_connected
    assert info.pitch == AngleRange(-1.0, 1.0)


def test_after_a_boot_nothing_of_it_is_believed_from_before() -> None:
    """Its parameters may be others, and it has forgotten its controller. One of its two streams comes at once."""
    bench = Bench(AUTOPILOT, Px4())
    bench.manager.kind = 1.0
    link = bench.found()
    bench.ended(link.take)
    assert (link.control[0], link.meant) == (GimbalControl.OURS, BODY)
    bench.gimbals.drop("the autopilot has booted")
    bench.manager.controller, bench.manager.kind = (0, 0), 2.0
    bench.manager.limits = (0.0, 0.0, -1.0, 1.0, -1.0, 1.0)
    del bench.manager.streamed[mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS]
    control, _ = link.control
    assert control is None
    assert link.attitude_at(bench.now_s) is None
    bench.step(10.0)
    assert (link.control[0], link.meant) == (GimbalControl.FREE, HORIZON)
    assert link.info(bench.now_s).pitch == AngleRange(-1.0, 1.0)


def test_one_that_comes_back_has_forgotten_its_controller() -> None:
    bench = Bench()
    link = bench.found()
    bench.ended(link.take)
    bench.manager.is_there = False
    bench.step(10.0)
    bench.manager.is_there, bench.manager.controller = True, (0, 0)
    del bench.manager.streamed[mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS]
    bench.step(15.0)
    assert link.control[0] is GimbalControl.FREE


def test_what_is_in_progress_ends_with_the_daemon() -> None:
    bench = Bench()
    link = bench.found()
    bench.manager.ignored = {TURN}
    ordered: Future[None] = Future()
    link.turn(DOWN, HORIZON, ordered)
    bench.step(0.2)
    assert bench.gimbals.is_urgent
    bench.gimbals.drop("the daemon ends")
    with pytest.raises(LinkLostError, match="was given up: the daemon ends"):
        ordered.result(0)


def test_answers_that_no_gimbal_gives_crash_nothing_and_each_order_ends() -> None:
    """Reports after such answers can be sent to a client."""
    chance = random.Random(7)
    nasty = (0.0, -1.0, 1.0, 1e38, -1e38, math.nan, math.inf, -math.inf)

    def number() -> float:
        return chance.choice(nasty)

    def message() -> Message:
        device_id, byte = chance.choice((0, 1, 2, 7, 154, 255)), partial(chance.randrange, 256)
        kind = chance.randrange(4)
        if kind == 0:
            limits = [number() for _ in range(6)]
            return mavlink.MAVLink_gimbal_manager_information_message(0, chance.getrandbits(32), device_id, *limits)
        if kind == 1:
            return mavlink.MAVLink_gimbal_manager_status_message(0, 0, device_id, byte(), byte(), byte(), byte())
        if kind == 2:
            q, rates = [number() for _ in range(4)], [number() for _ in range(3)]
            flags = chance.getrandbits(16)
            return mavlink.MAVLink_gimbal_device_attitude_status_message(
                0, 0, 0, flags, q, *rates, flags, 0, 0, device_id
            )
        return mavlink.MAVLink_command_ack_message(chance.choice((TURN, CONFIGURE, 0)), byte())

    bench = Bench(OWN)
    link = bench.found()
    ordered: list[Future[None]] = []
    for i in range(4000):
        bench.receive(chance.choice((OWN, AUTOPILOT, MessageSource(7, 100))), message())
        if i % 100 == 0:
            ordered.append(Future())
            link.turn(DOWN, HORIZON, ordered[-1])
            bench.step()
    bench.step(60.0)
    assert all(each.done() for each in ordered)
    for each in bench.gimbals.found:
        wire.gimbal_info_to_proto(each.info(bench.now_s)).SerializeToString()
        control, words = each.control
        told = GimbalStatus(control=control, controller=words, problems=each.failures)
        wire.gimbal_status_to_proto(told).SerializeToString()


@given(st.integers(0, 2**16 - 1), st.lists(st.floats(width=32), min_size=4, max_size=4), st.integers(0, 2**32 - 1))
def test_whatever_it_says_is_no_defect(flags: int, q: list[float], capabilities: int) -> None:
    nan = math.nan
    said = mavlink.MAVLink_gimbal_device_attitude_status_message(0, 0, 1, flags, q, nan, nan, nan, flags)
    found = attitude_of(said.flags, said.q)
    assert found is None or found[0].norm() == pytest.approx(1.0)
    failures_of(said.failure_flags)
    told = mavlink.MAVLink_gimbal_manager_information_message(1, capabilities, 1, *q, *q[:2])
    identity = gimbal_values.identity_of(told)
    for found_range in (identity.roll, identity.pitch, identity.yaw):
        assert found_range is None or wrap_angle(found_range.least_rad) is not None
    assert CAPABILITIES


# --- One message is no verdict ----------------------------------------------------------------------------------------


def information(device_id: int = 1) -> Message:
    """Returns another program's description of the gimbal: it can do nothing."""
    return mavlink.MAVLink_gimbal_manager_information_message(1, 0, device_id, *(0.0,) * 6)


@pytest.mark.parametrize("source", [AUTOPILOT, OWN])
def test_one_message_changes_no_gimbal_and_finds_none(source: MessageSource) -> None:
    bench = Bench(source)
    link = bench.found()
    info = link.info(bench.now_s)
    bench.receive(source, information())
    assert link.info(bench.now_s) == info
    bench.receive(source, information(3))
    bench.step(4.0)  # it is asked again, and says what it is
    assert link.info(bench.now_s) == info
    assert bench.gimbals.found == (link,)
    assert not link.is_doubtful


def test_a_gimbal_that_becomes_another_one_in_flight_counts_on_the_ground() -> None:
    bench = Bench()
    link = bench.found()
    info = link.info(bench.now_s)
    bench.is_flying = True
    bench.manager.capabilities = mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_NEUTRAL
    bench.manager.inform()
    bench.step(5.0)
    assert link.info(bench.now_s).abilities == info.abilities
    bench.is_flying = False
    bench.step(2.0)
    assert link.info(bench.now_s).abilities < info.abilities
