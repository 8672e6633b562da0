"""Cost of the node: its share of a core and its memory, for light UAVs that publish and are flown at 50 Hz."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from benchmarks.children import LIMIT_S, ChildError, Process
from benchmarks.ros2.processes import Ros

_SETTLED_S = 3.0


class Share(NamedTuple):
    """Of some UAVs: per cent of a core, MiB, and what the program in ROS heard and sent in a second."""

    uavs_count: int
    percent: float
    memory_mib: float
    heard_per_s: float

    def row(self) -> str:
        """Returns it as a line."""
        return (
            f"{self.uavs_count} UAVs, each with velocities in and pose, velocity, odom and tf out at 50 Hz: "
            f"{self.percent:.0f} % of a core, {self.memory_mib:.0f} MiB; {self.heard_per_s:.0f} messages/s were heard"
        )


def measure(ros: Ros, count: int, seconds: float) -> Share:
    """Measures the node while its UAVs fly."""
    with tempfile.TemporaryDirectory(prefix="ual-ros2-") as directory, ExitStack() as stack:
        fleet = [sys.executable, "-m", "ual_daemon", "--backend", "light", "--ns", "uav_1", "--auto-arm"]
        listen = ["--fleet", str(count), "--listen", f"unix:{directory}/{{ns}}.sock"]
        stack.enter_context(
            Process([*fleet, *listen], environment={"UAL_RUNTIME_DIR": directory}, stderr=subprocess.DEVNULL)
        )
        _wait_for(Path(directory), count)
        node = stack.enter_context(ros.node("rate_hz:=50.0", runtime_dir=directory))
        crowd = stack.enter_context(ros.child("benchmarks.ros2.crowd", str(count)))
        crowd.ask("fly")
        time.sleep(_SETTLED_S)
        crowd.ask("heard")
        began_s, used_s = time.monotonic(), node.processor_s()
        time.sleep(seconds)
        heard = crowd.ask("heard")["count"]
        passed_s = time.monotonic() - began_s
        return Share(count, 100.0 * (node.processor_s() - used_s) / passed_s, node.resident_mib(), heard / passed_s)


def _wait_for(directory: Path, count: int) -> None:
    deadline_s = time.monotonic() + LIMIT_S
    while len(list(directory.glob("*.json"))) < count:
        if time.monotonic() > deadline_s:
            raise ChildError("the fleet does not start")
        time.sleep(0.1)
