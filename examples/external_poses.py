"""Stands for a motion capture: gives the UAV its pose 50 times a second, and shows what the autopilot makes of it.

Against a light UAV without satellites: ``ual-daemon --backend light``, ``ual sim fault begin position-lost``, and then
``python examples/external_poses.py``. Replace `measure` by your system.
"""

import argparse
import time

import ual

RATE_HZ = 50.0
DURATION_S = 5.0


def measure() -> ual.PoseStamped:
    """Returns the UAV's pose in the frame of the measuring system: here always the same position, just now.

    Give `ual.PoseStamped` a `stamp_s` (UTC) where the system says when it measured, or takes long.
    """
    return ual.PoseStamped(ual.Pose.at(1.0, 2.0, 0.0, 0.0), "map")


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    with ual.Uav() as uav:
        for number in range(round(RATE_HZ * DURATION_S)):
            try:
                uav.set_external_pose(measure(), position_std_dev_m=0.005)
            except ual.InvalidArgumentError as error:  # not valid, or old: the next one may be better
                print(error)
            if number % RATE_HZ == 0:
                sample = uav.telemetry()
                print(sample.state.name, sample.state_reason, sample.pose and sample.pose.position)
            time.sleep(1.0 / RATE_HZ)


if __name__ == "__main__":
    main()
