"""Payload devices of a UAV that hold, drop and switch: allowed orders, and the callers that may give them. The manual
is docs/how-to/gripper.md.

A load that is dropped changes what flies, and what is below. So an order needs the lease, as a motion does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any, Protocol, TypeVar

from ual import gripper as values
from ual.errors import UalError
from ual.gripper import GripperState, WinchAction, WinchStatus
from ual_daemon import validation
from ual_daemon.backends import futures
from ual_daemon.backends.chain import then, together
from ual_daemon.backends.offers.gripper import GripperDriver, ServoOrder, WinchOrder
from ual_daemon.services.vehicle import ServedVehicle, driver_of, require_change
from ual_daemon.settings import GripperSettings, RelaySettings, ServoSettings, WinchSettings
from ual_daemon.vehicle.equipment import PayloadDevice, PayloadEquipment

S = TypeVar("S")
T = TypeVar("T")

_LENGTH_ONLY = "only LENGTH has a length"
_UNKNOWN = GripperState.UNKNOWN


class EquippedVehicle(ServedVehicle, Protocol):
    """One that may carry something."""

    @property
    def equipment(self) -> PayloadEquipment:
        """Payload devices of the UAV."""


class _Named(Protocol):
    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=_Named)


class VehicleGripper:
    """Payload devices of one UAV. From any thread; no method waits."""

    def __init__(self, vehicle: EquippedVehicle) -> None:
        self._vehicle = vehicle

    def get_all(self) -> Future[values.Equipment]:
        """See `ual.interface.Gripper`."""
        offer, settings = self._offer(), self._vehicle.equipment.settings
        parts: tuple[Future[Any], ...] = (
            together(self._gripper(offer, each) for each in settings.grippers),
            together(self._winch(offer, each) for each in settings.winches),
            together(self._servo(offer, each) for each in settings.servos),
            together(self._relay(offer, each) for each in settings.relays),
        )
        return then(together(parts), lambda found: values.Equipment(*found))

    def grip(self, gripper: str, lease_id: str) -> Future[None]:
        """See `ual.interface.Gripper`."""
        return self._move_gripper(gripper, lease_id, is_closing=True)

    def release(self, gripper: str, lease_id: str) -> Future[None]:
        """See `ual.interface.Gripper`."""
        return self._move_gripper(gripper, lease_id, is_closing=False)

    def order_winch(
        self, action: WinchAction, winch: str, length_m: float | None, rate_m_s: float | None, lease_id: str
    ) -> Future[None]:
        """See `ual.interface.Gripper`."""
        offer = self._offer()
        found = _found(self._vehicle.equipment.settings.winches, winch, "winch", "winches")
        order = _winch_order(found, action, length_m, rate_m_s)
        give = partial(offer.order_winch, found.instance, order)
        return self._give(PayloadDevice("winch", found.name), _winch_text(order), lease_id, give, holds=order.holds)

    def set_servo(self, position: str, servo: str, pwm_us: int | None, lease_id: str) -> Future[None]:
        """See `ual.interface.Gripper`."""
        offer = self._offer()
        found = _found(self._vehicle.equipment.settings.servos, servo, "servo", "servos")
        wanted_us = _pwm_us(found, position, pwm_us)
        order = ServoOrder(found.channel, wanted_us, found.min_pwm_us, found.max_pwm_us)
        text = position or f"{wanted_us} us"
        return self._give(PayloadDevice("servo", found.name), text, lease_id, partial(offer.set_servo, order))

    def set_relay(self, state: str, relay: str, lease_id: str) -> Future[None]:
        """See `ual.interface.Gripper`."""
        offer = self._offer()
        found = _found(self._vehicle.equipment.settings.relays, relay, "relay", "relays")
        validation.require_type(state, str, "state")
        if state not in (found.on_name, found.off_name):
            known = f"{found.on_name}, {found.off_name}"
            raise validation.refuse("state", f"the relay {found.name} has no state {state!r:.80}: it has {known}")
        give = partial(offer.set_relay, found.number, is_on=state == found.on_name)
        return self._give(PayloadDevice("relay", found.name), state, lease_id, give)

    def _move_gripper(self, name: str, lease_id: str, *, is_closing: bool) -> Future[None]:
        offer = self._offer()
        gripper = _found(self._vehicle.equipment.settings.grippers, name, "gripper", "grippers")
        give = partial(offer.grip if is_closing else offer.release, gripper.instance)
        text = "grip" if is_closing else "release"
        return self._give(PayloadDevice("gripper", gripper.name), text, lease_id, give, holds=is_closing)

    def _give(
        self, device: PayloadDevice, text: str, lease_id: str, begin: Callable[[], Future[None]], *, holds: bool = False
    ) -> Future[None]:
        require = partial(require_change, self._vehicle, f"order {device.text}", lease_id)
        return self._vehicle.equipment.give(device, text, begin, holds=holds, require=require)

    def _gripper(self, offer: GripperDriver, each: GripperSettings) -> Future[values.GripperInfo]:
        def made(state: GripperState | None, note: str) -> values.GripperInfo:
            return values.GripperInfo(each.name, state or _UNKNOWN, self._ordered("gripper", each), note)

        return _noted(partial(offer.gripper_state, each.instance), made)

    def _winch(self, offer: GripperDriver, each: WinchSettings) -> Future[values.WinchInfo]:
        def made(status: WinchStatus | None, note: str) -> values.WinchInfo:
            return values.WinchInfo(each.name, status, self._ordered("winch", each), note)

        return _noted(partial(offer.winch_status, each.instance), made)

    def _servo(self, offer: GripperDriver, each: ServoSettings) -> Future[values.ServoInfo]:
        positions = tuple(each.positions.items())

        def made(pwm_us: int | None, note: str) -> values.ServoInfo:
            at = next((name for name, position_us in positions if position_us == pwm_us), "")
            ordered = self._ordered("servo", each)
            return values.ServoInfo(each.name, each.min_pwm_us, each.max_pwm_us, positions, pwm_us, at, ordered, note)

        return _noted(partial(offer.servo_pwm_us, each.channel), made)

    def _relay(self, offer: GripperDriver, each: RelaySettings) -> Future[values.RelayInfo]:
        def made(is_on: bool | None, note: str) -> values.RelayInfo:
            return values.RelayInfo(each.name, each.on_name, each.off_name, is_on, self._ordered("relay", each), note)

        return _noted(partial(offer.relay_is_on, each.number), made)

    def _ordered(self, kind: str, each: _Named) -> str:
        return self._vehicle.equipment.ordered(PayloadDevice(kind, each.name))

    def _offer(self) -> GripperDriver:
        return driver_of(self._vehicle, GripperDriver, "grippers")  # type: ignore[type-abstract]  # it is only looked for


def _found(configured: Sequence[N], name: str, field: str, section: str) -> N:
    """Returns the device of a name; without a name the only one."""
    validation.require_type(name, str, field)
    known = ", ".join(each.name for each in configured)
    if not configured:
        raise validation.refuse(field, f"no {field} is configured: name it in the daemon's settings, payload.{section}")
    if not name and len(configured) > 1:
        raise validation.refuse(field, f"say which: {known}")
    for each in configured:
        if name in ("", each.name):
            return each
    raise validation.refuse(field, f"no {field} {name!r:.80} is configured; there are: {known}")


def _winch_order(
    winch: WinchSettings, action: WinchAction, length_m: float | None, rate_m_s: float | None
) -> WinchOrder:
    validation.require_type(action, WinchAction, "action")
    if action is WinchAction.LENGTH:
        length_m = _needed(length_m, "length_m", action, winch.longest_m)
        if not length_m:
            raise validation.refuse("length_m", "no line is to move: order HOLD to stop")
        if rate_m_s is not None:
            rate_m_s = validation.positive(rate_m_s, "rate_m_s", at_most=winch.fastest_m_s)
        return WinchOrder(action, length_m, rate_m_s)
    if length_m is not None:
        raise validation.refuse("length_m", _LENGTH_ONLY)
    if action is WinchAction.RATE:
        return WinchOrder(action, None, _needed(rate_m_s, "rate_m_s", action, winch.fastest_m_s))
    if rate_m_s is not None:
        raise validation.refuse("rate_m_s", "only RATE and LENGTH have a rate")
    return WinchOrder(action)


def _needed(value: float | None, field: str, action: WinchAction, at_most: float) -> float:
    if value is None:
        raise validation.refuse(field, f"{action.name} needs it")
    return validation.number(value, field, at_most=at_most)


def _pwm_us(servo: ServoSettings, position: str, pwm_us: int | None) -> int:
    validation.require_type(position, str, "position")
    if bool(position) is (pwm_us is not None):
        raise validation.refuse("position", "give either the name of a position, or a pwm_us")
    if pwm_us is None:
        if position not in servo.positions:
            known = ", ".join(servo.positions) or "none"
            raise validation.refuse("position", f"the servo {servo.name} has no {position!r:.80}; it has: {known}")
        return servo.positions[position]
    validation.require_type(pwm_us, int, "pwm_us")
    if not servo.min_pwm_us <= pwm_us <= servo.max_pwm_us:
        bounds = f"{servo.min_pwm_us} to {servo.max_pwm_us}"
        raise validation.refuse("pwm_us", f"{pwm_us} is not from {bounds}, the bounds of {servo.name}")
    return pwm_us


def _winch_text(order: WinchOrder) -> str:
    length = "" if order.length_m is None else f" {order.length_m:g} m"
    rate = "" if order.rate_m_s is None else f" {order.rate_m_s:g} m/s"
    return f"{order.action.name.lower()}{length}{rate}"


def _noted(ask: Callable[[], Future[S]], make: Callable[[S | None, str], T]) -> Future[T]:
    """Returns what is made of an answer, or of None and the reason why there is none."""
    result: Future[T] = Future()

    def on_answer(answered: Future[S]) -> None:
        error = UalError("it was withdrawn") if answered.cancelled() else answered.exception()
        if error is None:
            futures.finish(result, make(answered.result(), ""))
        else:
            futures.finish(result, make(None, error.message if isinstance(error, UalError) else str(error)))

    try:
        ask().add_done_callback(on_answer)
    except UalError as error:
        futures.finish(result, make(None, error.message))
    return result
