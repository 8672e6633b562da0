"""Output that is closed, on a full disk, or read by a program that has left: what was flown stays done."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S, DaemonProcess

UAL = "from ual_tools.main import main; main()"


def run(how: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs a command whose standard output is `how` before Python itself starts."""
    shell = {"closed": '"$@" >&-', "full": '"$@" >/dev/full'}[how]
    command = ["bash", "-c", shell, "bash", sys.executable, "-c", UAL, *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)


needs_full_device = pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")


@needs_full_device
def test_a_flight_that_succeeded_is_done_although_its_result_is_lost(daemon: DaemonProcess) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    lost = run("full", "takeoff", "2")
    assert (lost.returncode, "Traceback" in lost.stderr) == (0, False)
    assert "done, but the result cannot be printed: No space left on device" in lost.stderr
    assert run("closed", "land").returncode == 0


@needs_full_device
@pytest.mark.parametrize("words", [("state",), ("--json", "state"), ("list",), ("frames",), ("watch", "--once")])
def test_what_was_asked_for_and_is_lost_fails_in_one_line(daemon: DaemonProcess, words: tuple[str, ...]) -> None:
    del daemon
    lost = run("full", *words)
    assert lost.returncode == 1
    assert lost.stderr.splitlines() == ["ual: the result cannot be printed: No space left on device"]


@pytest.mark.parametrize("words", [("state",), ("list",), ("frames",), ("--help",)])
def test_without_an_output_a_command_works(daemon: DaemonProcess, words: tuple[str, ...]) -> None:
    del daemon
    assert run("closed", *words).stderr == ""
    assert run("closed", *words).returncode == 0


def test_several_go_on_where_the_output_of_one_is_lost(daemon: DaemonProcess) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    lost = run("closed", "--all", "takeoff", "2")
    assert (lost.returncode, lost.stderr) == (0, "")
