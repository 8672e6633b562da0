"""Output that is closed, on a full disk, or read by a program that has left: what was flown stays done."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S, DaemonProcess
from tests.forkserver import run_ual

UAL = "from ual_tools.main import main; main()"


def run(how: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs `ual` with a standard output that is `how`: closed, or a disk that is full."""
    if how == "closed":
        return run_ual(words, os.environ, stdout=-1)
    with Path("/dev/full").open("w") as full:
        return run_ual(words, os.environ, stdout=full.fileno())


def started(how: str, *words: str, program: str = UAL) -> subprocess.CompletedProcess[str]:
    """Runs a command whose standard output is `how` before Python itself starts."""
    shell = {"closed": '"$@" >&-', "full": '"$@" >/dev/full'}[how]
    command = ["bash", "-c", shell, "bash", sys.executable, "-c", program, *words]
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
def test_what_was_written_is_there_although_its_name_is_lost(daemon: DaemonProcess, tmp_path: Path) -> None:
    del daemon
    for words in (
        ("waypoints", "save", str(tmp_path / "here.jsonl")),
        ("record", "--duration", "0.1", "--directory", str(tmp_path)),
        (
            "token",
            "new",
            "--name",
            "ann",
            "--role",
            "pilot",
            "--file",
            str(tmp_path / "all"),
            "--output",
            str(tmp_path / "token"),
        ),
    ):
        lost = run("full", *words)
        assert lost.returncode == 0
        assert "done, but the result cannot be printed: No space left on device" in lost.stderr
    (recording,) = tmp_path.glob("*.mcap")
    exported = run("full", "record", "export", str(recording), "--csv")
    assert (exported.returncode, "cannot write" in exported.stderr) == (0, False)
    assert {path.suffix for path in tmp_path.iterdir()} == {".mcap", ".csv", ".jsonl", ""}


@needs_full_device
@pytest.mark.parametrize(
    "words", [("state",), ("--json", "state"), ("list",), ("frames",), ("watch", "--once"), ("--help",), ("--version",)]
)
def test_what_was_commanded_for_and_is_lost_fails_in_one_message(daemon: DaemonProcess, words: tuple[str, ...]) -> None:
    del daemon
    lost = run("full", *words)
    assert lost.returncode == 1
    assert lost.stderr.splitlines() == ["ual: the result cannot be printed: No space left on device"]


@pytest.mark.parametrize("words", [("state",), ("list",), ("frames",), ("--help",)])
def test_without_an_output_a_command_works(daemon: DaemonProcess, words: tuple[str, ...]) -> None:
    del daemon
    done = run("closed", *words)
    # A busy computer is behind, and `ual state` says so.
    told = [line for line in done.stderr.splitlines() if "simulated time is" not in line]
    assert (done.returncode, told) == (0, [])


def test_python_starts_without_an_output() -> None:
    for words in (("--help",), ("--version",)):
        done = started("closed", *words)
        assert (done.returncode, done.stderr) == (0, "")
    assert started("full", "--help").stderr.splitlines() == [
        "ual: the result cannot be printed: No space left on device"
    ]


@needs_full_device
@pytest.mark.parametrize("flag", ["--help", "--version", "--print-config"])
def test_what_the_daemon_prints_and_is_lost_fails_in_one_message(flag: str) -> None:
    lost = started("full", flag, program="from ual_daemon.program.entry import main; main()")
    assert lost.returncode == 1
    assert lost.stderr.splitlines() == ["ual-daemon: the output cannot be printed: No space left on device"]


@pytest.mark.parametrize("program", [UAL, "from ual_daemon.program.entry import main; main()"])
def test_a_reader_may_leave_before_the_end(program: str) -> None:
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-c", program, "--help"]
    left = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, timeout=LIMIT_S, check=False)
    os.close(write)
    assert (left.returncode, left.stderr) == (0, b"")


def test_several_go_on_where_the_output_of_one_is_lost(daemon: DaemonProcess) -> None:
    daemon.wait_for("state", new="LANDED_ARMED")
    lost = run("closed", "--all", "takeoff", "2")
    assert (lost.returncode, lost.stderr) == (0, "")


def test_a_sign_that_the_output_has_not_got_is_written_differently(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "cp437")  # as a pipe of Windows
    command = [sys.executable, "-c", UAL, "view", "--help"]
    done = subprocess.run(command, capture_output=True, timeout=LIMIT_S, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"\\xd7" in done.stdout
