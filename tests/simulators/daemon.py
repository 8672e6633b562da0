"""``ual-daemon`` with two more backends: ``python -m tests.simulators.daemon --backend lockstep_px4``."""

from __future__ import annotations

from importlib.metadata import EntryPoint

from ual_daemon.backends import registry
from ual_daemon.program.main import main

_BACKENDS = (
    EntryPoint("lockstep_px4", "tests.simulators.lockstep:LockstepPx4", registry.GROUP),
    EntryPoint("lockstep_ardupilot", "tests.simulators.lockstep:LockstepArduPilot", registry.GROUP),
)


if __name__ == "__main__":
    registry.entry_points = lambda: _BACKENDS
    main()
