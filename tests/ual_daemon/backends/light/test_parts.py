"""The parts of a simulation: each is offered or refused by itself; and the place on the ground."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from ual.errors import InvalidArgumentError, NotSupportedError, TaskAbortedError
from ual.geometry import Pose, Vector3
from ual.interface import Simulation
from ual.simulation import LinkLost, SimulationPart
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend


class Windy(Simulation):
    """Offers only the wind."""

    def parts(self) -> frozenset[SimulationPart]:
        return frozenset((SimulationPart.WIND,))

    def set_wind(self, velocity_m_s: Vector3) -> None:
        self.wind = velocity_m_s


def test_a_part_that_is_not_available_is_refused_and_named() -> None:
    windy = Windy()
    windy.set_wind(Vector3(1.0, 0.0, 0.0))
    for part, act in (
        ("pilot", windy.pilot_arm),
        ("faults", lambda: windy.begin_fault(LinkLost())),
        ("time", lambda: windy.step(1.0)),
        ("noise", lambda: windy.set_noise(position_m=0.1, velocity_m_s=0.1)),
        ("place", lambda: windy.place_on_ground(Vector3())),
    ):
        with pytest.raises(NotSupportedError, match=rf"the part {part} \(it offers: wind\)") as caught:
            act()
        assert caught.value.metadata == {"part": part}


@pytest.fixture
def uav() -> Iterator[UAL]:
    uav = UAL(LightBackend(BackendOptions("uav_1", settings={"speed_factor": 0.0})))
    uav.simulation.step(0.02)
    yield uav
    uav.vehicle.close()


def test_light_offers_all(uav: UAL) -> None:
    assert uav.simulation.parts() == frozenset(SimulationPart)
    assert uav.info().has_safety_pilot


def test_it_is_put_on_the_ground_there(uav: UAL) -> None:
    uav.simulation.place_on_ground(Vector3(20.0, -5.0, 3.0), 1.0)
    uav.simulation.step(1.0)
    pose = uav.pose().pose
    assert pose.position == Vector3(20.0, -5.0, 3.0)
    assert pose.yaw_rad == pytest.approx(1.0)
    assert uav.state() is State.LANDED_DISARMED


def test_a_flight_ends(uav: UAL) -> None:
    uav.simulation.pilot_arm()
    uav.simulation.step(0.02)
    task = uav.take_off(2.0, blocking=False)
    uav.simulation.step(10.0)
    assert task.done()
    task = uav.go_to_waypoint(Pose.at(50.0, 0.0, 2.0), blocking=False)
    uav.simulation.step(2.0)
    uav.simulation.place_on_ground(Vector3(1.0, 1.0, 0.0))
    uav.simulation.step(1.0)
    assert uav.state() is State.LANDED_DISARMED
    with pytest.raises(TaskAbortedError):
        task.wait()
    assert uav.pose().pose.position == Vector3(1.0, 1.0, 0.0)


def test_a_position_that_is_none_is_refused(uav: UAL) -> None:
    with pytest.raises(InvalidArgumentError, match=r"position\.x"):
        uav.simulation.place_on_ground(Vector3(float("nan"), 0.0, 0.0))
