"""Surveys a field: lanes over a polygon, a picture every few metres, and files from which programs make a map.

``python -m examples.map_field uav_1 --arm --directory survey``

The UAV flies to and fro over the polygon, which is in its own frame, and its first camera takes a picture by the
distance flown. Then each picture is written as JPEG with its place, time and direction: WebODM and OpenDroneMap read
these. It needs Pillow (``pip install 'ual-client[geotag]'``).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import ual
from examples.together import parser
from ual.cameras import Photo
from ual.geotag import to_jpeg
from ual.interface import Uav

FIELD = ((0.0, 0.0), (24.0, -2.0), (30.0, 14.0), (4.0, 16.0))
"""Its corners, x and y in metres."""
HEIGHT_M = 10.0
LANE_M, DISTANCE_M = 4.0, 3.0
"""Between two lanes, and between two pictures. At this height a picture shows 14 x 10 m."""


def lanes(field: Sequence[tuple[float, float]], lane_m: float) -> list[tuple[float, float]]:
    """Returns the ends of lanes along x over a polygon, to and fro, half a lane from its lowest corner on."""
    edges = [*pairwise(field), (field[-1], field[0])]
    y, top = min(y for _, y in field) + lane_m / 2.0, max(y for _, y in field)
    ends: list[tuple[float, float]] = []
    is_back = False
    while y < top:
        crossed = [ax + (bx - ax) * (y - ay) / (by - ay) for (ax, ay), (bx, by) in edges if (ay <= y) != (by <= y)]
        ends += [(x, y) for x in sorted(crossed, reverse=is_back)]
        y, is_back = y + lane_m, not is_back
    return ends


def survey(uav: Uav, ends: Sequence[tuple[float, float]], height_m: float, distance_m: float) -> list[Photo]:
    """Flies the lanes with a UAV in the air. Returns the pictures that were taken."""
    camera = uav.cameras[0]
    before = camera.status()
    way = [ual.Pose.at(x, y, height_m) for x, y in ends]
    uav.go_to_waypoint(way[0])
    camera.start_photos(distance_m=distance_m)
    try:
        uav.follow_path(way)
    finally:
        camera.stop_photos()
    missed = camera.status().missed_count - before.missed_count
    if missed:
        print(f"{missed} pictures are missing")
    return camera.photos(before.photos_count)


def write(uav: Uav, photos: Sequence[Photo], directory: Path) -> None:
    """Writes the pictures. `ual camera fetch` does the same."""
    directory.mkdir(parents=True, exist_ok=True)
    name = uav.cameras.get_all()[0].name
    for photo in photos:
        image = uav.cameras[0].image(photo.number)
        (directory / f"{photo.number:05d}.jpg").write_bytes(to_jpeg(image, name))


def main() -> None:
    options = parser(__doc__, names_count=None)
    options.add_argument("--directory", type=Path, default=Path("survey"), help="for the pictures")
    options.add_argument("--height-m", type=float, default=HEIGHT_M)
    options.add_argument("--lane-m", type=float, default=LANE_M, help="between two lanes")
    options.add_argument("--distance-m", type=float, default=DISTANCE_M, help="between two pictures")
    given = options.parse_args()
    with ual.Uav(given.name) as uav:
        if given.arm:
            uav.arm()
        uav.take_off(given.height_m)
        try:
            photos = survey(uav, lanes(FIELD, given.lane_m), given.height_m, given.distance_m)
        finally:
            if uav.state() is ual.State.FLYING_AUTO:
                uav.return_to_launch()
        write(uav, photos, given.directory)
        print(f"{len(photos)} pictures in {given.directory}")


if __name__ == "__main__":
    main()
