"""UAL in the process, within a configured fence."""

from __future__ import annotations

from benchmarks.peers import ual_class
from benchmarks.setups import FENCE
from ual_daemon.settings import GeofenceSettings, VehicleSettings


class Peer(ual_class.Peer):
    settings = VehicleSettings(geofence=GeofenceSettings(polygon=FENCE))
