"""Reach of a UAV if a velocity is commanded now: the points that must lie inside the fence.

Pure mathematics on numbers, not on `Vector3`: each velocity setpoint and each update computes it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.frames.room import Point3
from ual_daemon.trajectory.envelope import stopping_s

REACTION_S = 0.4
"""Seconds that a UAV flies on before it begins to brake: the age of its data, the delay of the setpoint, the
tilting.
"""


class ReachablePoints(NamedTuple):
    """Points in the local frame. From `here` the UAV flies straight to each, or by way of another one.

    Attributes:
        here: Where it is.
        commanded_stop: Where it stops from the commanded velocity; from a faster one, if it flies faster in that
            direction.
        own_stop: Where it stops from its own velocity.
        changed: Where it is after the reaction time, while it changes to the commanded velocity, ...
        changed_stop: ... and where it stops from there.

    """

    here: Point3
    commanded_stop: Point3
    own_stop: Point3
    changed: Point3
    changed_stop: Point3

    def polylines(self) -> tuple[list[Vector3], ...]:
        """Returns the ways."""
        here, commanded_stop, own_stop, changed, changed_stop = (Vector3(*point) for point in self)
        return [here, commanded_stop], [here, own_stop], [here, changed, changed_stop]


def reachable_points(here: Vector3, own: Vector3, velocity: Vector3, limits: Limits) -> ReachablePoints:
    """Returns where a UAV with its `own` velocity may come to. The commanded velocity must not be zero."""
    x, y, z = here.x, here.y, here.z
    vx, vy, vz = velocity.x, velocity.y, velocity.z
    ux, uy, uz = own.x, own.y, own.z
    speed = math.hypot(vx, vy, vz)
    faster = ux * (vx / speed) + uy * (vy / speed) + uz * (vz / speed)  # not over its square, which may be too small
    if faster > speed:
        fx, fy, fz = faster * (vx / speed), faster * (vy / speed), faster * (vz / speed)
    else:
        fx, fy, fz = vx, vy, vz
    commanded_s = REACTION_S + stopping_s(fx, fy, fz, limits)
    own_s = REACTION_S + stopping_s(ux, uy, uz, limits)
    changed, changed_stop = change(here, own, velocity, limits)
    return ReachablePoints(
        (x, y, z),
        (x + fx * commanded_s, y + fy * commanded_s, z + fz * commanded_s),
        (x + ux * own_s, y + uy * own_s, z + uz * own_s),
        changed,
        changed_stop,
    )


def change(here: Vector3, own: Vector3, velocity: Vector3, limits: Limits) -> tuple[Point3, Point3]:
    """Returns where a UAV that changes to a velocity is after the reaction time, and where it stops from there."""
    ux, uy, uz = own.x, own.y, own.z
    dx, dy, dz = velocity.x - ux, velocity.y - uy, velocity.z - uz
    horizontal_s = math.hypot(dx, dy) / limits.horizontal_acceleration_m_s2
    needed_s = max(horizontal_s, abs(dz) / limits.vertical_acceleration_m_s2)
    if needed_s > REACTION_S:
        share = REACTION_S / needed_s
        dx, dy, dz = share * dx, share * dy, share * dz
    cx, cy, cz = ux + dx, uy + dy, uz + dz
    x = here.x + (ux + cx) * (REACTION_S / 2)
    y = here.y + (uy + cy) * (REACTION_S / 2)
    z = here.z + (uz + cz) * (REACTION_S / 2)
    stop_s = stopping_s(cx, cy, cz, limits)
    return (x, y, z), (x + cx * stop_s, y + cy * stop_s, z + cz * stop_s)
