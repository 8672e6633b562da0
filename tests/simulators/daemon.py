"""``ual-daemon`` with more backends: ``python -m tests.simulators.daemon --backend lockstep_px4``."""

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
"""How old what an autopilot said may become for `PatientBackend`."""
_BACKENDS = (
    EntryPoint("lockstep_px4", "tests.simulators.lockstep:LockstepPx4", registry.GROUP),
    EntryPoint("lockstep_crazyflie", "tests.simulators.lockstep_crazyflie:LockstepCrazyflie", registry.GROUP),
    EntryPoint("lockstep_psdk", "tests.simulators.lockstep_dji:LockstepPsdk", registry.GROUP),
    EntryPoint("lockstep_osdk", "tests.simulators.lockstep_dji:LockstepOsdk", registry.GROUP),
    EntryPoint("lockstep_osdk_vehicle", "tests.simulators.lockstep_dji:LockstepOsdkVehicle", registry.GROUP),
    EntryPoint("lockstep_ardupilot", "tests.simulators.lockstep:LockstepArduPilot", registry.GROUP),
    EntryPoint("lockstep_mavros_px4", "tests.simulators.lockstep_mavros:LockstepMavrosPx4", registry.GROUP),
    EntryPoint("lockstep_mavros_ardupilot", "tests.simulators.lockstep_mavros:LockstepMavrosArduPilot", registry.GROUP),
    EntryPoint("patient_mavlink", "tests.simulators.daemon:PatientBackend", registry.GROUP),
)


class PatientBackend(MavlinkBackend):
    """Flies a simulated autopilot over a real link, in real time: what it said last is good for so long that neither
    it nor the daemon is missed while a busy computer gives it no processor.
    """

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        for dialect in (Dialect, ArduCopter):
            dialect.freshness = Freshness(*[PATIENCE_S] * 5)
        limits.PAUSE_S = PATIENCE_S


if __name__ == "__main__":
    registry.entry_points = lambda: _BACKENDS
    main()
