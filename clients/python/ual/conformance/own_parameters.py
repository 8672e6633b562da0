"""Checks of the autopilot's own parameters. Each is written with the value that it has: nothing changes."""

from __future__ import annotations

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight, require
from ual.errors import InvalidArgumentError, NotSupportedError, WrongStateError
from ual.parameters.values import Parameter
from ual.types import State


@check()
def reads_the_autopilots_parameters(flight: Flight) -> None:
    """All parameters are listed, each once, and one that is read by its name has the type that it has in the list."""
    listed = _all(flight)
    names = [each.name for each in listed]
    require(len(names) == len(set(names)), "a parameter is listed twice")
    found = flight.uav.parameters.get(names[0])
    require((found.name, found.type) == (names[0], listed[0].type), f"{names[0]} is read as {found}")
    flight.refuses(InvalidArgumentError, lambda: flight.uav.parameters.get(""), "a parameter without a name")


@check(State.LANDED_DISARMED)
def writes_a_parameter_and_reads_it_back(flight: Flight) -> None:
    """Disarmed, a parameter is written; a value that its type does not have is refused."""
    parameter = _relied_on(_all(flight))
    written = flight.uav.parameters.set(parameter.name, parameter.value)
    require(written == parameter, f"{parameter} was written as {written}")
    nothing = float("nan")
    error = flight.refuses(
        InvalidArgumentError, lambda: flight.uav.parameters.set(parameter.name, nothing), "a value that is no number"
    )
    require("value" in error.message, f"the refusal does not name the value: {error.message}")


@check(State.FLYING_AUTO)
def writes_no_parameter_in_flight(flight: Flight) -> None:
    """In flight nothing is written unless forced, and never that on which the flight relies."""
    listed, write = _all(flight), flight.uav.parameters.set
    relied_on = _relied_on(listed)
    for force in (False, True):
        error = flight.refuses(
            WrongStateError,
            lambda force=force: write(relied_on.name, relied_on.value, force=force),  # type: ignore[misc]
            f"writing {relied_on.name} in flight",
        )
        require(relied_on.name in error.message, f"the refusal does not name the parameter: {error.message}")
    other = next((each for each in listed if not each.is_relied_on), None)
    if other is not None:
        flight.refuses(WrongStateError, lambda: write(other.name, other.value), f"writing {other.name} in flight")


def _all(flight: Flight) -> list[Parameter]:
    try:
        listed = flight.uav.parameters.get_all()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None
    require(bool(listed), "no parameter is listed")
    return listed


def _relied_on(listed: list[Parameter]) -> Parameter:
    found = next((each for each in listed if each.is_relied_on), None)
    if found is None:
        raise CannotRunError("a flight relies on none of its parameters")
    return found


ON_GROUND = (reads_the_autopilots_parameters, writes_a_parameter_and_reads_it_back)
IN_FLIGHT = (writes_no_parameter_in_flight,)
