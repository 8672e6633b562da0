"""The parameters of simulated autopilots through the class: read, listed and written, also over a bad link."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators import Faults
from tests.simulators.mission_store import Sender
from tests.simulators.parameter_files import PACKED
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import SILENT, Flight
from ual.errors import (
    InvalidArgumentError,
    LinkLostError,
    NotSupportedError,
    RejectedByAutopilotError,
    UalTimeoutError,
    WrongStateError,
)
from ual.parameters import ParameterType
from ual.parameters.values import real32
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.mavlink.protocols.ftp_packet import Opcode
from ual_daemon.backends.mavlink.wire.messages import Message

LOSSY = Faults(loss=0.2, jitter_s=0.1, duplication=0.1)
NAMES_COUNT = 300
A_LIMIT = {"px4": "MPC_XY_CRUISE", "ardupilot": "WPNAV_SPEED"}
"""Parameters that UAL has read, and flies by."""
UNUSED = {"px4": "MPC_LAND_SPEED", "ardupilot": "LAND_SPEED"}
WHOLE = {"px4": "EKF2_EV_CTRL", "ardupilot": "FLTMODE6"}


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(request.param)
    flight.kind = request.param  # type: ignore[attr-defined]
    flight.wait_for_state(State.LANDED_DISARMED)
    yield flight
    flight.uav.close()


def kind_of(flight: Flight) -> str:
    return str(flight.kind)  # type: ignore[attr-defined]


def test_a_value_is_read_with_its_type(flight: Flight) -> None:
    name, whole = UNUSED[kind_of(flight)], WHOLE[kind_of(flight)]
    found = flight.uav.parameters.get(name)
    assert (found.value, found.type) == (real32(flight.autopilot.parameters[name]), ParameterType.REAL32)
    assert flight.uav.parameters.get(whole).type is ParameterType.INT32
    assert flight.uav.parameters.get(whole).value == flight.autopilot.parameters[whole]


def test_px4_tells_ranges_units_and_what_needs_a_boot() -> None:
    flight = Flight("px4")
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.wait_for(lambda: flight.backend.info().autopilot_version != "", "its version")
    cruise = flight.uav.parameters.get("MPC_XY_CRUISE")
    assert (cruise.minimum, cruise.maximum, cruise.unit) == (3.0, 20.0, "m/s")
    listed = {each.name: each for each in flight.uav.parameters.get_all()}
    assert listed["MPC_XY_CRUISE"] == cruise
    assert listed["EKF2_EV_CTRL"].needs_reboot
    assert listed["MPC_ACC_HOR"].minimum is None
    with pytest.raises(InvalidArgumentError, match="21 is out of range: MPC_XY_CRUISE has 3 to 20 m/s"):
        flight.uav.parameters.set("MPC_XY_CRUISE", 21.0)
    assert flight.autopilot.parameters["MPC_XY_CRUISE"] != 21.0
    assert flight.uav.parameters.set("MPC_XY_CRUISE", 21.0, force=True).value == 21.0
    opened = [each.data for each in flight.autopilot.files.requests if each.opcode == Opcode.OPEN_FILE_RO]
    assert len(opened) == 2  # once each
    flight.uav.close()


def test_ardupilots_list_is_read_as_a_file_and_streamed_where_that_fails() -> None:
    flight = Flight("ardupilot")
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.wait_for(lambda: flight.backend.info().autopilot_version != "", "its version")
    flight.autopilot.parameters.update({f"TEST_{count:04}": float(count) for count in range(NAMES_COUNT)})
    streams: list[int] = []
    of_request = flight.autopilot._handlers[mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST]

    def counted(message: Message, sender: Sender) -> None:
        streams.append(1)
        of_request(message, sender)

    flight.autopilot._handlers[mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST] = counted
    listed = flight.uav.parameters.get_all()
    assert {each.name: each.value for each in listed} == pytest.approx(flight.autopilot.parameters, rel=1e-6)
    assert streams == []
    flight.autopilot.files.made[PACKED] = lambda: b"damaged"
    assert flight.uav.parameters.get_all() == listed
    del flight.autopilot.files.made[PACKED], flight.autopilot.files.files[PACKED]
    assert flight.uav.parameters.get_all() == listed
    assert streams
    flight.uav.close()


def test_what_a_flight_relies_on_is_marked(flight: Flight) -> None:
    relied_on = {each.name for each in flight.uav.parameters.get_all() if each.is_relied_on}
    assert A_LIMIT[kind_of(flight)] in relied_on
    assert UNUSED[kind_of(flight)] not in relied_on


def test_a_value_is_written_and_read_back(flight: Flight) -> None:
    name, whole = UNUSED[kind_of(flight)], WHOLE[kind_of(flight)]
    assert flight.uav.parameters.set(name, 0.9).text == "0.9"
    assert flight.autopilot.parameters[name] == pytest.approx(0.9)
    assert flight.uav.parameters.set(whole, 7).value == 7
    assert flight.autopilot.parameters[whole] == 7


def test_a_limit_that_is_written_on_the_ground_holds_at_once(flight: Flight) -> None:
    name = {"px4": "MPC_XY_VEL_MAX", "ardupilot": "WPNAV_SPEED"}[kind_of(flight)]
    flight.uav.parameters.set(name, {"px4": 7.0, "ardupilot": 700.0}[kind_of(flight)])
    flight.wait_for(lambda: flight.uav.info().limits.horizontal_speed_m_s == 7.0, "the new limit")


def test_a_write_that_does_not_stick_is_an_error(flight: Flight) -> None:
    name = UNUSED[kind_of(flight)]
    flight.autopilot.kept_parameters.add(name)
    kept = flight.uav.parameters.get(name)
    with pytest.raises(RejectedByAutopilotError, match="keeps") as refused:
        flight.uav.parameters.set(name, kept.value + 1.0)
    assert refused.value.metadata["kept"] == kept.text


def test_what_does_not_fit_is_refused_and_not_sent(flight: Flight) -> None:
    whole = WHOLE[kind_of(flight)]
    before = dict(flight.autopilot.parameters)
    for name, value in ((whole, 0.5), (whole, 2.0**31), (UNUSED[kind_of(flight)], float("nan")), ("no name", 1.0)):
        with pytest.raises(InvalidArgumentError):
            flight.uav.parameters.set(name, value)
    with pytest.raises(InvalidArgumentError):
        flight.uav.parameters.get("A_NAME_THAT_IS_FAR_TOO_LONG")
    assert flight.autopilot.parameters == before


def test_a_name_that_is_not_there_is_reported_with_what_may_be_meant(flight: Flight) -> None:
    with pytest.raises(UalTimeoutError, match="no parameter of this name"):
        flight.uav.parameters.get("NOT_THERE")
    flight.uav.parameters.get_all()
    wrong = UNUSED[kind_of(flight)][:-1]
    with pytest.raises(InvalidArgumentError, match=f"did you mean {UNUSED[kind_of(flight)]}"):
        flight.uav.parameters.get(wrong)


def test_all_are_listed_also_over_a_link_that_loses_a_fifth(flight: Flight) -> None:
    flight.autopilot.parameters.update({f"TEST_{count:04}": float(count) for count in range(NAMES_COUNT)})
    flight.link.down = flight.link.up = LOSSY
    found = {each.name: each.value for each in flight.uav.parameters.get_all()}
    assert found == pytest.approx(flight.autopilot.parameters, rel=1e-6)


def test_writes_hold_over_a_link_that_loses_a_fifth(flight: Flight) -> None:
    flight.link.down = flight.link.up = LOSSY
    for value in range(1, 20):
        assert flight.uav.parameters.set(UNUSED[kind_of(flight)], float(value)).value == value
        assert flight.autopilot.parameters[UNUSED[kind_of(flight)]] == value


def test_in_flight_only_what_is_forced_is_written_and_never_what_the_flight_relies_on(flight: Flight) -> None:
    name, limit = UNUSED[kind_of(flight)], A_LIMIT[kind_of(flight)]
    flight.take_off()
    before = dict(flight.autopilot.parameters)
    with pytest.raises(WrongStateError, match="the UAV is armed; disarm first, or force it"):
        flight.uav.parameters.set(name, 0.8)
    for force in (False, True):
        with pytest.raises(WrongStateError, match=f"a flight relies on {limit}"):
            flight.uav.parameters.set(limit, 1.0, force=force)
    assert flight.autopilot.parameters == before
    assert flight.uav.parameters.set(name, 0.8, force=True).text == "0.8"
    assert flight.uav.parameters.get(limit).value == pytest.approx(before[limit])
    assert flight.uav.state() is State.FLYING_AUTO


def test_a_link_that_is_lost_ends_what_was_begun(flight: Flight) -> None:
    flight.link.down = flight.link.up = SILENT
    with pytest.raises(LinkLostError):
        flight.uav.parameters.get_all()
    flight.wait_for_state(State.UNINITIALIZED)
    with pytest.raises(LinkLostError):
        flight.uav.parameters.get(UNUSED[kind_of(flight)])
    with pytest.raises(LinkLostError, match="not heard to say whether the UAV is armed"):
        flight.uav.parameters.set(UNUSED[kind_of(flight)], 1.0)


def test_a_backend_without_parameters_says_so() -> None:
    with UAL(backend="light") as uav:
        for act in (lambda: uav.parameters.get("X"), uav.parameters.get_all, lambda: uav.parameters.set("X", 1.0)):
            with pytest.raises(NotSupportedError, match="the backend light of uav_1 does not offer them"):
                act()
