"""Inspects a bridge by contact: approaches each point slowly, holds contact with it, retreats, and tries again.

``python -m examples.contact uav_1 --face 6 0 0 0 --arm --plot contact.svg``

The face of the bridge is a frame: x leads into it. ``--face X Y Z YAW`` says where it is in map (YAW in degrees).
Contact is made by a tip ahead of the nose. With ``--pictures`` the first camera takes a picture of each point while the
contact is held. What feels it is yours: a switch, a force sensor. Here it is a wall that exists only as a number, so
nothing stops the UAV when it goes on; replace `Wall` by your sensor.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import ual
from examples.together import land_if_flying, next_in_flight, parser
from examples.tracks import Tracks

TIP_M = 0.4
STANDOFF_M = 1.0
APPROACH_M_S, RETREAT_M_S = 0.15, 0.4
REACH_M = 0.15
"""Metres behind the face at which an approach gives up: the bridge is not at its known position."""
HOLD_S = 2.0
TRIES = 3
POINTS = ((-1.0, 2.0), (0.0, 2.5), (1.0, 2.0))
"""Along y and z of the face."""


class Touch(Protocol):
    """Sensor of contact."""

    def is_touching(self, tip: ual.Vector3) -> bool:
        """Returns whether the tip touches now. `tip` is where it is, in the face's frame; a sensor need not know it."""


@dataclass
class Wall:
    """A wall of numbers. The first approaches feel nothing, as with a sensor that fails."""

    deaf_approaches: int = 0

    def is_touching(self, tip: ual.Vector3) -> bool:
        if not self.deaf_approaches:
            return tip.x >= 0.0
        if tip.x > REACH_M:  # there the approach gives up
            self.deaf_approaches -= 1
        return False


class Inspector:
    """One UAV in front of the face."""

    def __init__(self, uav: ual.aio.Uav, touch: Touch, *, has_camera: bool = False) -> None:
        self._uav = uav
        self._touch = touch
        self._has_camera = has_camera

    async def inspect(self, points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        """Returns the points that were held in contact."""
        return [point for point in points if await self._inspect(*point)]

    async def _inspect(self, y: float, z: float) -> bool:
        off = ual.PoseStamped(ual.Pose.at(-STANDOFF_M - TIP_M, y, z, yaw_rad=0.0), "face")
        await self._uav.go_to_waypoint(off)
        for attempt in range(1, TRIES + 1):
            try:
                outcome = await self._push()
                if outcome == "held" and self._has_camera:  # it holds its position while the picture is taken
                    print(f"picture {(await self._uav.cameras[0].take_photo()).number}")
            finally:
                # Also after Ctrl-C or an error: first away from the bridge.
                await self._uav.go_to_waypoint(off, max_speed_m_s=RETREAT_M_S)
            print(f"point {y:g} {z:g}, try {attempt}: {outcome}", flush=True)
            if outcome == "held":
                return True
        return False

    async def _push(self) -> str:
        """Approaches until there is contact, and holds it. Returns what came of it."""
        ns = (await self._uav.info()).namespace
        to_face = await self._uav.transform("face", f"{ns}/odom")
        touched_s: float | None = None
        async with self._uav.subscribe(rate_hz=20.0) as samples:
            while True:
                sample = await next_in_flight(ns, samples)
                if sample.pose is None:
                    raise ual.WrongStateError(f"{sample.state.name}: {sample.state_reason}")
                body = to_face.apply_pose(sample.pose)
                tip = body.position + body.orientation.rotate(ual.Vector3(x=TIP_M))
                is_touching = self._touch.is_touching(tip)
                if touched_s is None and is_touching:
                    touched_s = sample.stamp_s
                if touched_s is not None and not is_touching:
                    return "contact lost"
                if touched_s is not None and sample.stamp_s - touched_s >= HOLD_S:
                    return "held"
                if touched_s is None and tip.x > REACH_M:
                    return "no contact"
                speed = 0.0 if is_touching else APPROACH_M_S
                await self._uav.set_velocity(ual.TwistStamped(ual.Twist(ual.Vector3(x=speed)), "face"))


async def fly(
    name: str, face: ual.Transform, touch: Touch, *, is_arming: bool, has_camera: bool, tracks: Tracks
) -> int:
    """Returns how many points were held in contact."""
    async with ual.aio.Uav(name) as uav:
        await uav.add_frame(face)
        try:
            if is_arming:
                await uav.arm()
            await uav.take_off(POINTS[0][1])
            async with tracks.kept({name: uav}):
                return len(await Inspector(uav, touch, has_camera=has_camera).inspect(POINTS))
        finally:
            await land_if_flying(name, uav)


def main() -> None:
    options = parser(__doc__, names_count=None)
    options.add_argument("--face", nargs=4, type=float, default=(6.0, 0.0, 0.0, 0.0), metavar=("X", "Y", "Z", "YAW"))
    options.add_argument("--deaf", type=int, default=0, help="how many approaches the simulated sensor does not feel")
    options.add_argument("--pictures", action="store_true", help="take a picture of each point")
    arguments = options.parse_args()
    x, y, z, yaw_deg = arguments.face
    face = ual.Transform(ual.Vector3(x, y, z), ual.Quaternion.from_yaw(math.radians(yaw_deg)), "map", "face")
    tracks = Tracks()
    how = {"is_arming": arguments.arm, "has_camera": arguments.pictures}
    count = asyncio.run(fly(arguments.name, face, Wall(arguments.deaf), tracks=tracks, **how))
    if arguments.plot is not None:
        places = [face.apply(ual.Vector3(0.0, *point)) for point in POINTS]
        tracks.draw(arguments.plot, "Inspection by contact", {"points": [(p.x, p.y) for p in places]})
    print(f"{count} of {len(POINTS)} points held, landed")


if __name__ == "__main__":
    main()
