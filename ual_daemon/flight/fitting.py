"""Fits references to a world that has changed: limits, geofence. Manoeuvres fit themselves (`Manoeuvre.fit`)."""

from __future__ import annotations

from ual.errors import GeofenceError, UalError
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.policy.geofence import Geofence
from ual_daemon.tracker.limits import CurrentLimits, scaled_down
from ual_daemon.tracker.references import Hold, Reference, Velocity


def fit(reference: Reference, snapshot: Snapshot, limits: CurrentLimits, geofence: Geofence) -> UalError | None:
    """Fits a reference. Returns why it cannot go on; None if it can.

    A goal that moves looks at the world by itself each time it plans, and a stop is as good as it gets.
    """
    if isinstance(reference, Velocity):
        reference.twist = scaled_down(reference.twist, limits.get())  # the geofence is looked at in each update
    elif isinstance(reference, Hold):
        try:
            geofence.admit("set_pose", reference, limits.get(), snapshot)
        except GeofenceError as error:
            return error
        except UalError:  # it is not known where the geofence lies: nothing that is known speaks against it
            return None
    return None
