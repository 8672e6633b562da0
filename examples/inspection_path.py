"""Circles a tower with the nose towards it: `make run` in one terminal, `python examples/inspection_path.py` in
another.
"""

import argparse
import math

import ual
from ual.interface import Uav

TOWER = ual.Vector3(6.0, 0.0, 0.0)
RADIUS_M, HEIGHTS_M, STEPS = 3.0, (2.0, 4.0), 12


def rings() -> list[ual.PoseStamped]:
    """Returns rings around the tower, in its own frame. Each pose faces the tower."""
    poses = []
    for height_m in HEIGHTS_M:
        for i in range(STEPS + 1):
            angle = math.pi + i * math.tau / STEPS
            yaw_rad = ual.geometry.wrap_angle(angle + math.pi)
            pose = ual.Pose.at(RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), height_m, yaw_rad)
            poses.append(ual.PoseStamped(pose, "tower"))
    return poses


def show(sample: ual.Telemetry) -> None:
    """Prints a line about the running task. Runs on a thread of the subscription."""
    if sample.task is not None and sample.pose is not None and sample.task.distance_left_m is not None:
        x, y, z = sample.pose.position
        where = f"{x:6.2f} {y:6.2f} {z:6.2f}  heading {math.degrees(sample.pose.yaw_rad):4.0f} deg"
        print(f"waypoint {sample.task.waypoint_index or 0:2}  {where}  {sample.task.distance_left_m:5.1f} m left")


def inspect(uav: Uav) -> None:
    """Flies the inspection with a UAV in the air, which may be an `ual.Uav` or an `ual_daemon.UAL`."""
    uav.add_frame(ual.Transform(TOWER, frame_id=f"{uav.ns}/odom", child_frame_id="tower"))
    with uav.subscribe(show, rate_hz=2.0):
        uav.follow_path(rings(), corner_radius_m=0.5)


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    with ual.Uav() as uav:
        if uav.state() is not ual.State.FLYING_AUTO:
            uav.take_off(2.0)
        inspect(uav)
        uav.land()
        print("inspected")


if __name__ == "__main__":
    main()
