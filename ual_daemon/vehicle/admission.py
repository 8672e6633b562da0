"""The last checks of a motion before it begins, or before a dry run returns its plan."""

from __future__ import annotations

from ual.types import Plan
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.tracker.references import Reference, measured_motion
from ual_daemon.trajectory import Trajectory


def admit(flight: Flight, command: str, motion: Trajectory | Reference, snapshot: Snapshot) -> Plan:
    """Checks a motion that is to begin now, and returns its plan.

    Raises:
        WrongStateError: It may not replace the manoeuvre that is under way, or it is not known where the geofence lies.
        GeofenceError: It would leave the geofence.

    """
    flight.require_replaceable(command)
    require_inside(flight, command, motion, snapshot)
    return Plan(motion.length_m, motion.duration_s) if isinstance(motion, Trajectory) else Plan()


def require_inside(flight: Flight, command: str, motion: Trajectory | Reference, snapshot: Snapshot) -> None:
    """Checks that a motion that begins now stays inside the geofence.

    Raises:
        WrongStateError: It is not known where the geofence lies.
        GeofenceError: It would leave the geofence.

    """
    geofence = flight.geofence
    if isinstance(motion, MovingGoal):
        line = [measured_motion(snapshot).position, motion.goal(snapshot.time_s).position]
        geofence.require_inside(line, command, snapshot)
    else:
        geofence.admit(command, motion, flight.limits.get(), snapshot)
