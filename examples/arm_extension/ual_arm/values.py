"""A two-joint arm below a UAV: an example of a service that a package adds to the daemon.

As values, from ``arm.proto``. Written by ``tools.contract.extension``: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Joints:
    """Angles of the joints, in radians, positive downwards; zero is straight ahead.

    Args:
        elbow_rad: Relative to the upper arm.

    """

    shoulder_rad: float
    elbow_rad: float
    is_moving: bool = False
