"""A vehicle with several batteries, over MAVLink and through MAVROS."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.simulators.lockstep import LockstepArduPilot, LockstepBackend, LockstepPx4
from tests.simulators.lockstep_mavros import LockstepMavros, LockstepMavrosArduPilot, LockstepMavrosPx4
from tests.waiting import until
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.batteries import BATTERY_SILENCE_S
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.mavros.telemetry import MavrosTelemetry

ALL, PROPULSION, PAYLOAD = 1, 2, 4
PERCENT = {0: 90.0, 1: 40.0, 2: 5.0}


KINDS: list[Callable[[BackendOptions], LockstepBackend | LockstepMavros]] = [
    LockstepPx4,
    LockstepArduPilot,
    LockstepMavrosPx4,
    LockstepMavrosArduPilot,
]


@pytest.mark.parametrize("make", KINDS)
def test_the_one_that_the_flight_depends_on_counts(
    make: Callable[[BackendOptions], LockstepBackend | LockstepMavros],
) -> None:
    backend = make(BackendOptions("uav_1"))
    backend.autopilot.batteries = [(0, ALL, 90), (1, PROPULSION, 40), (2, PAYLOAD, 5)]
    with UAL(backend) as uav:
        until(lambda: len(uav.telemetry().batteries) == 3, "all batteries", seen=uav.telemetry)
        told = uav.telemetry()
    assert {each.id: each.remaining_percent for each in told.batteries} == PERCENT
    has_functions = isinstance(backend, LockstepBackend)  # MAVROS does not tell what they feed
    emptiest = 1 if has_functions else 2
    assert told.battery is not None
    assert (told.battery.id, told.battery.remaining_percent) == (emptiest, PERCENT[emptiest])
    assert [each.function for each in told.batteries] == (
        ["all", "propulsion", "payload"] if has_functions else [""] * 3
    )


def test_what_mavros_tells_of_no_more_is_gone() -> None:
    """Over MAVLink see `session.test_telemetry`."""
    telemetry, late_s = MavrosTelemetry(ArduCopter(), LinkWatch("bridge", 1.0), lambda: 0.0), BATTERY_SILENCE_S + 0.1
    for number in range(2):
        charge = {"voltage": 16.0, "current": -1.0, "percentage": 0.8, "location": f"id{number}"}
        telemetry.update(topics.BATTERY, charge, 0.0)
    telemetry.update(topics.SYS_STATUS, {"sensors_present": 0, "sensors_enabled": 0, "sensors_health": 0}, late_s)
    condition = telemetry.snapshot(late_s).condition
    assert (condition.battery, condition.batteries) == (None, ())
