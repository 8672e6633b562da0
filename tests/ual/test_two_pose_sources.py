"""Two programs that give poses of one UAV from outside are named by its daemon."""

from __future__ import annotations

import subprocess
import sys

import ual
from tests.conftest import StartDaemon
from tests.waiting import until

HERE = ual.PoseStamped(ual.Pose.at(0.0, 0.0, 0.0, 0.0))
OTHER = """
import sys, ual
here = ual.PoseStamped(ual.Pose.at(0.0, 0.0, 0.0, 0.0))
with ual.Uav(address=sys.argv[1]) as uav:
    while True:
        uav.set_external_pose(here)
        uav.telemetry()
"""
"""A program that gives a pose with each sample, until it is ended. Programs of one process share a connection."""


def test_health_names_two_programs_that_give_poses(start_daemon: StartDaemon) -> None:
    daemon = start_daemon()
    daemon.wait_for("listening")
    with (
        subprocess.Popen([sys.executable, "-c", OTHER, daemon.address]) as other,
        ual.Uav(address=daemon.address) as uav,
    ):

        def named() -> bool:
            uav.set_external_pose(HERE)
            return str(uav.telemetry().health).count("ipv4:127.0.0.1:") == 2

        try:
            until(named, "the names of both")
            health = uav.telemetry().health
        finally:
            other.kill()
    assert health is not None
    assert any(each.startswith("position: poses from outside come from ipv4:") for each in health.failing_checks)
