"""Since when each UAV has had no newer pose. Pure; draws nothing."""

from __future__ import annotations

from collections.abc import Container

from ual_tools.watch_board import WatchedUav


class PoseTimes:
    """Compares the times of the poses with each other only: they may be of another clock, or simulated."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[float, float]] = {}

    def since_s(self, ns: str, watched: WatchedUav, now_s: float) -> float | None:
        """Returns the monotonic time at which the newest pose came; None where there is none, or none with a time."""
        telemetry = watched.telemetry
        if telemetry is None or telemetry.transform is None or not telemetry.stamp_s:
            return None
        if ns not in self._known or self._known[ns][0] != telemetry.stamp_s:
            self._known[ns] = telemetry.stamp_s, min(watched.since_s, now_s)
        return self._known[ns][1]

    def keep(self, names: Container[str]) -> None:
        """Forgets all other UAVs."""
        self._known = {ns: known for ns, known in self._known.items() if ns in names}
