"""The conformance checks of parameters find what is wrong: each with parameters that are sabotaged so."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, cast

import pytest

from ual import conformance
from ual.conformance import CannotRunError, CheckFailedError, Flight, Tolerances, own_parameters
from ual.errors import InvalidArgumentError, WrongStateError
from ual.interface import Uav
from ual.parameters import Parameter, ParameterType
from ual.types import State
from ual_daemon import UAL

LIMIT = Parameter("LIMIT", 5.0, ParameterType.REAL32, is_relied_on=True)
GAIN = Parameter("GAIN", 0.5, ParameterType.REAL32)
TOLERANCES = replace(Tolerances.of_simulation(), patience=1.0)


class Parameters:
    """Parameters of a UAV that does as it must, but for what a test changes."""

    def __init__(self, uav: UAL) -> None:
        self._uav = uav
        self.listed = [GAIN, LIMIT]
        self.kept: Parameter | None = None
        self.writes_in_flight: Callable[[str, bool], bool] = lambda _name, _force: False

    def get_all(self) -> list[Parameter]:
        return self.listed

    def get(self, name: str) -> Parameter:
        if not name:
            raise InvalidArgumentError("name: it is empty")
        return next(each for each in self.listed if each.name == name)

    def set(self, name: str, value: float, *, force: bool = False) -> Parameter:
        is_armed = self._uav.state() is not State.LANDED_DISARMED
        if is_armed and not self.writes_in_flight(name, force):
            raise WrongStateError(f"a flight relies on {name}", {"state": self._uav.state().name, "needed": "disarmed"})
        if math.isnan(value):
            raise InvalidArgumentError("value: nan is not a number")
        return self.kept or replace(self.get(name), value=value)


class WithParameters:
    """A UAV that has parameters."""

    def __init__(self, uav: UAL) -> None:
        self._uav = uav
        self.parameters = Parameters(uav)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._uav, name)


@pytest.fixture(scope="module")
def uav() -> Iterator[UAL]:
    with UAL("light", "uav_1", backend_settings={"speed_factor": 5.0}) as uav:
        yield uav


def run(uav: object) -> None:
    """Runs the checks."""
    flight = Flight(cast("Uav", uav), TOLERANCES)
    for check in (*own_parameters.ON_GROUND, *own_parameters.IN_FLIGHT):
        conformance.run_check(flight, check)


def test_a_uav_that_does_as_it_must_passes(uav: UAL) -> None:
    run(WithParameters(uav))


def test_a_uav_without_parameters_cannot_be_checked(uav: UAL) -> None:
    with pytest.raises(CannotRunError, match="does not offer them"):
        run(uav)


def lists_one_twice(parameters: Parameters) -> None:
    parameters.listed.append(LIMIT)


def lists_none(parameters: Parameters) -> None:
    parameters.listed.clear()


def keeps_another_value(parameters: Parameters) -> None:
    parameters.kept = replace(LIMIT, value=4.0)


def writes_all_by_force(parameters: Parameters) -> None:
    parameters.writes_in_flight = lambda _, force: force


def writes_all_in_flight(parameters: Parameters) -> None:
    parameters.writes_in_flight = lambda *_: True


def writes_gains_in_flight(parameters: Parameters) -> None:
    parameters.writes_in_flight = lambda name, _: name == "GAIN"


@pytest.mark.parametrize(
    ("sabotage", "message"),
    [
        (lists_one_twice, "listed twice"),
        (lists_none, "no parameter is listed"),
        (keeps_another_value, "was written as"),
        (writes_all_by_force, "writing LIMIT in flight"),
        (writes_all_in_flight, "writing LIMIT in flight"),
        (writes_gains_in_flight, "writing GAIN in flight"),
    ],
)
def test_what_is_wrong_is_found(uav: UAL, sabotage: Callable[[Parameters], None], message: str) -> None:
    sabotaged = WithParameters(uav)
    sabotage(sabotaged.parameters)
    with pytest.raises(CheckFailedError, match=message):
        run(sabotaged)
