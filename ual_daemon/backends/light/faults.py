"""The simulated faults of one vehicle."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Mapping
from types import MappingProxyType

from ual.errors import InvalidArgumentError
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    FailsafeTriggered,
    Fault,
    LinkLost,
    MotorsWeak,
    PositionLost,
)
from ual_daemon import validation
from ual_daemon.backends.base import Clock
from ual_daemon.backends.light.world import Vehicles
from ual_daemon.backends.values import Cause


class Faults:
    """The active faults, each with the time at which it ends. All members may be called from any thread."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._active: Mapping[str, tuple[Fault, float, float]] = MappingProxyType({})  # fault, begin, end
        self.any_active = False
        """Whether any fault is active. An attribute, as each step looks; so are those that follow."""
        self.is_link_lost = False
        """Whether the link carries no messages in either direction."""
        self.failsafe: Cause | None = None
        """The failsafe that is active; None if none is."""

    def begin(self, fault: Fault, duration_s: float) -> str:
        """Begins a fault, for a duration or (0) until `end`. Returns the fault's id.

        Raises:
            InvalidArgumentError: A value of the fault or the duration is not valid.
        """
        _check(fault)
        duration_s = validation.not_negative(duration_s, "duration_s", at_most=1e9)
        now_s = self._clock.now_s()
        fault_id = os.urandom(4).hex()
        ends_s = now_s + duration_s if duration_s else math.inf
        with self._lock:
            self._set({**self._active, fault_id: (fault, now_s, ends_s)})
        return fault_id

    def end(self, fault_id: str) -> None:
        """Ends a fault, or (empty) all faults.

        Raises:
            InvalidArgumentError: There is no fault with this id.
        """
        with self._lock:
            if fault_id and fault_id not in self._active:
                raise InvalidArgumentError(f"fault_id: there is no fault {fault_id[:100]!r}", {"field": "fault_id"})
            kept = {other: entry for other, entry in self._active.items() if fault_id and other != fault_id}
            self._set(kept)

    def active(self) -> dict[str, Fault]:
        """Returns the active faults by their ids."""
        return {fault_id: fault for fault_id, (fault, _, _) in self._active.items()}

    def _set(self, active: Mapping[str, tuple[Fault, float, float]]) -> None:
        """Sets the faults that are active. The caller holds the lock."""
        self._active = MappingProxyType(dict(active))
        faults = [fault for fault, _, _ in active.values()]
        self.is_link_lost = any(isinstance(fault, LinkLost) for fault in faults)
        failsafes = (Cause(fault.cause) for fault in faults if isinstance(fault, FailsafeTriggered))
        self.failsafe, self.any_active = next(failsafes, None), bool(faults)

    def step(self, now_s: float) -> None:
        """Ends the faults whose time has passed."""
        over = [fault_id for fault_id, (_, _, ends_s) in self._active.items() if now_s >= ends_s]
        if over:
            with self._lock:
                self._set({k: v for k, v in self._active.items() if k not in over})

    def apply(self, fleet: Vehicles, index: int, now_s: float) -> None:
        """Applies the faults to the vehicle's row. The caller holds the world's lock."""
        fleet.power[index] = 1.0
        fleet.has_position[index] = True
        fleet.estimate_offset[index] = (0.0, 0.0, 0.0)
        for fault, began_s, _ in self._active.values():
            match fault:
                case MotorsWeak(power_ratio):
                    fleet.power[index] = power_ratio
                case FailsafeTriggered(Cause.TERMINATION.value):
                    fleet.power[index] = 0.0
                case PositionLost():
                    fleet.has_position[index] = False
                case EstimatorJumps(offset, period_s):
                    if (now_s - began_s) % (2.0 * period_s) < period_s:
                        x, y, z = offset
                        fleet.estimate_offset[index] = (x, y, z)
                case BatteryLow(remaining_percent):
                    fleet.battery_percent[index] = min(fleet.battery_percent[index], remaining_percent)
                case _:
                    pass  # a fault of the link, not of the vehicle

    def refusal(self, command: Command) -> str | None:
        """Returns the text with which the autopilot refuses a command; None if it does not refuse."""
        for fault, _, _ in self._active.values():
            if isinstance(fault, CommandRefused) and fault.command in (command, Command.ANY):
                return fault.text or "refused"
        return None

    def is_ack_lost(self, command: Command) -> bool:
        """Returns whether the acknowledgement of a command is lost."""
        return any(
            isinstance(fault, AckLost) and fault.command in (command, Command.ANY)
            for fault, _, _ in self._active.values()
        )

    def ack_delay_s(self, command: Command) -> float:
        """Returns how much later the acknowledgement of a command comes."""
        return max(
            (
                fault.delay_s
                for fault, _, _ in self._active.values()
                if isinstance(fault, AckLate) and fault.command in (command, Command.ANY)
            ),
            default=0.0,
        )


def _check(fault: Fault) -> None:
    match fault:
        case EstimatorJumps(offset, period_s):
            validation.position(offset, "fault.estimator_jumps.offset")
            validation.positive(period_s, "fault.estimator_jumps.period_s", at_most=1e9)
        case MotorsWeak(power_ratio):
            validation.not_negative(power_ratio, "fault.motors_weak.power_ratio", at_most=1.0)
        case BatteryLow(remaining_percent):
            validation.not_negative(remaining_percent, "fault.battery_low.remaining_percent", at_most=100.0)
        case AckLate(_, delay_s):
            validation.positive(delay_s, "fault.ack_late.delay_s", at_most=1e9)
        case FailsafeTriggered(cause):
            known = [each.value for each in Cause if each.is_failsafe]
            if cause not in known:
                what = f"{cause[:100]!r} is no failsafe (known: {', '.join(known)})"
                raise validation.refuse("fault.failsafe_triggered.cause", what)
        case LinkLost() | PositionLost() | CommandRefused() | AckLost():
            pass
        case _:
            raise validation.refuse("fault", f"{fault!r} is not a fault of the light simulation")
