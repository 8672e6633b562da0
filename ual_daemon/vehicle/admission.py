"""What every motion passes before it begins, or before a dry run says what it would be."""

from __future__ import annotations

from ual.types import Plan
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.tracker.references import Reference, measured_motion
from ual_daemon.trajectory import Trajectory


def admit(flight: Flight, command: str, motion: Trajectory | Reference, snapshot: Snapshot) -> Plan:
    """Returns what a motion that begins now would be.

    Raises:
        WrongStateError: A manoeuvre is under way that it may not replace, or it is not known where the geofence lies.
        GeofenceError: It would leave the geofence.

    """
    flight.require_replaceable(command)
    require_inside(flight, command, motion, snapshot)
    return Plan(motion.length_m, motion.duration_s) if isinstance(motion, Trajectory) else Plan()


def require_inside(flight: Flight, command: str, motion: Trajectory | Reference, snapshot: Snapshot) -> None:
    """Raises `GeofenceError` where a motion that begins now would leave the geofence."""
    geofence = flight.geofence
    if geofence is None:
        return
    if isinstance(motion, MovingGoal):
        way = [measured_motion(snapshot).position, motion.goal(snapshot.time_s).position]
        geofence.require_inside(way, command, snapshot)
    else:
        geofence.admit(command, motion, flight.limits.get(), snapshot)
