"""What a UAV tells on topics that keep their last message: who it is, where it may fly, and who flies it."""

from __future__ import annotations

import math
from typing import Any

from flying import LATCHED, Client, waited
from ual_msgs.msg import Geofence, Info, Lease

import ual
from ual_ros2 import values


class Asked:
    """Hears the topics, and reads what came last."""

    def __init__(self, client: Client, ns: str) -> None:
        prefix = f"/{ns}/ual"
        self._infos = client.hear(Info, f"{prefix}/info", LATCHED)
        self._geofences = client.hear(Geofence, f"{prefix}/geofence", LATCHED)
        self._leases = client.hear(Lease, f"{prefix}/lease", LATCHED)

    def info(self) -> ual.Info:
        """Returns who it is."""
        told = waited(lambda: self._infos)[-1]
        return ual.Info(
            namespace=told.ns,
            backend=told.backend,
            autopilot=told.autopilot,
            autopilot_version=told.autopilot_version,
            is_simulation=told.is_simulation,
            capabilities=frozenset(ual.types.Capability[name] for name in told.capabilities),
            limits=_limits(told),
            ual_version=told.ual_version,
            is_arming_allowed=told.is_arming_allowed,
            url=told.url,
            has_safety_pilot=told.has_safety_pilot,
        )

    def geofence(self) -> ual.types.Geofence:
        """Returns where it may fly.

        Raises:
            WrongStateError: That is not known.

        """
        told = waited(lambda: self._geofences)[-1]
        if told.unknown:
            raise ual.WrongStateError(told.unknown)
        return ual.types.Geofence(
            told.header.frame_id,
            tuple(map(values.vector, told.corners)),
            ual.types.Circle(values.vector(told.center), told.radius) if told.has_circle else None,
            told.min_z if math.isfinite(told.min_z) else None,
            told.max_z if math.isfinite(told.max_z) else None,
        )

    def lease(self) -> ual.types.LeaseInfo | None:
        """Returns who holds the lease."""
        told = waited(lambda: self._leases)[-1]
        if not told.is_held:
            return None
        return ual.types.LeaseInfo(told.holder, told.identity, values.stamp_s(told.since))


def _limits(told: Any) -> ual.types.Limits:
    return ual.types.Limits(
        told.horizontal_speed,
        told.climb_speed,
        told.descent_speed,
        told.horizontal_acceleration,
        told.vertical_acceleration,
        told.yaw_rate,
    )
