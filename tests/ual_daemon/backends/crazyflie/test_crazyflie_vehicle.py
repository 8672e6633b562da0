"""A Crazyflie with all of UAL above its backend."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.simulators.crazyflie import Supervisor
from tests.ual_daemon.backends.crazyflie.flown_vehicle import FlownVehicle
from ual.types import State


@pytest.mark.parametrize("daemon", ["the same", "restarted", "restarted as it is lifted"])
def test_motors_stay_off_in_the_hand_that_lifts_it_soon_after_its_landing(tmp_path: Path, daemon: str) -> None:
    flown = FlownVehicle(tmp_path)
    flown.take_off(0.5)
    flown.land()
    flown.run(0.2)
    if daemon != "the same":
        flown.restart_daemon()
    if daemon == "restarted":
        flown.ready()
    since_s = flown.now_s
    assert flown.crazyflie.supervisor is Supervisor.FLYING
    while flown.now_s < since_s + 1.2:
        flown.lift(0.5, 0.01)
        assert flown.state in (State.LANDED_ARMED, State.UNINITIALIZED)
    assert flown.session.is_connected
    flown.run(3.0)
    assert flown.crazyflie.thrust == 0
    assert flown.setpoints_since(since_s) == 0
