"""Flies a square with several UAVs at once, in the formation in which they stand.

``python examples/formation.py uav_1 uav_2 uav_3``; ``--arm`` arms those that are not, where their daemons may.
"""

import argparse

import ual

HEIGHT_M = 1.0
CORNERS = ((1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0))


async def arm_if_disarmed(_name: str, uav: ual.aio.Uav) -> None:
    if await uav.state() is ual.State.LANDED_DISARMED:
        await uav.arm()


async def land_if_flying(_name: str, uav: ual.aio.Uav) -> None:
    if await uav.state() is ual.State.FLYING_AUTO:
        await uav.land()


def fly(team: ual.Team) -> None:
    """Flies the square with UAVs that are armed. Whatever fails, all in the air that can be reached land."""
    try:
        team.take_off(HEIGHT_M)
        for x, y in CORNERS:  # of each UAV's own odom, whose origin is where it stood
            team.go_to_waypoint(ual.Pose.at(x, y, HEIGHT_M))
            print(f"all at {x:g}, {y:g}")
    finally:
        team.ask(land_if_flying)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="+", metavar="NAME")
    parser.add_argument("--arm", action="store_true")
    arguments = parser.parse_args()
    with ual.Team(arguments.names) as team:
        if arguments.arm:
            team.each(arm_if_disarmed)
        fly(team)
    print("all landed")


if __name__ == "__main__":
    main()
