"""The node flies light UAVs in Jazzy and in Kilted: the tests of `clients/ros2/ual_ros2`, run by each one's Python.

`make test-ros2` runs these.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.clients.ros2.environments import NAMES, ROOT, alone, environment

FLIGHTS = ROOT / "clients" / "ros2" / "ual_ros2" / "test"
FILES = sorted(path.name for path in FLIGHTS.glob("test_*.py"))
LIMIT_S = 900.0
NONE_RAN = int(pytest.ExitCode.NO_TESTS_COLLECTED)
_OF_A_DEPENDENCY = "ignore:module 'sre_:DeprecationWarning"

pytestmark = pytest.mark.slow


@pytest.mark.timeout(LIMIT_S + 600.0)  # the first one installs and builds
@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("name", NAMES)
def test_it_flies(name: str, file: str) -> None:
    found = environment(name)
    if isinstance(found, str):
        pytest.skip(found)
    settings = ("-p", "no:cacheprovider", "-c", "/dev/null", "--rootdir", str(FLIGHTS), "-W", _OF_A_DEPENDENCY)
    done = subprocess.run(
        [*alone(), str(found.python), "-m", "pytest", *settings, "--timeout", "300", "-q", "-rs", str(FLIGHTS / file)],
        env={**os.environ, **found.variables, "DAEMON_PYTHON": sys.executable},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    if done.returncode == NONE_RAN and "SKIPPED" in done.stdout:
        pytest.skip(done.stdout)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
