"""Circles a tower and looks at it all the way: `make run` in one terminal, `python examples/inspection_path.py` in
another.
"""

import math

import ual
from ual.interface import Uav

TOWER = ual.Vector3(6.0, 0.0, 0.0)
RADIUS_M, HEIGHTS_M, PLACES = 3.0, (2.0, 4.0), 12


def rings() -> list[ual.PoseStamped]:
    """Rings about the tower, in its own frame, each pose facing it."""
    poses = []
    for height_m in HEIGHTS_M:
        for i in range(PLACES + 1):
            angle = math.pi + i * math.tau / PLACES
            pose = ual.Pose.at(
                RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), height_m, yaw_rad=angle + math.pi
            )
            poses.append(ual.PoseStamped(pose, "tower"))
    return poses


def show(sample: ual.Telemetry) -> None:
    """One line of a running task, on the subscription's own thread."""
    if sample.task is not None and sample.pose is not None and sample.task.distance_left_m is not None:
        x, y, z = sample.pose.position
        where = f"{x:6.2f} {y:6.2f} {z:6.2f}  heading {math.degrees(sample.pose.yaw_rad):4.0f} deg"
        print(f"waypoint {sample.task.waypoint_index or 0:2}  {where}  {sample.task.distance_left_m:5.1f} m left")


def inspect(uav: Uav) -> None:
    """Flies the inspection with a UAV in the air; `ual.Uav` and `ual_daemon.UAL` are both one."""
    uav.add_frame(ual.Transform(TOWER, frame_id=f"{uav.ns}/odom", child_frame_id="tower"))
    with uav.subscribe(show, rate_hz=2.0):
        uav.follow_path(rings(), corner_radius_m=0.5)


def main() -> None:
    with ual.Uav() as uav:
        if uav.state() is not ual.State.FLYING_AUTO:
            uav.take_off(2.0)
        inspect(uav)
        uav.land()
        print("inspected")


if __name__ == "__main__":
    main()
