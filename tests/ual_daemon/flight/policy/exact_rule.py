"""The rule for a commanded velocity, as it was first written: by whole trajectories and polygons, and slow.

`GeofencePolicy.require_velocity` must decide as it does.
"""

from __future__ import annotations

from typing import NamedTuple

from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.flight.policy.reachable_points import REACTION_S
from ual_daemon.frames.fence import Fence
from ual_daemon.trajectory import Brake, Motion, acceleration_limit

_GENTLE_M_S = 0.2
_SINKING_M_S = 0.02
_SAME_POINT_M = 1e-6


class Variants(NamedTuple):
    """The ways of a UAV that is commanded a velocity."""

    commanded: list[Vector3]
    own: list[Vector3]
    changed: list[Vector3]


def braking(velocity: Vector3, limits: Limits) -> Vector3:
    """Returns the displacement while a UAV brakes from a velocity."""
    return Brake(Motion(Vector3(), 0.0, velocity), limits).end().position


def change(motion: Motion, velocity: Vector3, limits: Limits) -> tuple[Vector3, Vector3]:
    """Returns where a UAV that changes to a velocity is after the reaction time, and where it stops from there."""
    change = velocity - motion.velocity
    size = change.norm()
    most_m_s = acceleration_limit(change / size, limits) * REACTION_S if size > 0.0 else 0.0
    changed = motion.velocity + change * (most_m_s / size) if size > most_m_s else velocity
    position = motion.position + (motion.velocity + changed) * (REACTION_S / 2)
    return position, position + braking(changed, limits)


def variants(motion: Motion, velocity: Vector3, limits: Limits) -> Variants:
    """Returns the ways of a UAV that is commanded a velocity."""
    here, speed = motion.position, velocity.norm()
    direction = velocity / speed
    fastest = direction * max(speed, motion.velocity.dot(direction))
    after_reaction = here + motion.velocity * REACTION_S
    return Variants(
        [here, here + fastest * REACTION_S + braking(fastest, limits)],
        [here, after_reaction, after_reaction + braking(motion.velocity, limits)],
        [here, *change(motion, velocity, limits)],
    )


def is_admitted(
    fence: Fence,
    band: tuple[float, float],
    motion: Motion,
    velocity: Vector3,
    limits: Limits,
    given_m: float = 0.0,
) -> bool:
    """Returns whether a velocity is admitted. `band` is z of the floor, with its clearance, and of the ceiling.

    A slow descent may lead `given_m` below.
    """
    if velocity.norm() == 0.0:
        return True
    found = variants(motion, velocity, limits)
    here, stop = found.commanded
    if fence.is_nowhere:
        return False
    if fence.leads_back(here, stop):
        return True
    lowest_m = band[0] if velocity.z < -_GENTLE_M_S else band[0] - given_m
    if (velocity.z < -_SINKING_M_S and stop.z < lowest_m) or (velocity.z > _GENTLE_M_S and stop.z > band[1]):
        return False
    if all(fence.exit(polyline) is None for polyline in found):
        return True
    soonest = [here, *change(motion, Vector3(), limits)]
    farther_m = fence.signed_distance_m(found.changed[-1]) - fence.signed_distance_m(soonest[-1])
    longer_m = fence.outside_m(found.changed) - fence.outside_m(soonest)
    return farther_m <= _SAME_POINT_M and longer_m <= _SAME_POINT_M
