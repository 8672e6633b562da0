"""The fence that the autopilot itself applies."""

from __future__ import annotations

from typing import NamedTuple


class FenceLimit(NamedTuple):
    """One limit of an autopilot's own fence: metres, and the name of the autopilot's parameter."""

    value_m: float
    parameter: str


class Zone(NamedTuple):
    """A polygon or a circle on Earth of an autopilot's own fence: to be kept inside (an inclusion) or outside of.

    `points` are latitude and longitude in degrees. They are the corners of a polygon in order (its last side leads back
    to the first), or the centre of a circle, which has a radius. `name` is human-readable:
    ``inclusion polygon 1 of 2``.
    """

    name: str
    is_inclusion: bool
    points: tuple[tuple[float, float], ...]
    radius_m: float | None = None


class AutopilotFence(NamedTuple):
    """The fence that the autopilot itself applies; None: no such limit. The limits are around its home, heights above.

    `zones` are anywhere on Earth: it stays outside all exclusions, and inside all inclusions, or with
    `unites_inclusions` inside at least one.
    `unread` says what else it has that is not known here, such as a polygon; empty if there is nothing.
    `is_cut_by_unread` is whether it surely has that: a goal that is admitted may then lie beyond it.
    """

    radius: FenceLimit | None = None
    highest: FenceLimit | None = None
    lowest: FenceLimit | None = None
    unread: str = ""
    is_cut_by_unread: bool = False
    zones: tuple[Zone, ...] = ()
    unites_inclusions: bool = False

    @property
    def limits(self) -> tuple[FenceLimit, ...]:
        """All limits that it has."""
        return tuple(each for each in (self.radius, self.highest, self.lowest) if each is not None)


NO_FENCE = AutopilotFence()
