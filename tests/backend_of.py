"""The backend of a UAV that is flown."""

from ual_daemon import UAL
from ual_daemon.backends.base import Backend
from ual_daemon.vehicle.vehicle import Vehicle


def backend_of(uav: UAL) -> Backend:
    """Returns the backend under a UAV; a recording has none."""
    assert isinstance(uav.vehicle, Vehicle)
    return uav.vehicle.backend
