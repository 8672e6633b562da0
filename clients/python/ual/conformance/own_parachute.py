"""Checks of the parachute. It is never released, and disabled at the end."""

from __future__ import annotations

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight
from ual.errors import NotSupportedError


@check()
def enables_and_disables_its_parachute(flight: Flight) -> None:
    """A parachute acknowledges that it may be released, and that it may not be."""
    parachute = flight.uav.parachute
    try:
        parachute.disable()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None
    parachute.enable()
    parachute.disable()


ON_GROUND = (enables_and_disables_its_parachute,)
