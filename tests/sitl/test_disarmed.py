"""Disarmed in the air by another station: no task that ends on the ground takes that for a landing."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.conftest import FORCE
from tests.sitl.doing import HEIGHT_M, Doing, mission_of, take_off, waypoints
from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.transmitter import Transmitter
from tests.sitl.truth import Truth
from ual.errors import TaskAbortedError, WrongStateError
from ual.missions import Land
from ual.types import State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300), pytest.mark.usefixtures("lands_in_the_end")]

DISARMED_AT_M = 4.0


def _land(flight: Flight) -> Callable[[], object]:
    task = flight.uav.land(blocking=False)
    return lambda: task.wait(PATIENCE_S)


def _return(flight: Flight) -> Callable[[], object]:
    flight.uav.go_to_waypoint(flight.offset(6.0))
    task = flight.uav.return_to_launch(height_m=HEIGHT_M, blocking=False)
    return lambda: task.wait(PATIENCE_S)


def _mission(flight: Flight) -> Callable[[], object]:
    away, back = waypoints(flight, 0.2, 0.1)
    return mission_of(flight, [away, Land(back.latitude_deg, back.longitude_deg)])


LED_DOWN = {"land": _land, "rtl": _return, "mission": _mission}


@pytest.mark.parametrize("what", ["take_off", *LED_DOWN])
def test_disarmed_in_the_air_is_no_landing(
    flight: Flight, uav: UAL, pilot: Transmitter, truth: Truth, what: str
) -> None:
    doing = Doing()
    take_off(flight, doing, what)
    if what == "take_off":
        flight.wait_for(lambda: truth.height_m > DISARMED_AT_M, "its climb")
    else:
        doing.begin(LED_DOWN[what](flight))
        flight.wait_for(lambda: truth.height_m < DISARMED_AT_M, "its descent")
    pilot.order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, FORCE))
    flight.wait_for(lambda: "disarmed in the air" in uav.telemetry().state_reason, "that it is told", 2.0)
    print(f"{pilot.autopilot} {what}: {uav.telemetry().state_reason}")
    with pytest.raises(WrongStateError, match="disarmed in the air"):
        uav.arm()
    doing.join()
    print(f"{pilot.autopilot} {what}: {doing.error}")
    assert isinstance(doing.error, TaskAbortedError)
    assert doing.error.metadata["by"] == "disarmed in the air"
    flight.wait_for(lambda: "once it lies" not in uav.telemetry().state_reason, "that it lies", 8.0)
    assert uav.state() is State.LANDED_DISARMED
