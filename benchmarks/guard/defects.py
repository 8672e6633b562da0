"""Defects of speed that the guard must find: `python -m benchmarks.guard --defect NAME` installs one first."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

VARIABLE = "GUARD_DEFECT"
_EMPTY_CALLS, _LIST = 6, 10_000


def _before(owner: Any, name: str, act: Callable[[Any, tuple[Any, ...]], object]) -> None:  # noqa: ANN401  any method
    """Has a method act before it does its work. `act` gets the object and its arguments."""
    real = getattr(owner, name)

    def method(self: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401  as the method
        act(self, args)
        return real(self, *args, **kwargs)

    setattr(owner, name, method)


def _nothing() -> None:
    """An empty call."""


def _calls() -> None:
    from ual_daemon.vehicle.setpoints import VehicleSetpoints

    def call(_: object, __: object) -> None:
        for _ in range(_EMPTY_CALLS):
            _nothing()

    _before(VehicleSetpoints, "set_velocity", call)


def _copies() -> None:
    from ual_daemon.vehicle import vehicle

    name = "make_telemetry"
    make = getattr(vehicle, name)
    setattr(vehicle, name, lambda *args, **kwargs: copy.copy(make(*args, **kwargs)))


def _parses() -> None:
    from pymavlink.dialects.v20 import all as mavlink

    from ual_daemon.backends.mavlink.wire import receiver

    parser = mavlink.MAVLink(None)
    _before(receiver.Receiver, "receive", lambda _, args: parser.parse_buffer(args[0]))


def _estimates() -> None:
    from ual_daemon.vehicle.vehicle import Vehicle

    _before(Vehicle, "_update", lambda vehicle, args: vehicle._flight.estimate(args[0]))  # noqa: SLF001


def _keeps() -> None:
    from ual_daemon.flight.flight import Flight

    kept: list[object] = []
    _before(Flight, "begin", lambda _, __: kept.append([float(number) for number in range(_LIST)]))


DEFECTS: dict[str, Callable[[], None]] = {
    "six empty calls in a setpoint": _calls,
    "a copy of each sample": _copies,
    "a parse of each frame": _parses,
    "estimate twice per update": _estimates,
    "a list of 10,000 kept per flight": _keeps,
}


def install(name: str) -> None:
    """Installs a defect; none where the name is empty."""
    if name:
        DEFECTS[name]()
