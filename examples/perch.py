"""Perches on a pipe: velocities that react to where the pipe is now, and a rule that breaks off.

``python -m examples.perch uav_1 --pipe 4 0 1 --arm --plot perch.svg``

The pipe is a frame, y along it; ``--pipe X Y Z`` says where it is in map. A program that observes the pipe (by a
camera, by motion capture) moves the frame by `add_frame`. The UAV comes down within a cone above it. Near the pipe, a
step aside breaks off: it climbs, and tries again. A real UAV rests on the pipe; this one hovers where it would.
"""

from __future__ import annotations

import asyncio
import math

import ual
from examples.together import land_if_flying, next_in_flight, parser
from examples.tracks import Tracks

ABOVE_M = 1.5
"""Metres above the pipe at which an approach begins."""
FOOT_M = 0.2
"""From the pipe to the body that sits on it."""
NEAR_M, ASIDE_M = 0.5, 0.25
"""The rule: below `NEAR_M` over the pipe, `ASIDE_M` aside breaks off."""
SITS_M = 0.05
HOLD_S = 2.0
TRIES = 4
_GAIN, _SIDEWAYS_M_S, _DOWN_M_S = 0.8, 0.5, 0.3


def velocity(here: ual.Vector3) -> ual.Vector3:
    """Returns the velocity that leads onto the pipe, from a place in its frame."""
    aside_m, above_m = here.horizontal_norm(), here.z - FOOT_M
    sideways = ual.Vector3(here.x, here.y) * -min(_GAIN, _SIDEWAYS_M_S / max(aside_m, 1e-9))
    is_in_cone = aside_m < 0.08 + 0.2 * max(0.0, above_m)
    return sideways + ual.Vector3(z=max(-_DOWN_M_S, -0.5 * above_m) if is_in_cone else 0.0)


def is_to_break_off(here: ual.Vector3) -> bool:
    """Returns whether it is beside the pipe, and so near that it could hit it."""
    return here.z - FOOT_M < NEAR_M and here.horizontal_norm() > ASIDE_M


async def approach(uav: ual.aio.Uav) -> bool:
    """Sits down, and stays for a while. Returns whether it did; if not, it has broken off."""
    ns = (await uav.info()).namespace
    sitting_s: float | None = None
    async with uav.subscribe(rate_hz=20.0) as samples:
        while True:
            sample = await next_in_flight(ns, samples)
            here = (await uav.transform("pipe", f"{ns}/base_link")).translation
            if is_to_break_off(here):
                print(f"broken off: {here.horizontal_norm():.2f} m aside", flush=True)
                return False
            is_sitting = math.hypot(here.horizontal_norm(), here.z - FOOT_M) < SITS_M
            sitting_s = (sample.stamp_s if sitting_s is None else sitting_s) if is_sitting else None
            if sitting_s is not None and sample.stamp_s - sitting_s > HOLD_S:
                return True
            await uav.set_velocity(ual.TwistStamped(ual.Twist(velocity(here)), "pipe"))


async def climb(uav: ual.aio.Uav) -> None:
    """Climbs straight up, away from the pipe, then goes to where an approach begins."""
    ns = (await uav.info()).namespace
    here = (await uav.transform("pipe", f"{ns}/base_link")).translation
    for x, y in ((here.x, here.y), (0.0, 0.0)):
        await uav.go_to_waypoint(ual.PoseStamped(ual.Pose.at(x, y, ABOVE_M), "pipe"))


async def perch(name: str, pipe: ual.Vector3, *, is_arming: bool, tracks: Tracks) -> bool:
    """Returns whether it sat on the pipe."""
    async with ual.aio.Uav(name) as uav:
        await uav.add_frame(ual.Transform(pipe, frame_id="map", child_frame_id="pipe"))
        try:
            if is_arming:
                await uav.arm()
            await uav.take_off(pipe.z + ABOVE_M)
            async with tracks.kept({name: uav}):
                for _ in range(TRIES):
                    await climb(uav)
                    if await approach(uav):
                        print("perched", flush=True)
                        return True
                return False
        finally:
            await leave(name, uav)


async def leave(name: str, uav: ual.aio.Uav) -> None:
    """Whatever came before: away from the pipe, and down beside it."""
    if await uav.state() is ual.State.FLYING_AUTO:
        await climb(uav)
        await uav.go_to_waypoint(ual.PoseStamped(ual.Pose.at(-1.5, 0.0, ABOVE_M), "pipe"))
    await land_if_flying(name, uav)


def main() -> None:
    options = parser(__doc__, names_count=None)
    options.add_argument("--pipe", nargs=3, type=float, default=(4.0, 0.0, 1.0), metavar=("X", "Y", "Z"))
    arguments = options.parse_args()
    pipe, tracks = ual.Vector3(*arguments.pipe), Tracks()
    has_perched = asyncio.run(perch(arguments.name, pipe, is_arming=arguments.arm, tracks=tracks))
    if arguments.plot is not None:
        tracks.draw(arguments.plot, "Perching on a pipe", {"pipe": [(pipe.x, pipe.y)]})
    print("landed beside the pipe" if has_perched else "did not perch; landed beside the pipe")


if __name__ == "__main__":
    main()
