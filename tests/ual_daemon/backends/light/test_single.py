"""One vehicle alone is moved by code of its own: it must move as it does in a fleet."""

from __future__ import annotations

import subprocess
import sys
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import LIMIT_S
from tests.strategies import ANGLES, vectors
from ual.geometry import Vector3
from ual_daemon.backends.light import LightSettings, World
from ual_daemon.backends.light import fleet as fleet_module
from ual_daemon.backends.light.fleet import Fleet
from ual_daemon.backends.light.physics import SIM_STEP_S, FlightMode
from ual_daemon.backends.light.single import Single
from ual_daemon.backends.light.world import Vehicles
from ual_daemon.backends.values import PositionSetpoint, Setpoint, VelocitySetpoint

LIMITS = st.builds(
    LightSettings,
    horizontal_speed_m_s=st.floats(0.5, 10.0),
    vertical_acceleration_m_s2=st.floats(0.5, 5.0),
    response_s=st.floats(0.05, 2.0),
    disarm_after_landing_s=st.floats(0.0, 1.0),
    battery_percent=st.floats(0.0, 100.0),
    start=st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)),
    wind_m_s=st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)),
)
SETPOINTS: st.SearchStrategy[Setpoint] = st.builds(
    PositionSetpoint, vectors(10.0), ANGLES, vectors(3.0), vectors(3.0), st.floats(-2.0, 2.0)
) | st.builds(VelocitySetpoint, vectors(3.0), st.floats(-2.0, 2.0))
STICKS = st.tuples(*[st.floats(-1.0, 1.0)] * 4)
CHANGES = (
    st.tuples(st.just("mode"), st.sampled_from(FlightMode))
    | st.tuples(st.just("set_setpoint"), SETPOINTS)
    | st.tuples(st.just("sticks"), STICKS)
    | st.tuples(st.just("has_position"), st.booleans())
    | st.tuples(st.just("power"), st.floats(0.0, 1.0))
    | st.tuples(st.just("estimate_offset"), vectors(2.0).map(tuple))
    | st.tuples(st.just("wind"), vectors(9.0).map(tuple))
    | st.tuples(st.just("is_armed"), st.just(True))
)


@settings(max_examples=25, derandomize=True)  # where a float decides, the last bit would now and then
@given(LIMITS, st.lists(st.tuples(CHANGES, st.integers(1, 60)), max_size=12))
def test_one_alone_moves_as_in_a_fleet(limits: LightSettings, course: list[tuple[tuple[str, object], int]]) -> None:
    single = Single()
    single.add(limits)
    fleet = Fleet(single)
    both: tuple[Vehicles, ...] = (single, fleet)
    now_s = 0.0
    take_off = [(("is_armed", True), 1), (("mode", FlightMode.GUIDED), 1)]
    up: tuple[str, object] = ("set_setpoint", VelocitySetpoint(Vector3(0.0, 0.0, 1.0)))
    for (what, value), steps in [*take_off, *[(up, 10)] * 10, *course]:
        for each in both:
            if isinstance(value, FlightMode):
                each.set_mode(0, value)
            elif isinstance(value, PositionSetpoint | VelocitySetpoint):
                each.set_setpoint(0, value, now_s)
            else:
                getattr(each, what)[0] = value
        for _ in range(steps):
            now_s += SIM_STEP_S
            for each in both:
                each.step(now_s)
            assert single.changed() == fleet.changed()
            for name, alone in single.row().items():
                assert np.asarray(alone) == pytest.approx(getattr(fleet, name)[0], abs=1e-6), name
    for one, other in zip(single.report(0), fleet.report(0), strict=True):
        assert one == pytest.approx(other, abs=1e-6)
        assert type(one) is type(other)


COUNT = 6
COMMANDED = st.dictionaries(st.integers(0, COUNT - 1), SETPOINTS | st.sampled_from(FlightMode))


@settings(derandomize=True)
@given(LIMITS, st.lists(st.tuples(COMMANDED, COMMANDED, st.integers(1, 3)), max_size=12))
def test_setpoints_are_taken_together_as_one_by_one(
    limits: LightSettings, course: list[tuple[dict[int, object], dict[int, object], int]]
) -> None:
    def commanded(fleet: Fleet, commands: dict[int, object], now_s: float) -> None:
        for index, value in commands.items():
            if isinstance(value, FlightMode):
                fleet.set_mode(index, value)
            elif isinstance(value, PositionSetpoint | VelocitySetpoint):
                fleet.set_setpoint(index, value, now_s)

    together, one_by_one = [_fleet_in_air(limits) for _ in range(2)]
    now_s = 0.0
    for first, second, steps_count in course:
        for commands in (first, second):
            commanded(together, commands, now_s)
            commanded(one_by_one, commands, now_s)
        for _ in range(steps_count):
            now_s += SIM_STEP_S
            together.step(now_s)
            with patch.object(fleet_module, "_LEAST_ROWS_COUNT", COUNT + 1):
                one_by_one.step(now_s)
            for name, column in vars(one_by_one).items():
                if isinstance(column, np.ndarray):
                    assert np.array_equal(getattr(together, name), column, equal_nan=True), name


def _fleet_in_air(limits: LightSettings) -> Fleet:
    single = Single()
    single.add(limits)
    fleet = Fleet(single)
    for _ in range(COUNT - 1):
        fleet.add(limits)
    fleet.position[:, 2] += 20.0
    fleet.is_armed[:], fleet.is_landed[:] = True, False
    for index in range(COUNT):
        fleet.set_mode(index, FlightMode.GUIDED)
    return fleet


def test_a_report_of_the_step_is_that_of_its_end() -> None:
    fleet = _fleet_in_air(LightSettings(wind_m_s=(1.0, 2.0, 0.0)))
    for number in range(1, 5):  # from the second step on many are known to be asked
        fleet.step(number * SIM_STEP_S)
        fleet.estimate_offset[2] = (float(number), 0.0, 0.0)
        reports = [fleet.report(index) for index in range(COUNT)]
        for index, report in enumerate(reports):
            position, velocity, *others = fleet.report_of_step(index)
            assert (tuple(position), tuple(velocity), *others) == report
    at_end = fleet.report_of_step(0)
    fleet.set_mode(0, FlightMode.LAND)
    assert fleet.report_of_step(0) == at_end
    fleet.step(1.0)
    assert fleet.report_of_step(0)[4] == FlightMode.LAND


def test_a_second_vehicle_leaves_the_first_where_it_is() -> None:
    world = World(speed_factor=0.0)
    world.add(LightSettings(start=(1.0, 2.0, 3.0)))
    world.set_wind(0, Vector3(1.0, 0.0, 0.0))
    world.step(1.0)
    before = world.fleet.report(0)
    assert world.add(LightSettings(start=(4.0, 5.0, 6.0))) == 1
    assert world.fleet.report(0) == before
    assert tuple(world.fleet.wind[0]) == (1.0, 0.0, 0.0)
    assert world.fleet.report(1)[0] == (4.0, 5.0, 6.0)


def test_one_alone_needs_no_numpy() -> None:
    code = "import sys; from ual_daemon import UAL; UAL(backend='light').close(); sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=LIMIT_S).returncode == 0
