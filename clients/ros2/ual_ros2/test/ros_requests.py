"""Data of a UAV on topics that keep their last message: its info, its fence, and its controller."""

from __future__ import annotations

from derived_values import read_geofence, read_info, read_lease
from flying import LATCHED, Client, waited
from ual_msgs.msg import Geofence, Info, Lease

import ual


class LatchedTopics:
    """Hears the topics, and reads what came last."""

    def __init__(self, client: Client, ns: str) -> None:
        prefix = f"/{ns}/ual"
        self._infos = client.hear(Info, f"{prefix}/info", LATCHED)
        self._geofences = client.hear(Geofence, f"{prefix}/geofence", LATCHED)
        self._leases = client.hear(Lease, f"{prefix}/lease", LATCHED)

    def info(self) -> ual.Info:
        """Returns who it is."""
        told = waited(lambda: self._infos)[-1]
        return read_info(told)

    def geofence(self) -> ual.types.Geofence:
        """Returns where it may fly.

        Raises:
            WrongStateError: That is not known.

        """
        told = waited(lambda: self._geofences)[-1]
        if told.unknown:
            raise ual.WrongStateError(told.unknown)
        return read_geofence(told)

    def lease(self) -> ual.types.LeaseInfo | None:
        """Returns who holds the lease."""
        told = waited(lambda: self._leases)[-1]
        return read_lease(told) if told.is_held else None
