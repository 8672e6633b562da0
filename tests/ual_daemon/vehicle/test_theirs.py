"""After a take-over the ground is the pilot's, too."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ual_daemon.stepped import Stepped, stepped
from ual.errors import WrongStateError
from ual.types import State
from ual_daemon.vehicle.vehicle import Vehicle


@pytest.fixture
def uav() -> Iterator[Stepped]:
    with stepped(light={"disarm_after_landing_s": 5.0}) as uav:
        yield uav


def landed_by_hand(uav: Stepped) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.sim.pilot_move_sticks(up=-0.5)
    uav.until(lambda: uav.is_in(State.LANDED_ARMED))


def test_a_looping_take_off_is_refused_after_the_pilot_has_landed_by_hand(uav: Stepped) -> None:
    landed_by_hand(uav)
    for _ in range(20):
        with pytest.raises(
            WrongStateError, match=r"others have flown the UAV.*disarmed.*recover_from_manual"
        ) as caught:
            uav.prepare.take_off(3.0)
        assert caught.value.metadata["needed"] == "recover_from_manual"
        uav.run(0.1)
    assert uav.state is State.LANDED_ARMED


def test_a_disarming_makes_the_ground_ours_again(uav: Stepped) -> None:
    landed_by_hand(uav)
    uav.sim.pilot_disarm()
    uav.run(0.1)
    uav.fly()


def test_recover_on_the_ground_allows_a_take_off_and_moves_nothing(uav: Stepped) -> None:
    landed_by_hand(uav)
    mode = uav.vehicle.telemetry().flight_mode
    uav.sim.pilot_move_sticks()
    assert uav.vehicle.commands.recover_from_manual().plan is not None  # a dry run changes nothing
    with pytest.raises(WrongStateError):
        uav.prepare.take_off(3.0)
    uav.end(uav.vehicle.commands.recover_from_manual().begin())
    uav.run(0.1)
    assert uav.state is State.LANDED_ARMED
    assert uav.vehicle.telemetry().flight_mode == mode
    uav.end(uav.prepare.take_off(3.0).begin().future)


def test_recover_on_the_ground_is_refused_where_nobody_took_the_uav(uav: Stepped) -> None:
    uav.arm()
    with pytest.raises(WrongStateError, match="FLYING_MANUAL"):
        uav.vehicle.commands.recover_from_manual()


def test_our_own_landing_after_a_recovery_leaves_the_ground_ours(uav: Stepped) -> None:
    uav.fly()
    uav.sim.pilot_take_over()
    uav.run(1.0)
    uav.end(uav.vehicle.commands.recover_from_manual().begin())
    uav.end(uav.prepare.land().begin().future)
    assert uav.state is State.LANDED_ARMED
    uav.end(uav.prepare.take_off(3.0).begin().future)


def test_a_landing_that_ual_was_commanded_to_leaves_the_ground_ours_after_a_restart(uav: Stepped) -> None:
    uav.fly()
    uav.vehicle.close()
    vehicle = Vehicle(uav.vehicle.backend)
    vehicle.open()
    new = Stepped(vehicle, uav.world)
    new.run(0.2)  # FLYING_AUTO, and not commanded
    new.end(new.prepare.land().begin().future)
    assert new.state is State.LANDED_ARMED
    new.end(new.prepare.take_off(3.0).begin().future)
