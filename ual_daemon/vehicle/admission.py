"""The last checks of a motion before it begins, or before a dry run returns its plan."""

from __future__ import annotations

from ual.types import Plan
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.tracker.references import Reference
from ual_daemon.trajectory import Trajectory


def admit(flight: Flight, command: str, motion: Trajectory | Reference, snapshot: Snapshot) -> Plan:
    """Checks a motion that is to begin now, and returns its plan.

    Raises:
        WrongStateError: It may not replace the manoeuvre that is in progress, or it is not known where the geofence
            lies.
        GeofenceError: It would leave the geofence.

    """
    flight.require_replaceable(command)
    flight.geofence.admit(command, motion, flight.limits.get(), snapshot)
    return Plan(motion.length_m, motion.duration_s) if isinstance(motion, Trajectory) else Plan()
