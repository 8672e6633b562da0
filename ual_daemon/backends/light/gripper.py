"""The grippers, winches, servos and relays of a light UAV: they take time to move, and say what they do."""

from __future__ import annotations

import math
import threading
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple, TypeVar

from typing_extensions import override

from ual.errors import LinkLostError, NotSupportedError, RejectedByAutopilotError, UalError
from ual.gripper import GripperState, WinchAction, WinchStatus
from ual_daemon.backends.offers.gripper import GripperDriver, ServoOrder, WinchOrder

T = TypeVar("T")

GRIPPER_S = 0.5
"""Seconds that a gripper takes to open or close."""
SERVO_US_S = 2000.0
"""Speed of a servo, in microseconds of its pulse a second."""
LINE_M = 30.0
"""Length of a winch's line in metres."""
WINCH_M_S = 1.0
"""Speed of a winch in m/s, where the order has none."""
FALL_M_S = 5.0
"""Speed in m/s of a line that runs off a drum that turns freely."""
NEUTRAL_US = 1500


class _Motion(NamedTuple):
    """Something that moves evenly to an end, and stays there."""

    value: float = 0.0
    end: float = 0.0
    rate: float = 0.0
    """Without a sign."""
    since_s: float = 0.0

    def at(self, now_s: float) -> float:
        moved = self.rate * max(0.0, now_s - self.since_s)
        left = self.end - self.value
        return self.end if moved >= abs(left) else self.value + math.copysign(moved, left)

    def speed(self, now_s: float) -> float:
        return 0.0 if self.at(now_s) == self.end else math.copysign(self.rate, self.end - self.value)

    def to(self, end: float, rate: float, now_s: float) -> _Motion:
        return _Motion(self.at(now_s), end, rate, now_s)


class _Winch:
    """A winch with `LINE_M` of line, all of it taken in at first."""

    def __init__(self) -> None:
        self._line = _Motion()
        self._is_free = False

    def order(self, order: WinchOrder, now_s: float) -> None:
        length_m = self._line.at(now_s)
        rate_m_s = abs(order.rate_m_s) if order.rate_m_s else WINCH_M_S
        if order.action is WinchAction.LOCK and length_m > 0.0:
            text = f"{length_m:.1f} m of line are out: retract it first"
            raise RejectedByAutopilotError(f"the winch refused to lock: {text}", {"text": text})
        ends = {
            WinchAction.RELAX: LINE_M,
            WinchAction.LENGTH: length_m + (order.length_m or 0.0),
            WinchAction.RATE: math.copysign(LINE_M, order.rate_m_s) if order.rate_m_s else length_m,
            WinchAction.LOCK: length_m,
            WinchAction.HOLD: length_m,
            WinchAction.RETRACT: 0.0,
            WinchAction.ABANDON_LINE: LINE_M,
        }
        if order.action not in ends:
            known = ", ".join(each.name for each in ends)
            raise NotSupportedError(f"a light UAV's winch cannot {order.action.name}; it can {known}")
        self._is_free = order.action is WinchAction.RELAX
        end_m = min(max(ends[order.action], 0.0), LINE_M)
        self._line = self._line.to(end_m, FALL_M_S if self._is_free else rate_m_s, now_s)

    def status(self, now_s: float) -> WinchStatus:
        length_m, speed_m_s = self._line.at(now_s), self._line.speed(now_s)
        return WinchStatus(
            length_m,
            speed_m_s,
            is_healthy=True,
            is_fully_retracted=length_m == 0.0,
            is_moving=speed_m_s != 0.0 and not self._is_free,
            is_clutch_engaged=self._is_free,
        )


class LightGripper(GripperDriver):
    """All of one UAV. Any number of them is there; the configuration says which. They acknowledge at once.

    Args:
        clock: Returns the simulated time.
        is_link_lost: Whether nothing reaches the autopilot.

    """

    def __init__(self, clock: Callable[[], float], is_link_lost: Callable[[], bool]) -> None:
        self._clock = clock
        self._is_link_lost = is_link_lost
        self._lock = threading.Lock()
        self._closings: defaultdict[int, _Motion] = defaultdict(_Motion)
        """Of each gripper: 0 is open, 1 closed."""
        self._winches: defaultdict[int, _Winch] = defaultdict(_Winch)
        self._servos: defaultdict[int, _Motion] = defaultdict(lambda: _Motion(NEUTRAL_US, NEUTRAL_US))
        self._relays: defaultdict[int, bool] = defaultdict(bool)

    @override
    def grip(self, instance: int) -> Future[None]:
        return self._do(lambda now_s: self._move_gripper(instance, 1.0, now_s))

    @override
    def release(self, instance: int) -> Future[None]:
        return self._do(lambda now_s: self._move_gripper(instance, 0.0, now_s))

    @override
    def gripper_state(self, instance: int) -> Future[GripperState]:
        return self._do(lambda now_s: _state(self._closings[instance], now_s))

    @override
    def order_winch(self, instance: int, order: WinchOrder) -> Future[None]:
        return self._do(lambda now_s: self._winches[instance].order(order, now_s))

    @override
    def winch_status(self, instance: int) -> Future[WinchStatus]:
        return self._do(self._winches[instance].status)

    @override
    def set_servo(self, order: ServoOrder) -> Future[None]:
        def move(now_s: float) -> None:
            self._servos[order.channel] = self._servos[order.channel].to(order.pwm_us, SERVO_US_S, now_s)

        return self._do(move)

    @override
    def servo_pwm_us(self, channel: int) -> Future[int]:
        return self._do(lambda now_s: round(self._servos[channel].at(now_s)))

    @override
    def set_relay(self, number: int, *, is_on: bool) -> Future[None]:
        def switch(_: float) -> None:
            self._relays[number] = is_on

        return self._do(switch)

    @override
    def relay_is_on(self, number: int) -> Future[bool]:
        return self._do(lambda _: self._relays[number])

    def _move_gripper(self, instance: int, end: float, now_s: float) -> None:
        self._closings[instance] = self._closings[instance].to(end, 1.0 / GRIPPER_S, now_s)

    def _do(self, act: Callable[[float], T]) -> Future[T]:
        future: Future[T] = Future()
        try:
            if self._is_link_lost():
                raise LinkLostError("the autopilot is not heard (simulated)")
            with self._lock:
                result = act(self._clock())
        except UalError as error:
            future.set_exception(error)
        else:
            future.set_result(result)
        return future


def make_driver(clock: Callable[[], float], is_link_lost: Callable[[], bool]) -> LightGripper:
    """Makes that of one UAV."""
    return LightGripper(clock, is_link_lost)


def _state(closing: _Motion, now_s: float) -> GripperState:
    if closing.speed(now_s):
        return GripperState.CLOSING if closing.end else GripperState.OPENING
    return GripperState.CLOSED if closing.end else GripperState.OPEN
