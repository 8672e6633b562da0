"""Commands to a Crazyflie, its two commanders, and what its supervisor forbids."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.simulators.crazyflie import REST_Z_M, Crazyflie, Supervisor
from tests.simulators.faults import BadLink, Faults
from tests.simulators.ports import MemoryPort
from tests.ual_daemon.backends.crazyflie.flights import LIMITS, FlightTrace, current_position
from ual.errors import RejectedByAutopilotError
from ual.geometry import Pose, Quaternion, Vector3
from ual.types import State
from ual_daemon.backends.crazyflie import packets
from ual_daemon.backends.crazyflie.commander import NOTIFICATIONS, Commander, Phase
from ual_daemon.backends.crazyflie.encoder import rest
from ual_daemon.backends.crazyflie.packets import HIGH_LEVEL, SETPOINT, CrtpPacket
from ual_daemon.backends.crazyflie.requests import CrtpRequests
from ual_daemon.backends.values import Control, ExternalPose, LandedState, VelocitySetpoint

PROTOCOLS = pytest.mark.parametrize("protocol", [7, 12])


def made(protocol: int = 7, *, arms_itself: bool = False) -> Crazyflie:
    return Crazyflie(MemoryPort(), protocol=protocol, arms_itself=arms_itself)


def setpoints(flown: FlightTrace, since_s: float) -> int:
    return sum(p.port == SETPOINT and p.channel == 0 and t >= since_s for t, p in flown.crazyflie.received)


@PROTOCOLS
def test_arms_and_disarms(tmp_path: Path, protocol: int) -> None:
    flown = FlightTrace(tmp_path, made(protocol))
    flown.ready()
    flown.arm()
    assert flown.estimate().state is State.LANDED_ARMED
    flown.end(flown.backend.disarm())
    assert flown.estimate().state is State.LANDED_DISARMED


@pytest.mark.parametrize(
    ("trouble", "text"),
    [
        ("is_tumbled", "it is tumbled"),
        ("is_crashed", "it has crashed"),
        ("locked", "it is locked"),
        ("charging", "it is charging"),
    ],
)
def test_refuses_to_arm_in_plain_words(tmp_path: Path, trouble: str, text: str) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    if trouble == "locked":
        flown.crazyflie.supervisor = Supervisor.LOCKED
    elif trouble == "charging":
        flown.crazyflie.power_state = 1
    else:
        setattr(flown.crazyflie, trouble, True)
    flown.run(0.3)
    with pytest.raises(RejectedByAutopilotError, match=text):
        flown.arm()
    health = flown.backend.snapshot().condition.health
    assert health is not None
    assert text in "; ".join(health.failing_checks)
    assert text in flown.backend.snapshot().condition.status_text


def test_arms_again_soon_after_it_was_disarmed_on_landing(tmp_path: Path) -> None:
    """The firmware refuses for 3 s after a landing, until its supervisor has left the state landed."""
    flown = FlightTrace(tmp_path)
    flown.take_off(0.5)
    flown.end(flown.backend.land(LIMITS))
    flown.until(lambda: flown.crazyflie.supervisor is Supervisor.LANDED)
    flown.end(flown.backend.disarm())
    flown.arm()


def test_is_not_locked_by_being_disarmed_as_soon_as_it_has_landed(tmp_path: Path) -> None:
    """The firmware locks what is disarmed while its supervisor says "flying", which it does for 2 s after a landing."""
    flown = FlightTrace(tmp_path)
    flown.take_off(0.5)
    flown.end(flown.backend.land(LIMITS))
    flown.until(lambda: flown.landed is LandedState.ON_GROUND)
    flown.end(flown.backend.disarm())
    assert flown.crazyflie.supervisor is not Supervisor.LOCKED
    flown.arm()


@pytest.mark.parametrize("hovers_by_itself", [True, False])
def test_it_hovers_by_itself_when_no_setpoints_come(tmp_path: Path, hovers_by_itself: bool) -> None:
    """Nobody above sends while a value is missing, and a silence of 2 s would stop the motors."""
    flown = FlightTrace(tmp_path, hovers_by_itself=hovers_by_itself)
    flown.take_off()
    flown.fly(lambda t: current_position(0.5 * t, 0.0, 1.0), 2.0)
    flown.run(5.0)
    assert flown.crazyflie.supervisor is Supervisor.FLYING
    assert flown.crazyflie.current_position[2] == pytest.approx(1.0, abs=0.1)
    flown.fly(lambda _: current_position(0.0, 0.0, 1.0), 4.0)
    assert flown.crazyflie.current_position == pytest.approx((0.0, 0.0, 1.0), abs=0.05)


def test_a_refusal_of_the_firmware_ends_the_command(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    flown.crazyflie.supervisor = Supervisor.CRASHED  # a state that its bits do not show
    with pytest.raises(RejectedByAutopilotError, match="the firmware refused"):
        flown.arm()


def test_a_withdrawn_command_is_not_sent_again(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.ready()
    flown.crazyflie.ignored = {13}
    future = flown.backend.arm()
    flown.run(0.3)
    future.cancel()
    flown.crazyflie.ignored = set()
    flown.run(1.0)
    assert not flown.crazyflie.is_armed


def test_is_not_disarmed_in_the_air(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    with pytest.raises(RejectedByAutopilotError, match="not on the ground"):
        flown.end(flown.backend.disarm())
    assert flown.crazyflie.is_armed


def test_a_firmware_that_arms_itself_says_so(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path, made(arms_itself=True))
    flown.ready()
    assert flown.estimate().state is State.LANDED_ARMED
    with pytest.raises(RejectedByAutopilotError, match="arms itself"):
        flown.end(flown.backend.disarm())


def test_a_position_where_it_stays_is_held_without_the_daemon(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda _: current_position(0.0, 0.0, 1.0), 1.5)
    mode = flown.backend.snapshot().control.mode
    assert mode is not None
    assert (mode.value.name, mode.value.control) == ("hover (high-level commander)", Control.REFERENCES)
    since_s = flown.now_s
    flown.fly(lambda _: current_position(0.0, 0.0, 1.0), 1.0)
    assert setpoints(flown, since_s) == 0
    flown.crazyflie.is_silent = True  # the daemon is killed
    flown.run(20.0)
    assert flown.crazyflie.current_position == pytest.approx((0.0, 0.0, 1.0), abs=0.05)


def test_it_flies_on_from_a_hover_at_the_next_setpoint(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda _: current_position(0.0, 0.0, 1.0), 1.5)
    flown.fly(lambda _: current_position(0.6, 0.0, 1.0), 0.2)
    assert setpoints(flown, flown.now_s - 0.2) >= 9
    flown.fly(lambda _: current_position(0.6, 0.0, 1.0), 4.0)
    assert flown.crazyflie.current_position == pytest.approx((0.6, 0.0, 1.0), abs=0.05)


def test_without_hovering_by_itself_setpoints_go_on(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path, hovers_by_itself=False)
    flown.take_off()
    since_s = flown.now_s
    flown.fly(lambda _: current_position(0.0, 0.0, 1.0), 2.0)
    assert setpoints(flown, since_s) >= 95


def test_setpoints_go_on_if_the_high_level_commander_does_not_answer(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.crazyflie.ignored = {HIGH_LEVEL}
    flown.fly(lambda _: current_position(0.0, 0.0, 1.0), 5.0)
    assert flown.crazyflie.supervisor is Supervisor.FLYING
    assert flown.crazyflie.current_position[2] == pytest.approx(1.0, abs=0.05)


def test_a_daemon_killed_in_motion_is_followed_by_the_firmwares_time_outs(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda t: current_position(0.5 * t, 0.0, 1.0, 0.0), 1.0)
    flown.crazyflie.is_silent = True
    flown.run(1.0)
    assert flown.crazyflie.supervisor.value == "warningLevelOut"
    flown.run(2.0)
    assert flown.crazyflie.supervisor.value == "locked"
    flown.crazyflie.is_silent = False
    flown.until(lambda: flown.estimate().state is State.LANDED_DISARMED)
    assert "it is locked" in flown.backend.snapshot().condition.status_text


def test_a_daemon_that_is_back_in_time_catches_it(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda t: current_position(0.5 * t, 0.0, 1.0), 1.0)
    flown.restart_daemon()
    flown.until(lambda: flown.estimate().state is State.FLYING_AUTO, 1.5)
    x, y, z = flown.crazyflie.current_position
    flown.fly(lambda _: current_position(x, y, z), 3.0)
    assert flown.crazyflie.supervisor is Supervisor.FLYING


@pytest.mark.parametrize("faults", [Faults(), Faults(loss=0.3)], ids=["good", "lossy"])
def test_holds_by_itself_until_control_is_taken(tmp_path: Path, faults: Faults) -> None:
    flown = FlightTrace(tmp_path, faults=faults)
    flown.take_off()
    flown.fly(lambda t: current_position(0.5 * t, 0.0, 1.0), 1.0)
    flown.end(flown.backend.hold())
    flown.until(lambda: flown.estimate().state is State.FLYING_MANUAL, 1.0)
    since_s = flown.now_s
    flown.fly(lambda _: current_position(5.0, 0.0, 1.0), 3.0)  # ignored
    assert setpoints(flown, since_s) == 0
    x, _, z = flown.crazyflie.current_position
    assert abs(x) < 1.5
    assert z == pytest.approx(1.0, abs=0.1)
    flown.end(flown.backend.take_control())
    flown.fly(lambda _: current_position(0.0, 0.0, 1.0), 0.5)
    assert flown.estimate().state is State.FLYING_AUTO


@PROTOCOLS
def test_lands_by_itself(tmp_path: Path, protocol: int) -> None:
    flown = FlightTrace(tmp_path, made(protocol))
    flown.take_off()
    flown.end(flown.backend.land(LIMITS))
    flown.until(lambda: flown.estimate().state is State.LANDING, 0.2)
    flown.until(lambda: flown.landed is LandedState.ON_GROUND)
    assert flown.crazyflie.current_position[2] == pytest.approx(0.014, abs=0.02)
    flown.until(lambda: flown.estimate().state is State.LANDED_DISARMED)


@pytest.mark.parametrize("table_m", [0.0, 0.7, -0.3])
def test_next_to_where_it_stood_it_lands_on_what_is_there(tmp_path: Path, table_m: float) -> None:
    """Off a table, beside it on the same floor, and onto a box."""
    begin_z = REST_Z_M + max(0.0, table_m)
    flown = FlightTrace(tmp_path, Crazyflie(MemoryPort(), start=(0.0, 0.0, begin_z)))
    flown.take_off()
    flown.fly(lambda t: current_position(min(1.0, 0.5 * t), 0.0, begin_z + 1.0), 4.0)
    floor_z = begin_z - table_m
    flown.crazyflie.body.ground_z_m = -floor_z
    flown.end(flown.backend.land(LIMITS))
    fastest_m_s = 0.0
    while flown.crazyflie.thrust > 0:
        flown._turn()
        fastest_m_s = max(fastest_m_s, -flown.crazyflie.velocity[2])
        if not flown.crazyflie.body.is_on_ground:
            touched_s = flown.now_s
    assert flown.crazyflie.body.is_on_ground  # its motors have not stopped in the air
    assert fastest_m_s < 0.6
    assert flown.now_s - touched_s < 1.0
    flown.until(lambda: flown.landed is LandedState.ON_GROUND)
    assert flown.crazyflie.current_position[2] == pytest.approx(floor_z, abs=0.01)


def test_a_landing_can_be_ended(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.end(flown.backend.land(LIMITS))
    flown.run(0.5)
    flown.end(flown.backend.take_control())
    z = flown.crazyflie.current_position[2]
    flown.fly(lambda _: current_position(0.0, 0.0, z), 2.0)
    assert flown.estimate().state is State.FLYING_AUTO
    assert flown.crazyflie.current_position[2] == pytest.approx(z, abs=0.1)


def test_a_hover_whose_answer_was_lost_does_not_replace_the_landing_after_it(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda _: current_position(0.3, 0.0, 1.0), 0.3)
    lost = flown.lose_answers(1)
    while not lost:
        flown.fly(lambda _: current_position(0.3, 0.0, 1.0), 0.02)
    flown.end(flown.backend.land(LIMITS))
    flown.until(lambda: flown.landed is LandedState.ON_GROUND)


def test_a_landing_whose_answer_was_lost_does_not_begin_again_once_control_is_taken(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda _: current_position(0.3, 0.0, 1.0), 0.3)
    lost = flown.lose_answers(1)
    flown.backend.land(LIMITS)
    flown.until(lambda: bool(lost))
    flown.end(flown.backend.take_control())
    since = len(flown.crazyflie.received)
    flown.fly(lambda _: current_position(0.3, 0.0, 1.0), 3.0)
    landings = [p for _, p in flown.crazyflie.received[since:] if p.port == HIGH_LEVEL and p.data[0] == packets.LAND]
    assert landings == []
    assert flown.crazyflie.current_position == pytest.approx((0.3, 0.0, 1.0), abs=0.05)


@pytest.mark.parametrize("command", ["land", "hold", "silence"])
def test_the_motors_run_on_while_the_high_level_commander_does_not_answer(tmp_path: Path, command: str) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda t: current_position(0.3 * t, 0.0, 1.0), 0.6)
    flown.crazyflie.ignored = {HIGH_LEVEL}
    if command == "land":
        flown.backend.land(LIMITS)
    elif command == "hold":
        flown.backend.hold()
    states = set()
    for _ in range(500):
        flown._turn()
        states.add(flown.crazyflie.supervisor)
    assert states == {Supervisor.FLYING}
    assert flown.crazyflie.current_position == pytest.approx((0.3, 0.0, 1.0), abs=0.2)
    flown.crazyflie.ignored = set()
    flown.run(8.0)
    if command == "land":
        assert flown.landed is LandedState.ON_GROUND
    else:
        assert flown.crazyflie.current_position == pytest.approx((0.3, 0.0, 1.0), abs=0.2)
        assert flown.crazyflie.plan is not None
    assert flown.crazyflie.supervisor in (Supervisor.FLYING, Supervisor.LANDED, Supervisor.CHECKS, Supervisor.PASSED)


@pytest.mark.parametrize("command", ["land", "hold"])
@pytest.mark.parametrize("seed", range(5))
def test_the_motors_run_on_over_a_link_that_loses_half(tmp_path: Path, command: str, seed: int) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda t: current_position(0.3 * t, 0.0, 1.0), 0.6)
    flown.crazyflie.port = BadLink(flown.memory, seed, Faults(loss=0.5), Faults(loss=0.5))
    future = flown.backend.land(LIMITS) if command == "land" else flown.backend.hold()
    while not future.done():
        flown._turn()
        assert flown.crazyflie.supervisor in (Supervisor.FLYING, Supervisor.LEVEL_OUT)
        assert flown.crazyflie.current_position[2] > 0.9
    flown.run(8.0)
    if command == "land":
        assert flown.crazyflie.current_position[2] == pytest.approx(0.014, abs=0.02)
        assert flown.crazyflie.supervisor is not Supervisor.LOCKED
    else:
        assert flown.crazyflie.supervisor is Supervisor.FLYING


def test_a_late_answer_to_an_earlier_landing_does_not_stop_the_motors(tmp_path: Path) -> None:
    """A setpoint has ended that landing; told that setpoints stop, the firmware would have nothing to fly."""
    flown = FlightTrace(tmp_path)
    flown.take_off()
    flown.fly(lambda _: current_position(0.3, 0.0, 1.0), 0.3)
    late: list[bytes] = []
    send = flown.crazyflie._send

    def slow(port: int, channel: int, data: bytes) -> None:
        late.append(data) if port == HIGH_LEVEL else send(port, channel, data)

    flown.crazyflie._send = slow  # type: ignore[method-assign]
    flown.backend.land(LIMITS)
    flown.until(lambda: bool(late))
    flown.until(lambda: flown.crazyflie.plan is None)
    flown.crazyflie.ignored = {HIGH_LEVEL}
    flown.until(lambda: not flown.session._requests.is_empty)  # it is asked again
    flown.crazyflie._send = send  # type: ignore[method-assign]
    for data in late:
        send(HIGH_LEVEL, 0, data)
    flown.run(3.0)
    assert flown.crazyflie.supervisor is Supervisor.FLYING
    assert flown.crazyflie.current_position[2] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("turns", range(1, 6))
def test_a_landing_that_is_withdrawn_is_undone_whenever_that_is(tmp_path: Path, turns: int) -> None:
    """Also if the firmware has just answered, and nobody can have seen it yet."""
    flown = FlightTrace(tmp_path)
    flown.take_off()
    landing = flown.backend.land(LIMITS)
    for _ in range(turns):
        flown._turn()
    if landing.cancel():
        x, y, z = flown.crazyflie.current_position
        flown.fly(lambda _: current_position(x, y, z), 2.0)
        assert flown.estimate().state is State.FLYING_AUTO
        assert flown.crazyflie.current_position[2] == pytest.approx(z, abs=0.1)
    else:
        assert flown.estimate().state is State.LANDING


def test_it_is_on_the_ground_soon_after_its_motors_have_stopped(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.take_off(0.5)
    flown.end(flown.backend.land(LIMITS))
    flown.until(lambda: flown.crazyflie.thrust == 0)
    assert flown.until(lambda: flown.landed is LandedState.ON_GROUND) < 0.5
    assert flown.crazyflie.supervisor is Supervisor.FLYING  # as it says for 2 s


@PROTOCOLS
def test_velocities_fly_and_turn_to_the_left(tmp_path: Path, protocol: int) -> None:
    flown = FlightTrace(tmp_path, made(protocol))
    flown.take_off()
    flown.fly(lambda _: VelocitySetpoint(Vector3(0.3, 0.2, 0.0), 0.3), 2.0)
    x, y, _ = flown.crazyflie.current_position
    assert (x, y) == pytest.approx((0.6, 0.4), abs=0.15)
    assert flown.crazyflie.yaw_rad == pytest.approx(0.6, abs=0.15)
    pose = flown.backend.snapshot().motion.pose
    assert pose is not None
    assert pose.value.yaw_rad == pytest.approx(flown.crazyflie.yaw_rad, abs=0.05)


def test_names_what_tells_it_where_it_is_and_takes_poses_from_outside(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.crazyflie.has_positioning = False
    flown.until(lambda: "needs a flow deck, Lighthouse or poses from outside" in flown.estimate().why)
    measured = ExternalPose(Pose(Vector3(0.1, 0.2, 0.3), Quaternion.from_yaw(math.pi / 2)), 0.0, 0.0)
    for _ in range(40):
        flown.backend.set_external_pose(measured)
        flown.run(0.02)
    assert flown.estimate().state is State.LANDED_DISARMED
    position, orientation = flown.crazyflie.external_poses[-1]
    assert position == pytest.approx((0.1, 0.2, 0.3), abs=1e-6)
    assert orientation.yaw_rad == pytest.approx(math.pi / 2, abs=1e-6)


def test_a_deck_that_is_not_sure_is_named(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path)
    flown.crazyflie.has_positioning = False
    letter, _, is_read_only = flown.crazyflie.parameters["deck.bcFlow2"]
    flown.crazyflie.parameters["deck.bcFlow2"] = letter, 1, is_read_only
    flown.until(lambda: "its position with the flow deck is not sure" in flown.estimate().why)


def test_knows_that_the_complementary_estimator_has_no_position(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path, parameters={"stabilizer.estimator": 1})
    flown.until(lambda: "set stabilizer.estimator=2" in flown.estimate().why)


def test_another_controller_gets_the_whole_motion(tmp_path: Path) -> None:
    flown = FlightTrace(tmp_path, parameters={"stabilizer.controller": 2})
    flown.take_off()
    kinds = {p.data[0] for _, p in flown.crazyflie.received if p.port == SETPOINT and p.channel == 0}
    assert kinds == {6}


def test_a_hold_shows_only_once_the_firmware_was_reported_that_setpoints_stop() -> None:
    sent: list[CrtpPacket] = []
    commander = Commander(sent.append, sent.append, hovers_by_itself=True)
    requests = CrtpRequests(sent.append)
    place = Pose.at(0.0, 0.0, 1.0)
    commander.hand_over(Phase.HOLDING, commander.encoder.stop(place, Vector3()), rest(place, Vector3()), print)
    flying = place, Vector3()
    commander.step(requests, 0.0, flying)
    requests.step(0.0)
    assert requests.on_packet(CrtpPacket(sent[0].port, sent[0].channel, sent[0].data[:3] + bytes(1)))
    told_s = []
    for step in range(100):
        now_s = step * 0.01
        sent.clear()
        commander.step(requests, now_s, flying)
        told_s += [now_s] * sent.count(packets.setpoints_stop())
        if commander.mode.control is Control.OTHER:
            break
    assert told_s == pytest.approx(NOTIFICATIONS, abs=0.01)
    assert told_s[-1] >= 0.8


def test_a_landing_is_not_requested_while_a_setpoint_is_still_being_sent() -> None:
    """A radio may block meanwhile, and the setpoint would arrive second and end the landing."""
    sent: list[CrtpPacket] = []
    requests = CrtpRequests(sent.append)
    pose, velocity = Pose.at(0.0, 0.0, 1.0), Vector3()

    def blocked(packet: CrtpPacket) -> None:
        commander.hand_over(Phase.LANDING, commander.encoder.land(1.0, 0.0, 0.5), rest(pose, velocity), print)
        commander.step(requests, 0.0, (pose, velocity))
        requests.step(0.0)
        sent.append(packet)

    commander = Commander(sent.append, blocked, hovers_by_itself=True)
    commander.send(current_position(0.5, 0.0, 1.0), 0.0)
    commander.step(requests, 0.02, (pose, velocity))
    requests.step(0.02)
    assert [packet.port for packet in sent] == [SETPOINT, HIGH_LEVEL]
