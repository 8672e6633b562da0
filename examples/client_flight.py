"""Flies a UAV through its daemon: `make run` in one terminal, `python examples/client_flight.py` in another."""

import argparse
import sys
import threading
import time

import ual


def wait_until_armed(uav: ual.Uav) -> None:
    """Blocks until the safety pilot has armed the UAV."""
    armed = threading.Event()
    with uav.subscribe(lambda sample: armed.set() if sample.state is ual.State.LANDED_ARMED else None):
        if not armed.wait(60.0):
            sys.exit("nobody armed the UAV")


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    # The only UAV of this computer. With several: ual.Uav("uav_2") or ual.Uav(address="host:50052").
    with ual.Uav() as uav:
        print("flying", uav.ns)
        wait_until_armed(uav)

        for info in uav.take_off(3.0, blocking=False).watch(rate_hz=2.0):
            print(f"take-off: {info.status.name} {info.progress or 0.0:4.0%}")

        # Forward at 0.5 m/s for 2 s. Without a new velocity within 0.5 s the UAV stops and holds its position.
        ahead = ual.TwistStamped(ual.Twist(ual.Vector3(x=0.5)), f"{uav.ns}/base_link")
        for _ in range(40):
            uav.set_velocity(ahead)
            time.sleep(0.05)

        try:
            uav.recover_from_manual()
        except ual.WrongStateError as error:
            print("refused, as it should be:", error)

        uav.go_to_waypoint(ual.Pose.at(0.0, 0.0, 3.0))
        uav.land()
        print("landed")


if __name__ == "__main__":
    main()
