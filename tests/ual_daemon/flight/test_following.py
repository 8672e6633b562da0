"""Comparison of flown motions with the requested ones."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ual_daemon.stepped import Stepped, at, stepped
from ual.errors import TaskAbortedError, WrongStateError
from ual.geometry import Twist, TwistStamped, Vector3
from ual.simulation import MotorsWeak
from ual.types import State


@pytest.fixture
def flying() -> Iterator[Stepped]:
    with stepped() as uav:
        uav.fly(6.0)
        uav.run(2.0)
        yield uav


def begin(uav: Stepped, what: str) -> object:
    if what == "go_to":
        return uav.prepare.go_to_waypoint(at(30.0, 0.0, 6.0)).begin()
    if what == "velocity":
        uav.vehicle.commands.setpoints.set_velocity(TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)), ""))
    if what == "land":
        return uav.prepare.land().begin()
    return None


@pytest.mark.parametrize("what", ["hold", "go_to", "velocity", "land"])
def test_a_fall_is_reported_ends_what_flies_and_nothing_climbs_by_itself(flying: Stepped, what: str) -> None:
    task = begin(flying, what)
    flying.run(0.3)
    fault = flying.sim.begin_fault(MotorsWeak(0.0))
    flying.until(lambda: "falls at" in flying.vehicle.telemetry().state_reason, 1.0)
    telemetry = flying.vehicle.telemetry()
    assert telemetry.health is not None
    assert any("falls at" in each for each in telemetry.health.failing_checks)
    if task is not None:
        error = task.future.exception(0)  # type: ignore[attr-defined]
        assert isinstance(error, TaskAbortedError)
        assert error.metadata["by"] == "fall"
        assert "falls at" in str(error)
    with pytest.raises(WrongStateError, match=r"recover_from_manual|LANDING"):
        flying.prepare.go_to_waypoint(at(0.0, 0.0, 6.0))
    flying.run(3.0)
    assert flying.pose.position.z < 0.1
    flying.sim.end_fault(fault)
    highest = 0.0
    for _ in range(100):
        flying.run(0.1)
        highest = max(highest, flying.pose.position.z)
    assert highest < 0.3
    assert flying.state is State.LANDED_DISARMED


def test_motors_that_work_again_in_the_air_hold_there_and_recover_allows_new_motions(flying: Stepped) -> None:
    flying.sim.begin_fault(MotorsWeak(0.0), duration_s=0.6)
    flying.run(5.0)
    height = flying.pose.position.z
    assert 1.0 < height < 5.0
    with pytest.raises(WrongStateError, match="recover_from_manual"):
        flying.prepare.go_to_waypoint(at(1.0, 0.0, 6.0))
    assert "fell at" in flying.vehicle.telemetry().state_reason
    flying.run(10.0)
    assert flying.pose.position.z == pytest.approx(height, abs=0.1)
    flying.end(flying.vehicle.commands.recover_from_manual().begin())
    assert "fell" not in flying.vehicle.telemetry().state_reason
    flying.end(flying.prepare.go_to_waypoint(at(1.0, 0.0, 6.0)).begin().future)


def test_after_recover_the_height_is_held_again_and_does_not_sink_with_each_dip(flying: Stepped) -> None:
    flying.sim.begin_fault(MotorsWeak(0.0), duration_s=0.6)
    flying.run(5.0)
    flying.end(flying.vehicle.commands.recover_from_manual().begin())
    height = flying.pose.position.z
    for _ in range(3):
        flying.sim.begin_fault(MotorsWeak(0.0), duration_s=0.2)
        flying.run(4.0)
    assert flying.pose.position.z == pytest.approx(height, abs=0.1)


@pytest.mark.parametrize("wind_m_s", [0.0, 6.0])
def test_sharp_flights_and_wind_are_no_trouble(wind_m_s: float) -> None:
    with stepped() as uav:
        following = uav.vehicle.commands._flight.following
        uav.fly(40.0)
        uav.sim.set_wind(Vector3(wind_m_s, -wind_m_s, 0.0))
        setpoints = uav.vehicle.commands.setpoints
        most = Vector3(20.0, 20.0, 20.0)  # more than the limits: they hold
        for direction in (
            Vector3(0.0, 0.0, -1.0),
            Vector3(1.0, 0.0, -1.0),
            Vector3(-1.0, 1.0, 0.0),
            Vector3(0.0, 0.0, 1.0),
        ):
            velocity = Vector3(most.x * direction.x, most.y * direction.y, most.z * direction.z)
            for _ in range(15):
                setpoints.set_velocity(TwistStamped(Twist(velocity), ""))
                uav.run(0.1)
            setpoints.set_velocity(TwistStamped(Twist(), ""))
            uav.run(0.3)
            assert following.why == ""
        for goal in (at(40.0, 0.0, 30.0), at(-40.0, 10.0, 8.0), at(0.0, 0.0, 50.0), at(0.0, 0.0, 4.0)):
            uav.prepare.go_to_waypoint(goal).begin()  # changed on its way
            uav.run(3.0)
            assert following.why == ""
        setpoints.set_pose(at(30.0, 0.0, 20.0))
        uav.run(2.0)
        setpoints.set_pose(at(-30.0, 0.0, 3.0))
        uav.run(8.0)
        assert following.why == ""
        uav.sim.set_wind(Vector3())
        uav.end(uav.prepare.land().begin().future)
        assert following.why == ""
        assert following.count == 0
