"""Orders of an autopilot to grippers, winches, servos and relays, whatever protocol reaches it.

Read in the sources of PX4 1.17 (payload_deliverer, FunctionActuatorSet) and ArduCopter 4.6 (AP_Gripper, AP_Winch,
AP_ServoRelayEvents).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple, TypeVar

from typing_extensions import override

from ual.errors import NotSupportedError
from ual.gripper import GripperState, WinchAction
from ual_daemon.backends.engine.command import Command, Repeat
from ual_daemon.backends.offers.gripper import ServoOrder, WinchOrder

R = TypeVar("R")

SET_RELAY, SET_SERVO, SET_ACTUATOR, GRIPPER, WINCH = 181, 183, 187, 211, 42600
"""Of MAV_CMD, with DO_ before them."""
_RELEASE, _GRAB = 0.0, 1.0
_HOLD_RATE_PARAMETER = 2.0
_ACTUATORS_COUNT = 6
ANSWER_S = 3.0
"""Seconds for which an answer is awaited. An autopilot answers within 15 ms, over a bad radio within 200."""
UNSENT_ORDER_S = 1.5
"""Seconds after which an order that could not leave is dropped: the UAV is elsewhere then."""
ONCE = Repeat(every_s=ANSWER_S, most=1)
AGAIN = Repeat(every_s=0.25, most=round(ANSWER_S / 0.25))


class PayloadOrder(NamedTuple):
    """A command of MAVLink that moves something. `params` are its first ones; zeros follow.

    Attributes:
        what: Human-readable: "release the gripper".
        device: What it moves: of one device the newest order counts.
        holds: Whether it may be repeated; see `GripperDriver`.

    """

    what: str
    id: int
    params: tuple[float, ...]
    device: str
    holds: bool = False


class GripperCodec:
    """Orders that all autopilots take that obey MAVLink's commands. `name` is the autopilot's."""

    texts: Mapping[str, GripperState] = MappingProxyType({})
    """States of its gripper by its status texts, as it has no message for that."""
    tells_winches = tells_servos = tells_relays = True
    """Whether it says in which state they are."""

    def __init__(self, name: str) -> None:
        self._name = name

    def grip(self, instance: int, *, is_closing: bool) -> PayloadOrder:
        """Closes or opens a gripper."""
        self._require_first("gripper", instance)
        action, what = (_GRAB, "grip") if is_closing else (_RELEASE, "release the gripper")
        return PayloadOrder(what, GRIPPER, (float(instance), action), f"gripper {instance}", is_closing)

    def winch(self, instance: int, order: WinchOrder) -> PayloadOrder:
        """Has a winch do something."""
        self._require_first("winch", instance)
        action = float(order.action.value - 1)  # as WINCH_ACTIONS
        params = (float(instance), action, order.length_m or 0.0, order.rate_m_s or 0.0)
        what = f"have the winch {order.action.name.lower().replace('_', ' ')}"
        return PayloadOrder(what, WINCH, params, f"winch {instance}", order.holds)

    def servo(self, order: ServoOrder) -> PayloadOrder:
        """Moves a servo."""
        params = (float(order.channel), float(order.pwm_us))
        return PayloadOrder(f"move servo {order.channel}", SET_SERVO, params, f"servo {order.channel}")

    def relay(self, number: int, *, is_on: bool) -> PayloadOrder:
        """Switches a relay: MAVLink counts from 0."""
        params = (number - 1.0, float(is_on))
        return PayloadOrder(f"switch relay {number}", SET_RELAY, params, f"relay {number}")

    def _require_first(self, kind: str, instance: int) -> None:
        """It has one, and moves that whatever number is given."""
        if instance != 1:
            raise NotSupportedError(f"{self._name} has one {kind}: its instance is 1, and not {instance}")


class ArduPilotGripper(GripperCodec):
    """ArduPilot's. Its winch relaxes, and moves a length or at a rate."""

    texts = MappingProxyType(
        {
            "Gripper load grabbing": GripperState.CLOSING,
            "Gripper load grabbed": GripperState.CLOSED,
            "Gripper load releasing": GripperState.OPENING,
            "Gripper load released": GripperState.OPEN,
        }
    )
    _ACTIONS = (WinchAction.RELAX, WinchAction.LENGTH, WinchAction.RATE, WinchAction.HOLD)

    @override
    def winch(self, instance: int, order: WinchOrder) -> PayloadOrder:
        if order.action not in self._ACTIONS:
            known = ", ".join(each.name for each in self._ACTIONS)
            raise NotSupportedError(f"{self._name}'s winch cannot {order.action.name}; it can {known}")
        if order.action is WinchAction.LENGTH and order.rate_m_s is not None:
            raise NotSupportedError(f"{self._name} takes no rate for a length: it is as WINCH_RATE_MAX says")
        encoded = super().winch(instance, order)
        is_hold = order.action is WinchAction.HOLD
        return encoded._replace(params=(float(instance), _HOLD_RATE_PARAMETER, 0.0, 0.0)) if is_hold else encoded


class Px4Gripper(GripperCodec):
    """PX4's: a gripper, and the actuators of a set. It says nothing of either."""

    tells_winches = tells_servos = tells_relays = False

    @override
    def winch(self, instance: int, order: WinchOrder) -> PayloadOrder:
        raise NotSupportedError(f"{self._name} has no winch: it takes the command, and answers nothing")

    @override
    def servo(self, order: ServoOrder) -> PayloadOrder:
        """Its range is from -1 to 1, whatever pulse the output makes of it."""
        if order.channel > _ACTUATORS_COUNT:
            text = f"{self._name} has the actuators 1 to {_ACTUATORS_COUNT} of its set, and no {order.channel}"
            raise NotSupportedError(text)
        share = (order.pwm_us - order.min_pwm_us) / (order.max_pwm_us - order.min_pwm_us)
        values = [math.nan] * _ACTUATORS_COUNT  # the others stay as they are
        values[order.channel - 1] = 2.0 * share - 1.0
        what = f"move actuator {order.channel}"
        return PayloadOrder(what, SET_ACTUATOR, (*values, 0.0), f"servo {order.channel}")

    @override
    def relay(self, number: int, *, is_on: bool) -> PayloadOrder:
        raise NotSupportedError(f"{self._name} has no relays")


def ordered(command: Command[R], order: PayloadOrder) -> Command[R]:
    """Returns a command that keeps the rules of an order."""
    return replace(
        command,
        group=f"payload {order.device}",
        repeat=AGAIN if order.holds else ONCE,
        unsent_s=UNSENT_ORDER_S,
        is_told_by_answer=True,
    )
