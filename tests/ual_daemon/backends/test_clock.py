"""The clocks by which the age of data, of a lease and of a standstill are judged go on while the computer sleeps."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

SLEPT_S = 3600.0
_IN_SLEPT = ("unshare", "--user", "--map-root-user", "--time", "--boottime", f"{SLEPT_S:g}", "--fork")
"""Runs a program as on a computer that has slept for so long since it was started."""
_CODE = """
import time
from ual_daemon.backends.clock import MonotonicClock
from ual_daemon.flight.policy.lease import FlightLease
from ual_daemon.server.standstill import Standstill

for clock in (MonotonicClock().now_s, FlightLease()._clock, Standstill()._clock):
    print(clock() - time.clock_gettime(time.CLOCK_MONOTONIC))
"""


def _can_sleep() -> bool:
    """Returns whether this computer lets a test pretend that it has slept: Linux does, but for some containers."""
    has_unshare = shutil.which("unshare") is not None
    return has_unshare and subprocess.run([*_IN_SLEPT, "true"], capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not _can_sleep(), reason="needs a time namespace of its own")
def test_the_time_in_which_the_computer_sleeps_passes() -> None:
    """Else data from before count as new after it: setpoints would take the UAV from its failsafe, or its pilot."""
    done = subprocess.run([*_IN_SLEPT, sys.executable, "-c", _CODE], capture_output=True, text=True, check=True)
    assert [float(line) for line in done.stdout.split()] == pytest.approx([SLEPT_S] * 3, abs=1.0)
