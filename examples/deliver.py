"""Delivers a load by a winch and a gripper on a light UAV, in one process.

A load is gripped on the ground, flown to its place, let down by the winch, and released there. It is dropped only where
the line says that it is down, and the UAV leaves only once the gripper is known to be open.

    python examples/deliver.py
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import ual
from ual.gripper import Equipment, GripperState, WinchAction
from ual_daemon import UAL
from ual_daemon.settings import GripperSettings, PayloadSettings, VehicleSettings, WinchSettings

HEIGHT_M, LINE_M = 4.0, 3.5
PLACE = ual.Pose.at(5.0, 2.0, HEIGHT_M)
CARRIED = PayloadSettings(
    grippers=(GripperSettings(name="claw"),), winches=(WinchSettings(name="hook", longest_m=LINE_M),)
)
PATIENCE_S = 60.0


def wait(uav: ual.interface.Uav, what: str, is_so: Callable[[Equipment], bool]) -> None:
    """Waits until what the UAV carries is in a state.

    Raises:
        TimeoutError: It is not, or that is not known: look before anything is ordered again.

    """
    until_s = time.monotonic() + PATIENCE_S
    while not is_so(found := uav.gripper.get_all()):
        if time.monotonic() > until_s:
            raise TimeoutError(f"{what}: {found}")
        time.sleep(0.05)


def rope_m(found: Equipment) -> float | None:
    """Returns how much line is out; None where the winch does not say."""
    status = found.winches[0].status
    return None if status is None else status.length_m


def deliver(uav: ual.interface.Uav) -> None:
    """Delivers, and returns to where it began."""
    uav.gripper.grip()
    wait(uav, "the grip", lambda found: found.grippers[0].state is GripperState.CLOSED)
    uav.take_off(HEIGHT_M)
    uav.go_to_waypoint(PLACE)
    uav.gripper.order_winch(WinchAction.LENGTH, length_m=LINE_M)
    wait(uav, "letting down", lambda found: rope_m(found) == LINE_M)
    uav.gripper.release()
    wait(uav, "the release", lambda found: found.grippers[0].state is GripperState.OPEN)
    position = uav.transform().translation
    print(f"released at {position.x:.1f}, {position.y:.1f}, {LINE_M:g} m below the UAV")
    uav.gripper.order_winch(WinchAction.RETRACT)
    wait(uav, "taking in", lambda found: rope_m(found) == 0.0)
    uav.return_to_launch()


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    light = {"speed_factor": 20.0}
    with UAL(backend="light", settings=VehicleSettings(payload=CARRIED), backend_settings=light) as uav:
        uav.wait_for(ual.State.LANDED_DISARMED)
        uav.arm()
        deliver(uav)
    print("landed")


if __name__ == "__main__":
    main()
