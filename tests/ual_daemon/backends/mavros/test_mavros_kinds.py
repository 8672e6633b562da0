"""One message of the autopilot, or one answer of MAVROS, is no verdict on the vehicle."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.autopilot import Autopilot
from tests.ual_daemon.backends.mavros.test_mavros_faults import Flight, make
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.mavlink.wire.messages import Message


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    backend = make(request.param)
    with UAL(backend, allow_arming=True) as uav:
        yield Flight(backend, uav)


def say_vtol_once(autopilot: Autopilot) -> list[Message]:
    """Has the next EXTENDED_SYS_STATE say a VTOL state. It is in the list once it was sent."""
    message_id, said = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, list[Message]()
    usual = autopilot.builders[message_id]

    def build() -> Message | None:
        message = usual()
        if message is not None and not said:
            message.vtol_state = mavlink.MAV_VTOL_STATE_FW
            said.append(message)
        return message

    autopilot.builders[message_id] = build
    return said


def test_one_vtol_state_takes_no_flying_uav_away(flight: Flight) -> None:
    flight.fly()
    begun, watched = flight.mark(), list[str]()
    said = say_vtol_once(flight.backend.autopilot)

    def limitation() -> str:
        watched.append(flight.backend.info().limitation)
        return watched[-1]

    flight.until(lambda: bool(said) and not limitation())
    said_s = flight.now_s()
    flight.until(lambda: limitation() is not None and flight.now_s() > said_s + 3.0)
    assert set(watched) == {""}
    assert {state for time_s, state in flight.backend.history if time_s > begun[1]} <= {State.FLYING_AUTO}
    flight.uav.land()


def test_another_type_counts_on_the_ground_and_while_it_is_reported(flight: Flight) -> None:
    flight.fly()
    autopilot = flight.backend.autopilot
    own, autopilot.kind = autopilot.kind, mavlink.MAV_TYPE_FIXED_WING
    flight.until(lambda: "MAVROS says" in str(flight.uav.telemetry().health))
    assert flight.uav.state() is State.FLYING_AUTO
    flight.uav.land()
    flight.until(lambda: flight.uav.state() is State.UNINITIALIZED)
    assert "type 1" in flight.uav.telemetry().state_reason
    autopilot.kind = own
    flight.until(lambda: flight.uav.state() is State.LANDED_DISARMED)


def test_a_severe_text_is_reported_by_health_and_by_the_log(caplog: pytest.LogCaptureFixture) -> None:
    backend = make("ardupilot")
    with UAL(backend, allow_arming=True) as uav:
        flight = Flight(backend, uav)
        flight.until(uav.is_ready)
        with flight.backend.autopilot.lock:
            flight.backend.autopilot.say("GPS Glitch or Compass error")
        flight.until(lambda: "autopilot: GPS Glitch or Compass error" in str(uav.telemetry().health))
        flight.until(lambda: "autopilot_says" in caplog.text)  # which comes after health has it
        with flight.backend.autopilot.lock:
            flight.backend.autopilot.say("Glitch cleared")
        flight.until(lambda: "GPS Glitch" not in str(uav.telemetry().health))
