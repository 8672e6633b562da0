"""Daemons that are forked off are as those that are started."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

import ual
from tests import forkserver
from tests.conftest import DaemonProcess, StartDaemon, daemon_environment
from ual import discovery


def command_of(daemon: DaemonProcess) -> bytes:
    return Path(f"/proc/{daemon.pid}/cmdline").read_bytes()


def test_a_daemon_is_forked_and_started_where_a_test_asks_for_that(
    start_daemon: StartDaemon, request: pytest.FixtureRequest
) -> None:
    forked = start_daemon()
    forked.wait_for("listening")
    assert b"tests.forkserver" in command_of(forked)
    request.getfixturevalue("started_daemons")
    started = start_daemon(ns="uav_2")
    started.wait_for("listening")
    assert b"ual_daemon" in command_of(started)


def test_it_has_its_flags_environment_and_directory(
    start_daemon: StartDaemon, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("uav.yaml").write_text("log_level: debug\n")
    daemon = start_daemon("--config", "uav.yaml", ns="uav_7")
    with ual.Uav(address=daemon.address) as uav:
        assert uav.info().namespace == "uav_7"
    assert discovery.find("uav_7") == daemon.address  # in this test's directory


def test_it_is_a_child_with_a_status(start_daemon: StartDaemon) -> None:
    first, second, third = (start_daemon(ns=f"uav_{number}") for number in (1, 2, 3))
    for daemon in (first, second):
        daemon.wait_for("state", new="LANDED_DISARMED")
        assert daemon.process.poll() is None
    first.signal(signal.SIGTERM)
    second.signal(signal.SIGKILL)
    assert (first.wait(), second.wait()) == (0, -signal.SIGKILL)
    first.signal(signal.SIGTERM)  # in vain
    with third.frozen():
        pass
    refused = start_daemon("--no-such-flag")
    assert refused.wait() == 2
    assert refused.stderr.startswith("Usage: python -m ual_daemon")


def test_one_of_another_python_is_started(tmp_path: Path) -> None:
    environment = daemon_environment(tmp_path)
    assert forkserver.can_fork(environment)
    assert not forkserver.can_fork({**environment, "PYTHONPATH": "/elsewhere"})
    assert forkserver.can_fork({**environment, "HOME": "/elsewhere"})
    assert forkserver.can_fork({**environment, "GRPC_VERBOSITY": "NONE"})  # as `ual` leaves it, run in this process
    assert not forkserver.can_fork({**environment, "GRPC_VERBOSITY": "DEBUG"})
    assert os.environ.get("PYTHONPATH") != "/elsewhere"
