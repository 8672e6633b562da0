"""``ual-daemon`` with one more backend: ``python -m tests.simulators.daemon --backend patient_mavlink``."""

from __future__ import annotations

from importlib.metadata import EntryPoint

from ual_daemon.backends import registry
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.engine import limits
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.values import Freshness
from ual_daemon.program.main import main

PATIENCE_S = 60.0
"""Age in seconds that reports of an autopilot may reach for `PatientBackend`."""
_BACKENDS = (EntryPoint("patient_mavlink", "tests.simulators.daemon:PatientBackend", registry.GROUP),)


class PatientBackend(MavlinkBackend):
    """Flies a simulated autopilot over a real link, in real time. What it said last is good for so long that neither
    it nor the daemon is missed while a busy computer gives it no processor.
    """

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        for dialect in (Dialect, ArduCopter):
            dialect.freshness = Freshness(*[PATIENCE_S] * 5)
        limits.READER_PAUSE_S = PATIENCE_S


if __name__ == "__main__":
    registry.entry_points = lambda: _BACKENDS
    main()
