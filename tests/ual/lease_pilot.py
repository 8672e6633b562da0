"""A program that fights for a UAV, for `test_lease_fights`: acquires its lease, flies, and gives it back, for ever."""

from __future__ import annotations

import random
import sys
import time

import ual
from ual import Twist, Vector3


def fly(uav: ual.Uav, yaw_rate_rad_s: float, duration_s: float) -> None:
    """Flies back and forth, turning at a rate of its own, by which it is known."""
    end_s = time.monotonic() + duration_s
    while time.monotonic() < end_s:
        uav.set_velocity(Twist(Vector3(random.choice((-1.0, 1.0)), 0.0, 0.0), Vector3(0.0, 0.0, yaw_rate_rad_s)))
        time.sleep(0.01)  # at a pilot's rate


def main(address: str, yaw_rate_rad_s: float, name: str) -> None:
    """Fights until it is killed."""
    with ual.Uav(address=address) as uav:
        while True:
            try:
                with uav.lease(name, take=random.random() < 0.5):
                    print("held", flush=True)
                    fly(uav, yaw_rate_rad_s, random.uniform(0.0, 0.1))
            except ual.UalError as error:
                if not isinstance(error, (ual.LeaseHeldError, ual.LeaseLostError)):
                    print(f"{error.reason}: {error}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), sys.argv[3])
