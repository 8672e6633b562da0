"""Checks of what a UAV carries. Nothing is moved: what would fall is not known to a check."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ual.conformance.check import check
from ual.conformance.flight import CannotRunError, Flight, require
from ual.errors import InvalidArgumentError, NotSupportedError
from ual.gripper import Equipment, WinchAction
from ual.interface import Gripper

_ABSENT = "there_is_none_of_this_name"


@check()
def lists_what_it_carries(flight: Flight) -> None:
    """Configured devices are listed, each name once. A servo is at a position only where its pulse is that."""
    found = _carried(flight)
    for devices in (found.grippers, found.winches, found.servos, found.relays):
        names = [each.name for each in devices]
        require(len(set(names)) == len(names), f"a name is there twice: {names}")
    for servo in found.servos:
        at = [name for name, pwm_us in servo.positions if pwm_us == servo.pwm_us]
        require(servo.position == (at[0] if at else ""), f"{servo} is not at {servo.position!r}")


@check()
def moves_only_what_is_configured(flight: Flight) -> None:
    """A name that is not configured, a pulse beyond the bounds, and what cannot be meant are refused."""
    found = _carried(flight)
    for what, order in (*_absent(flight.uav.gripper), *_beyond(flight.uav.gripper, found)):
        error = flight.refuses(InvalidArgumentError, order, what)
        require(bool(error.metadata.get("field")), f"the refusal names no field: {error.message}")
    require(_orders(_carried(flight)) == _orders(found), "what was refused was ordered all the same")


def _absent(gripper: Gripper) -> Iterator[tuple[str, Callable[[], None]]]:
    yield "a grip of a gripper that is not configured", lambda: gripper.grip(_ABSENT)
    yield "a release of one", lambda: gripper.release(_ABSENT)
    yield "an order to a winch that is not configured", lambda: gripper.order_winch(WinchAction.HOLD, winch=_ABSENT)
    yield "moving a servo that is not configured", lambda: gripper.set_servo(servo=_ABSENT, pwm_us=1500)
    yield "switching a relay that is not configured", lambda: gripper.set_relay("on", relay=_ABSENT)


def _beyond(gripper: Gripper, found: Equipment) -> Iterator[tuple[str, Callable[[], None]]]:
    for servo in found.servos:
        for pwm_us in (servo.min_pwm_us - 1, servo.max_pwm_us + 1, 0):
            yield f"a pulse of {pwm_us} us", lambda name=servo.name, us=pwm_us: gripper.set_servo(servo=name, pwm_us=us)  # type: ignore[misc]
        yield "no pulse", lambda name=servo.name: gripper.set_servo(servo=name)  # type: ignore[misc]
        yield "a position of another", lambda name=servo.name: gripper.set_servo(_ABSENT, servo=name)  # type: ignore[misc]
    for winch in found.winches:
        for values in ({}, {"length_m": 0.0}, {"length_m": 1e6}, {"length_m": 1.0, "rate_m_s": -1.0}):
            yield (
                f"a length by {values}",
                lambda name=winch.name, values=values: gripper.order_winch(  # type: ignore[misc]
                    WinchAction.LENGTH, winch=name, **values
                ),
            )
    for relay in found.relays:
        yield "a state of another", lambda name=relay.name: gripper.set_relay(_ABSENT, relay=name)  # type: ignore[misc]


def _orders(found: Equipment) -> list[str]:
    return [each.ordered for kind in (found.grippers, found.winches, found.servos, found.relays) for each in kind]


def _carried(flight: Flight) -> Equipment:
    try:
        return flight.uav.gripper.get_all()
    except NotSupportedError as error:
        raise CannotRunError(error.message) from None


ON_GROUND = (lists_what_it_carries, moves_only_what_is_configured)
