"""Position on Earth of the configured geofence, for autopilots that keep fences by latitude and longitude."""

from __future__ import annotations

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.policy.geofence import GeofencePolicy


def fence_on_earth(geofence: GeofencePolicy, snapshot: Snapshot) -> tuple[tuple[float, float], ...]:
    """Returns the corners of the configured polygon, latitude and longitude in degrees; empty where it has none.

    Raises:
        WrongStateError: It is not known where they lie.
        FrameLostError: It is not known any more.

    """
    corners = geofence.edges(snapshot).corners
    projection = snapshot.earth.projection
    if corners and projection is None:
        raise WrongStateError("the geofence cannot be told on Earth: the autopilot has not said where on Earth it is")
    assert projection is not None or not corners
    places = [projection.to_geo(Vector3(x, y, 0.0)) for x, y in corners] if projection is not None else []
    return tuple((place.latitude_deg, place.longitude_deg) for place in places)
