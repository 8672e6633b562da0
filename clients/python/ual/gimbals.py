"""The gimbals of a UAV, as values. `ual.Uav.gimbals` points them; the manual is ``docs/how-to/gimbals.md``.

Angles follow REP 103, as all of UAL: a positive pitch looks down, a positive yaw is to the left.
"""

from __future__ import annotations

from ual.contract.gimbal import (
    AngleRange,
    GimbalAbility,
    GimbalActivity,
    GimbalAngles,
    GimbalControl,
    GimbalInfo,
    GimbalReference,
    GimbalStatus,
)

__all__ = [
    "AngleRange",
    "GimbalAbility",
    "GimbalActivity",
    "GimbalAngles",
    "GimbalControl",
    "GimbalInfo",
    "GimbalReference",
    "GimbalStatus",
]
