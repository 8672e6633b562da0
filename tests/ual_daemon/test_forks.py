"""A UAV of a process in the child that it forks: the child has no thread that watches the autopilot."""

from __future__ import annotations

import subprocess
import sys

from tests.conftest import LIMIT_S

PROGRAM = """
import os, sys
from ual import Pose, Twist, UalError
from ual_daemon import UAL
with UAL(backend="light", ns="uav_1") as uav:
    calls = uav.telemetry, uav.land, lambda: uav.set_velocity(Twist()), lambda: uav.go_to_waypoint(Pose.at(0, 0, 3))
    if not os.fork():
        for call in calls:
            try:
                call()
            except UalError as error:
                print(error, flush=True)
        uav.close()
        print(repr(uav), flush=True)
        os._exit(0)
    if os.wait()[1]:
        sys.exit("the child failed")
    print(uav.telemetry().state.name)
"""


def test_the_child_of_a_process_that_flies_a_uav_sends_nothing_and_says_so() -> None:
    ran = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert ran.returncode == 0, ran.stderr
    *refusals, closed, state = ran.stdout.splitlines()
    assert len(refusals) == 4
    for refusal in refusals:
        assert refusal.startswith("the process from which this one was forked flies uav_1: ")
    assert (closed, state) == ("<ual_daemon.UAL uav_1, closed>", "LANDED_DISARMED")
