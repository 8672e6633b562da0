"""Identity of the flown vehicle, which is the intended one: several with one system id, and others in its place."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.ual_daemon.backends.mavlink.fakes import ADDRESS, Harness, attitude, heartbeat, packer, position
from ual.errors import NotSupportedError
from ual.types import State
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.unknown import Unknown
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.flight.state import estimate

ARDUPILOT = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
OTHER = (ADDRESS[0], ADDRESS[1] + 10)


def copter(*, armed: bool = False) -> Message:
    return heartbeat(4, armed=armed, autopilot=ARDUPILOT)


def plane() -> Message:
    return heartbeat(10, armed=True, autopilot=ARDUPILOT, kind=mavlink.MAV_TYPE_FIXED_WING)


def tracker() -> Message:
    return heartbeat(10, autopilot=ARDUPILOT, kind=mavlink.MAV_TYPE_ANTENNA_TRACKER)


def why(harness: Harness) -> str:
    found = estimate(harness.snapshot(), Dialect.freshness)
    assert found.state is State.UNINITIALIZED
    return found.why


def test_a_plane_that_replaces_a_copter_is_only_watched() -> None:
    harness = Harness()
    harness.receive(copter())
    assert harness.session.dialect.name == "ArduPilot"
    harness.run(10.0)  # the copter is switched off
    for _ in range(3):
        harness.receive(plane())
        assert harness.snapshot().control.mode is None or isinstance(harness.session.dialect, Unknown)
        harness.run(1.0)
    harness.receive(plane())
    info = harness.session.info()
    assert not info.capabilities
    assert "UAL only watches" in info.limitation
    assert "fixed wing" in info.limitation
    assert harness.snapshot().control.armed.value is True
    with pytest.raises(NotSupportedError, match="fixed wing"):
        harness.session.dialect.hold()


def test_a_copter_that_comes_after_a_plane_is_controlled() -> None:
    harness = Harness()
    harness.receive(plane())
    harness.run(10.0)
    harness.receive(copter())
    harness.run(0.1)
    harness.receive(copter())
    harness.run(0.1)
    assert harness.session.dialect.name == "ArduPilot"


@pytest.mark.parametrize("other", [plane, tracker])
def test_two_kinds_with_one_system_id_are_not_executed(other: type[Message], caplog: pytest.LogCaptureFixture) -> None:
    harness = Harness()
    harness.receive(copter(armed=True))
    for _ in range(6):
        harness.run(0.5)
        harness.receive(other())
        harness.run(0.5)
        harness.receive(copter(armed=True), attitude(), position(harness.now_s))
    assert "quadrotor and ardupilotmega on a" in why(harness)
    assert "send as system 1: give each vehicle an id of its own" in why(harness)
    assert harness.snapshot().control.mode is None
    assert sum(vars(record).get("ual_event") == "vehicle_conflict" for record in caplog.records) == 1
    harness.run(6.0)
    harness.receive(copter(armed=True))
    assert harness.snapshot().link.conflict == ""


def test_commands_in_progress_are_not_sent_again_in_a_conflict() -> None:
    harness = Harness()
    harness.receive(copter())
    harness.session.submit(harness.session.dialect.hold(), harness.now_s)
    assert harness.commands(mavlink.MAV_CMD_DO_SET_MODE)
    for _ in range(3):
        harness.run(0.6)
        harness.receive(copter(), plane())
    harness.link.sent.clear()
    harness.run(2.0)
    assert harness.commands(mavlink.MAV_CMD_DO_SET_MODE) == []


def test_an_antenna_tracker_received_first_does_not_lock_the_copter_out() -> None:
    harness = Harness()
    harness.receive(data=packer(2)(tracker()))
    assert harness.discovery.session is None
    harness.receive(copter())
    assert harness.session.dialect.name == "ArduPilot"


def test_an_antenna_tracker_is_watched_where_its_system_id_is_set() -> None:
    harness = Harness(MavlinkSettings(system_id=2))
    harness.receive(data=packer(2)(tracker()))
    assert "antenna tracker" in harness.session.info().limitation


def test_two_copters_with_one_system_id_are_visible_to_their_times_since_boot() -> None:
    harness = Harness()
    other = packer()
    harness.receive(copter())
    for _ in range(5):
        harness.run(0.05)
        harness.receive(attitude(), position(harness.now_s))
        harness.receive(data=other(position(harness.now_s + 60.0)))
    assert "two vehicles, booted 60 s apart, send as system 1" in why(harness)
    assert harness.snapshot().motion.pose is None


def test_two_copters_that_booted_at_once_are_visible_to_their_addresses_and_sequence_numbers() -> None:
    harness = Harness()
    other = packer()
    for _ in range(100):  # its numbers are elsewhere
        other(attitude())
    harness.receive(copter())
    for _ in range(8):
        harness.run(0.05)
        harness.receive(attitude(), position(harness.now_s))
        harness.receive(data=other(position(harness.now_s)), address=OTHER)
    assert f"two vehicles (at {OTHER[0]}:{OTHER[1]} and {ADDRESS[0]}:{ADDRESS[1]})" in why(harness) or (
        f"two vehicles (at {ADDRESS[0]}:{ADDRESS[1]} and {OTHER[0]}:{OTHER[1]})" in why(harness)
    )


def test_one_vehicle_by_two_variants_a_new_address_and_a_reboot_are_no_conflict() -> None:
    harness = Harness()
    harness.receive(copter())
    for _ in range(20):  # a router that sends all twice
        harness.run(0.05)
        data = harness.pack(position(harness.now_s))
        harness.receive(data=data)
        harness.receive(data=data, address=OTHER)
    assert harness.snapshot().link.conflict == ""
    for number in range(40):  # it reboots
        harness.run(0.05)
        harness.receive(position(number * 0.05 - 4.0), address=OTHER)
    assert harness.snapshot().link.conflict == ""


@pytest.mark.parametrize("state", [mavlink.MAV_VTOL_STATE_FW, mavlink.MAV_VTOL_STATE_TRANSITION_TO_FW])
def test_a_quadplane_that_calls_itself_a_quadrotor_is_only_watched(state: int) -> None:
    harness = Harness()
    harness.receive(copter(), mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_MC, 1))
    harness.run(0.1)
    assert harness.session.info().capabilities
    for _ in range(6):
        assert harness.session.info().capabilities
        harness.receive(mavlink.MAVLink_extended_sys_state_message(state, 1))
        harness.run(0.2)
    harness.receive(copter(), mavlink.MAVLink_extended_sys_state_message(state, 1))
    harness.run(0.1)
    assert not harness.session.info().capabilities
    assert "vtol" in harness.session.info().limitation
    assert harness.snapshot().link.conflict == ""


def test_a_quadplane_is_recognized_on_the_ground_by_a_parameter_of_planes() -> None:
    harness = Harness()
    harness.receive(copter())
    q_enable = mavlink.MAVLink_param_value_message(b"Q_ENABLE", 1.0, mavlink.MAV_PARAM_TYPE_INT8, 900, 1)
    harness.receive(q_enable)
    harness.run(0.1)
    harness.receive(copter())
    assert harness.session.info().capabilities
    for _ in range(30):
        asked = [each for each in harness.link.take("PARAM_REQUEST_READ") if each.param_id == "Q_ENABLE"]
        harness.receive(*([q_enable] if asked else []))
        harness.run(0.1)
    assert not harness.session.info().capabilities


# --- One message is no verdict ----------------------------------------------------------------------------------------


def vtol(landed: int = mavlink.MAV_LANDED_STATE_UNDEFINED) -> Message:
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_FW, landed)


def landed(state: int = mavlink.MAV_LANDED_STATE_IN_AIR) -> Message:
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, state)


def px4(*, armed: bool = True) -> Message:
    return heartbeat(0x00060000, armed=armed)


class Flying(Harness):
    """A PX4 that flies on our setpoints, and what another program sends with its ids from an endpoint of its own."""

    def __init__(self) -> None:
        super().__init__()
        self.forge = packer()
        self.states: set[State] = set()
        self.landed = mavlink.MAV_LANDED_STATE_IN_AIR
        self.fly(8.0)

    def fly(self, duration_s: float, forged: Message | None = None, period_s: float = 1.0) -> None:
        """Flies on; something forged comes at the beginning, and again each `period_s`."""
        for count in range(round(duration_s / 0.1)):
            if forged is not None and count % round(period_s / 0.1) == 0:
                self.receive(data=self.forge(forged))
            is_armed = self.landed != mavlink.MAV_LANDED_STATE_ON_GROUND
            self.receive(*([px4(armed=is_armed)] if count % 5 == 0 else []), landed(self.landed), attitude())
            flags = mavlink.MAVLink_estimator_status_message(0, 0x37F, *[0.0] * 8)
            self.receive(flags, position(self.now_s))
            self.states.add(self.state())
            self.run(0.1)

    def state(self) -> State:
        return estimate(self.snapshot(), Dialect.freshness).state

    @property
    def reported(self) -> str:
        return " ".join(self.snapshot().condition.health.failing_checks)


FORGED = {
    "vtol": vtol(),
    "vtol on the ground": vtol(mavlink.MAV_LANDED_STATE_ON_GROUND),
    "plane": heartbeat(kind=mavlink.MAV_TYPE_FIXED_WING),
    "ardupilot": heartbeat(4, autopilot=ARDUPILOT),
    "q_enable": mavlink.MAVLink_param_value_message(b"Q_ENABLE", 1.0, mavlink.MAV_PARAM_TYPE_INT8, 900, 1),
}


@pytest.mark.parametrize("name", FORGED)
def test_one_message_takes_no_flying_uav_away(name: str, caplog: pytest.LogCaptureFixture) -> None:
    harness = Flying()
    session = harness.session
    assert harness.state() is State.FLYING_AUTO
    harness.states.clear()
    harness.receive(data=harness.forge(FORGED[name]))
    harness.run(0.05)
    harness.fly(4.0)
    # One landed state is a value, not a verdict: the next one is 0.1 s away.
    assert harness.states <= {State.FLYING_AUTO, State.LANDED_ARMED if "ground" in name else State.FLYING_AUTO}
    assert harness.session is session
    assert session.info().capabilities
    assert not any(vars(each).get("ual_event", "").startswith("vehicle") for each in caplog.records)


@pytest.mark.parametrize("name", ["plane", "ardupilot"])
def test_another_kind_next_to_a_flight_is_reported_and_counts_on_the_ground(
    name: str, caplog: pytest.LogCaptureFixture
) -> None:
    harness = Flying()
    harness.states.clear()
    harness.fly(8.0, FORGED[name])
    assert harness.states == {State.FLYING_AUTO}
    assert "send as system 1" in harness.reported
    events = [vars(each).get("ual_event", "") for each in caplog.records]
    assert [each for each in events if each.startswith("vehicle")] == ["vehicle_doubtful"]
    harness.landed = mavlink.MAV_LANDED_STATE_ON_GROUND
    harness.fly(4.0, FORGED[name])
    assert harness.state() is State.UNINITIALIZED
    assert "send as system 1" in why(harness)
    harness.fly(8.0)
    assert harness.state() is State.LANDED_DISARMED


def test_a_vtol_state_that_stays_is_reported_in_flight_and_counts_on_the_ground() -> None:
    harness = Flying()
    harness.fly(3.0, vtol(), 0.1)  # as many as of the true ones
    assert harness.state() is State.FLYING_AUTO
    assert harness.reported == ""  # they do not agree
    for _ in range(30):
        harness.receive(px4(), vtol(mavlink.MAV_LANDED_STATE_IN_AIR), attitude(), position(harness.now_s))
        harness.run(0.1)
    assert harness.session.info().capabilities
    assert "VTOL" in harness.reported
    for _ in range(40):
        harness.receive(px4(armed=False), vtol(mavlink.MAV_LANDED_STATE_ON_GROUND))
        harness.run(0.1)
    assert not harness.session.info().capabilities
    harness.landed = mavlink.MAV_LANDED_STATE_ON_GROUND
    harness.fly(3.0)  # it says so no longer
    assert harness.session.info().capabilities
    assert harness.state() is State.LANDED_DISARMED


def test_two_vehicles_next_to_a_flight_do_not_end_it() -> None:
    harness = Flying()
    harness.states.clear()
    for _ in range(20):
        harness.receive(data=harness.forge(position(harness.now_s + 60.0, north=500.0)))
        harness.fly(0.1)
        assert harness.snapshot().motion.pose.value.position.y == pytest.approx(1.0)
    assert harness.states == {State.FLYING_AUTO}
    assert "booted 60 s apart" in harness.reported


def test_a_stray_first_heartbeat_does_not_choose_the_autopilot_for_good() -> None:
    harness = Harness()
    harness.receive(data=packer(7)(px4(armed=False)))
    assert harness.session.system_id == 7
    for _ in range(6):
        harness.run(1.0)
        harness.receive(px4(armed=False))
    assert harness.session.system_id == 1


def test_a_parameter_that_changes_is_read_again() -> None:
    harness = Harness()

    def speed(value: float) -> Message:
        return mavlink.MAVLink_param_value_message(b"MPC_XY_VEL_MAX", value, mavlink.MAV_PARAM_TYPE_REAL32, 900, 1)

    def is_requested() -> bool:
        return any(each.param_id == "MPC_XY_VEL_MAX" for each in harness.link.take("PARAM_REQUEST_READ"))

    harness.receive(px4(armed=False), speed(12.0))
    harness.link.sent.clear()
    harness.receive(data=packer()(speed(0.5)))
    assert is_requested()
    harness.receive(speed(12.0))
    assert harness.session.info().limits.horizontal_speed_m_s == 12.0
    assert is_requested()
    harness.receive(speed(12.0))
    assert not is_requested()


def test_one_version_does_not_make_a_flight_controller_a_simulator() -> None:
    harness = Flying()

    def version(uid: int) -> Message:
        return mavlink.MAVLink_autopilot_version_message(0, 0x01110000, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, uid)

    for _ in range(3):
        harness.receive(version(0x1234))
        harness.fly(0.5)
    assert harness.session.judge_simulation().is_simulated is False
    identity = harness.session.info().identity
    harness.link.sent.clear()
    harness.receive(data=harness.forge(version(5283920058631409231)))
    assert harness.session.judge_simulation().is_simulated is not True
    harness.fly(0.5)
    asked = [each for each in harness.commands(mavlink.MAV_CMD_REQUEST_MESSAGE) if each.param1 == 148]
    assert asked
    assert harness.session.info().identity == identity
