"""``ual-daemon`` with two more backends: ``python -m tests.autopilots.daemon --backend lockstep_px4``."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from ual_daemon.backends import registry
from ual_daemon.main import main

_BACKENDS = (
    EntryPoint("lockstep_px4", "tests.autopilots.lockstep:LockstepPx4", registry.GROUP),
    EntryPoint("lockstep_ardupilot", "tests.autopilots.lockstep:LockstepArduPilot", registry.GROUP),
)


def _entry_points(**selection: Any) -> Iterable[EntryPoint]:
    return [*(each for each in _BACKENDS if each.matches(**selection)), *entry_points(**selection)]


if __name__ == "__main__":
    registry.entry_points = _entry_points  # type: ignore[assignment,attr-defined]
    main()
