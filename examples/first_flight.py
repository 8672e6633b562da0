"""Flies a simulated UAV in one process, without a daemon: `python examples/first_flight.py`."""

import argparse

from ual import Pose
from ual_daemon import UAL


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    # "light" is a simulation, here five times as fast as real time; "mavlink" flies PX4 and ArduPilot.
    with UAL(backend="light", ns="uav_1", backend_settings={"speed_factor": 5.0}) as uav:
        uav.arm()  # a real UAV is armed by its safety pilot
        uav.take_off(3.0)
        print("up at", uav.pose().pose.position)
        # 4 m east and 2 m north of its starting point, 3 m up, facing north. The call returns when the UAV has arrived.
        uav.go_to_waypoint(Pose.at(4.0, 2.0, 3.0, yaw_rad=1.57))
        print("there", uav.pose().pose.position)
        uav.land()
        print(uav.state().name)


if __name__ == "__main__":
    main()
