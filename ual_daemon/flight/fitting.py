"""Has what is flown fit itself to a world that has changed: limits, geofence, home."""

from __future__ import annotations

from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step, guarded
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.tracker.limits import CurrentLimits


class Fitting:
    """Knows what bounded motions at the last update that had one. Only the update thread calls it."""

    def __init__(self, backend: Backend, limits: CurrentLimits, geofence: GeofencePolicy) -> None:
        self._backend = backend
        self._limits = limits
        self._geofence = geofence
        self._world: tuple[object, ...] = ()

    def step(self, manoeuvre: Manoeuvre, snapshot: Snapshot) -> Step | None:
        """Fits a manoeuvre to what bounds it now, if that has changed, or if it has just begun; see `Manoeuvre.fit`."""
        world = (self._backend.info(), *self._geofence.depends_on(snapshot))
        has_changed, self._world = world != self._world, world
        if manoeuvre.is_fitted and not has_changed:
            return None
        manoeuvre.is_fitted = True
        return guarded(manoeuvre, manoeuvre.fit, snapshot, self._limits, self._geofence)
