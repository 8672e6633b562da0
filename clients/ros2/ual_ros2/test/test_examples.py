"""The examples fly as they stand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from conftest import ARMED_FAST, Processes
from flying import LIMIT_S

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_two_uavs_fly_a_square(processes: Processes) -> None:
    for ns in ("uav_1", "uav_2"):
        processes.daemon(*ARMED_FAST, ns=ns)
    processes.node()
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "two_uavs.py")], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        *(f"both are at {place}" for place in ("2, 0", "2, 2", "0, 2", "0, 0")),
        "landed",
    ]
