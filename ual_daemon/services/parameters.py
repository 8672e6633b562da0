"""The autopilot's parameters: what may be written, and when. The manual is docs/how-to/parameters.md."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import replace

from ual.errors import UalError
from ual.parameters.values import Description, Parameter, range_text, real32
from ual_daemon import logs, validation
from ual_daemon.backends.chain import then, then_wait
from ual_daemon.backends.offers.parameters import AutopilotParameters
from ual_daemon.services.vehicle import (
    ServedVehicle,
    driver_of,
    require_change,
    require_disarmed,
)

_NAME = re.compile(r"[!-~]{1,64}")
_SET = "set a parameter"

_NOTHING = Description()
Descriptions = Mapping[str, Description]

_log = logging.getLogger(__name__)


class VehicleParameters:
    """The parameters of one UAV. From any thread; no method waits."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._vehicle = vehicle

    def get(self, name: str) -> Future[Parameter]:
        """See `ual.interface.Parameters`."""
        offer = self._offer()
        name = _checked_name(name)
        return then_wait(offer.descriptions(), lambda known: self._read(offer, name, known))

    def get_all(self) -> Future[list[Parameter]]:
        """See `ual.interface.Parameters`."""
        offer = self._offer()

        def marked(found: list[Parameter], known: Descriptions) -> list[Parameter]:
            relied_on = offer.relied_on
            return [_described(each, relied_on, known) for each in found]

        return then_wait(offer.read_all(), lambda found: then(offer.descriptions(), lambda known: marked(found, known)))

    def set(self, name: str, value: float, lease_id: str, *, force: bool) -> Future[Parameter]:
        """See `ual.interface.Parameters`. Reads the parameter first, as its type is the autopilot's."""
        offer, name = self._offer(), _checked_name(name)
        value = validation.number(value, "value", at_most=float("inf"))

        def require(own_name: str) -> None:
            require_change(self._vehicle, _SET, lease_id)
            self._require_ground(own_name, offer, force=force)

        def write(before: Parameter, known: Descriptions) -> Future[Parameter]:
            def refusal() -> UalError | None:
                try:  # by the autopilot's own name: where capital letters count, another one may have been typed
                    require(before.name)
                except UalError as error:
                    return error
                return None

            wanted = _fitted(before, value)
            if not force:
                _require_range(before, wanted.value)
            return then(
                offer.write(wanted, refusal), lambda found: _written(before, _described(found, offer.relied_on, known))
            )

        require(name)
        return then_wait(
            offer.descriptions(),
            lambda known: then_wait(self._read(offer, name, known), lambda before: write(before, known)),
        )

    def _read(self, offer: AutopilotParameters, name: str, known: Descriptions) -> Future[Parameter]:
        return then(offer.read(name), lambda found: _described(found, offer.relied_on, known))

    def _require_ground(self, name: str, offer: AutopilotParameters, *, force: bool) -> None:
        if name in offer.relied_on:
            what_then = f"a flight relies on {name}, so land and disarm first (force does not help)"
            require_disarmed(self._vehicle, _SET, what_then)
        elif not force:
            require_disarmed(self._vehicle, _SET, "disarm first, or force it if you know what it does in flight")

    def _offer(self) -> AutopilotParameters:
        return driver_of(self._vehicle, AutopilotParameters, "parameters")  # type: ignore[type-abstract]  # it is only looked for


def _checked_name(name: str) -> str:
    validation.require_type(name, str, "name")
    if not _NAME.fullmatch(name):
        raise validation.refuse("name", f"{name!r:.80} is no name of a parameter")
    return name


def _described(found: Parameter, relied_on: frozenset[str], known: Descriptions) -> Parameter:
    """Returns a parameter with what is known of it."""
    about = known.get(found.name, _NOTHING)
    return replace(
        found,
        is_relied_on=found.name in relied_on,
        minimum=about.minimum,
        maximum=about.maximum,
        unit=about.unit,
        description=about.text,
        needs_reboot=about.needs_reboot,
    )


def _require_range(before: Parameter, value: float) -> None:
    """Checks the range that the autopilot tells. The value that it has already may be written."""
    is_low = before.minimum is not None and value < before.minimum
    is_high = before.maximum is not None and value > before.maximum
    if (is_low or is_high) and value != before.value:
        text = f"{value:.7g} is out of range: {before.name} has {range_text(before)} (force writes it all the same)"
        raise validation.refuse("value", text)


def _fitted(before: Parameter, value: float) -> Parameter:
    """Returns the parameter as it is to be written. Raises `InvalidArgumentError` for what its type cannot have."""
    kind = before.type
    least, largest = kind.limits
    if kind.is_whole and not value.is_integer():
        raise validation.refuse("value", f"{value:g} is not whole, and {before.name} is {kind.name}")
    if not least <= value <= largest:
        raise validation.refuse("value", f"{value:g} is out of range: {before.name} is {kind.name}")
    return replace(before, value=int(value) if kind.is_whole else real32(value))


def _written(before: Parameter, found: Parameter) -> Parameter:
    logs.event(_log, logging.INFO, "parameter_written", name=found.name, value=found.text, before=before.text)
    return found
