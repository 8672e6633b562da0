"""Interface of a backend's fence and rally points; see `ual_daemon.services.fence`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import Future
from typing import NamedTuple

from ual.fences.values import FenceZone, RallyPoint
from ual_daemon.backends.offers.parameters import Refusal


class FenceSwitch(NamedTuple):
    """A parameter on which it depends whether the autopilot applies its zones.

    It does where the value is at least `least`, or with `is_bit` where the value has the bit `on`. Off, a bit stays:
    it chooses what applies, not whether.
    """

    name: str
    on: int
    is_bit: bool = False
    least: int = 1

    def is_on(self, value: float) -> bool:
        """Returns whether a value has the zones applied."""
        return bool(int(value) & self.on) if self.is_bit else value >= self.least

    def switched(self, value: float, *, is_on: bool) -> float:
        """Returns the value that switches it so; the same where it is so already."""
        if self.is_on(value) is is_on or (self.is_bit and not is_on):
            return value
        return int(value) | self.on if self.is_bit else self.on * is_on


class AutopilotFenceStore(ABC):
    """Reads and uploads what one autopilot keeps. From any thread; no method waits.

    Each future ends by itself, also where nothing answers: with a `LinkLostError`, or with a `UalTimeoutError`. It ends
    with a `RejectedByAutopilotError` where the autopilot refuses, or what it has is no fence.
    """

    @property
    @abstractmethod
    def switches(self) -> tuple[FenceSwitch, ...]:
        """The parameters by which it applies its zones; empty while the autopilot is not known."""

    @property
    @abstractmethod
    def unites_inclusions(self) -> bool:
        """Whether the UAV may be in any one of several inclusions, as far as is known."""

    @property
    def keeps_parts(self) -> bool:
        """Whether an upload of zones that is cut off may leave a part of it, instead of those that were there."""
        return True

    @property
    def keeps_parts_of_rally(self) -> bool:
        """As `keeps_parts`, of rally points."""
        return True

    @property
    def return_point(self) -> tuple[float, float] | None:
        """The latitude and the longitude of the point to return to, as it was read last with the zones.

        None: there is none. `write` keeps it, unless it removes all.
        """
        return None

    @abstractmethod
    def read(self) -> Future[tuple[FenceZone, ...]]:
        """Reads the zones."""

    @abstractmethod
    def read_rally(self) -> Future[tuple[RallyPoint, ...]]:
        """Reads the rally points: none where the autopilot keeps no such list."""

    @abstractmethod
    def write(self, zones: Sequence[FenceZone], refusal: Refusal) -> Future[tuple[FenceZone, ...]]:
        """Has the autopilot keep these zones only, and reads them back.

        `refusal` is called each time before something is sent that leads to a change, see `AutopilotParameters.write`.
        """

    @abstractmethod
    def write_rally(self, points: Sequence[RallyPoint], refusal: Refusal) -> Future[tuple[RallyPoint, ...]]:
        """Has the autopilot keep these rally points only, and reads them back, as `write`."""
