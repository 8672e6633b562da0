"""``ual-daemon`` whose light UAV notes when each setpoint reaches it. The first argument is the file for that.

SIGUSR1 writes what was noted since the last time: pairs of a setpoint's number and its time (monotonic clock, ns).
"""

from __future__ import annotations

import json
import runpy
import signal
import sys
import time
from pathlib import Path

from benchmarks.marks import number_of_yaw_rate
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import Setpoint, VelocitySetpoint


def main() -> None:
    path = Path(sys.argv[1])
    came: dict[int, int] = {}
    send = LightBackend.send

    def noted(self: LightBackend, setpoint: Setpoint) -> None:
        send(self, setpoint)
        if isinstance(setpoint, VelocitySetpoint):
            came.setdefault(number_of_yaw_rate(setpoint.yaw_rate_rad_s), time.monotonic_ns())

    def write(*_: object) -> None:
        unfinished = Path(f"{path}.part")
        unfinished.write_text(json.dumps(list(came.items())))
        came.clear()
        unfinished.replace(path)

    LightBackend.send = noted  # type: ignore[method-assign]
    signal.signal(signal.SIGUSR1, write)
    sys.argv = ["ual_daemon", *sys.argv[2:]]
    runpy.run_module("ual_daemon", run_name="__main__", alter_sys=True)


main()
