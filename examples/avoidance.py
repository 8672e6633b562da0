"""UAVs that change places with those opposite, and avoid each other by their velocities.

``python -m examples.avoidance uav_1 uav_2 uav_3 uav_4 --arm --plot avoidance.svg``

Each takes, of some velocities around the wanted one, that which costs least: what is far from the wanted one costs, and
what would soon collide costs. It expects that the other one avoids as much as itself does. The method: van den Berg,
Lin, Manocha, "Reciprocal velocity obstacles for real-time multi-agent navigation", ICRA 2008.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from dataclasses import dataclass

import ual
from examples.together import landing_team, next_in_flight, parser, team_of, together
from examples.tracks import Tracks

HEIGHT_M = 2.0
SPEED_M_S = 0.8
APART_M = 1.5
"""Distance that they try to keep, in metres. It has room for what a UAV flies on while it turns to a new velocity."""
NEAR_M = 0.2
OLD_S = 0.5
"""A UAV that has heard nothing of another one for so long stops."""
_WEIGHT_M = 2.0
_SPEEDS = tuple(SPEED_M_S * i / 4 for i in range(1, 5))
_TURNS = tuple(sign * math.radians(15.0 * i) for i in range(13) for sign in (-1.0, 1.0))  # to the right first


@dataclass(frozen=True)
class Mover:
    """A UAV as the others see it, in map, with z as it is."""

    position: ual.Vector3
    velocity: ual.Vector3
    seen_s: float = 0.0


def collision_s(offset: ual.Vector3, closing: ual.Vector3) -> float:
    """Returns when two are nearer than `APART_M` that fly on as they do; infinity: never."""
    c = offset.x**2 + offset.y**2 - APART_M**2
    b = offset.x * closing.x + offset.y * closing.y
    if c <= 0.0:  # too near already: only what leads apart is good
        return 0.01 if b > 0.0 else math.inf
    a = closing.x**2 + closing.y**2
    root = b * b - a * c
    return (b - math.sqrt(root)) / a if b > 0.0 and root > 0.0 else math.inf


def choose(me: Mover, wanted: ual.Vector3, others: list[Mover]) -> ual.Vector3:
    """Returns the velocity of least cost, in m/s."""
    direction = math.atan2(wanted.y, wanted.x)
    speeds = {*_SPEEDS, wanted.horizontal_norm()}
    candidates = [wanted, ual.Vector3()]
    for turn in _TURNS:
        heading = ual.Vector3(math.cos(direction + turn), math.sin(direction + turn))
        candidates += [heading * speed for speed in sorted(speeds, reverse=True)]

    def cost(velocity: ual.Vector3) -> float:
        # Both turn by half of what one alone would have to: the mean of the old and the new velocity is to be free.
        met_s = [
            collision_s(other.position - me.position, velocity * 2.0 - me.velocity - other.velocity) for other in others
        ]
        return (wanted - velocity).horizontal_norm() + _WEIGHT_M / min(met_s, default=math.inf)

    return min(candidates, key=cost)


def towards(goal: ual.Vector3, position: ual.Vector3) -> ual.Vector3:
    """Returns the velocity that one alone would fly with."""
    left = ual.Vector3(goal.x - position.x, goal.y - position.y)
    return left * (min(1.0, SPEED_M_S / max(left.norm(), 1e-9)))


async def fly(
    name: str, uav: ual.aio.Uav, goals: Mapping[str, ual.Vector3], seen: dict[str, Mover], there: set[str]
) -> None:
    """Flies one UAV until all are there."""
    to_map = await uav.transform("map", f"{(await uav.info()).namespace}/odom")
    clock = asyncio.get_running_loop().time
    async with uav.subscribe(rate_hz=20.0) as samples:
        while True:
            sample = await next_in_flight(name, samples)
            if sample.pose is None or sample.velocity is None:
                raise ual.WrongStateError(f"{name}: {sample.state.name}: {sample.state_reason}")
            position = to_map.apply(sample.pose.position)
            seen[name] = me = Mover(position, to_map.rotation.rotate(sample.velocity.linear), clock())
            # All at the same time: one that is there may yet have to make room for another one.
            is_there = (goals[name] - position).horizontal_norm() < NEAR_M
            (there.add if is_there else there.discard)(name)
            if len(there) == len(goals):
                return
            others = [mover for other, mover in seen.items() if other != name]
            is_blind = len(seen) < len(goals) or any(clock() - other.seen_s > OLD_S for other in others)
            velocity = ual.Vector3() if is_blind else choose(me, towards(goals[name], position), others)
            await uav.set_velocity(ual.TwistStamped(ual.Twist(velocity), "map"))


async def swap_positions(names: list[str], *, is_arming: bool, tracks: Tracks) -> None:
    async with landing_team(names, is_arming=is_arming) as team:
        await team.take_off(HEIGHT_M)
        places = {name: place.translation for name, place in (await team.transform()).items()}
        goals = dict(zip(names, [places[name] for name in reversed(names)], strict=True))
        seen: dict[str, Mover] = {}
        there: set[str] = set()
        async with tracks.kept(team_of(team)):
            await together(*(fly(name, team[name], goals, seen, there) for name in names))


def main() -> None:
    arguments = parser(__doc__).parse_args()
    tracks = Tracks()
    asyncio.run(swap_positions(arguments.names, is_arming=arguments.arm, tracks=tracks))
    if arguments.plot is not None:
        tracks.draw(arguments.plot, "Changing places, avoiding by velocity", {})
    print("all there, all landed")


if __name__ == "__main__":
    main()
