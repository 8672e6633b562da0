"""The daemon does not load modules that it does not need: they cost memory and start-up time."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from contextlib import closing
from pathlib import Path

from tests.conftest import DaemonProcess
from ual import Uav, discovery
from ual.types import State

NEVER = {
    "email",
    "importlib.metadata",
    "numpy",
    "secrets",
    "shapely",
    "tempfile",
    "unittest",
    "zipfile",
}


IMPORTED_AFTER_A_FORK = {
    "ual_daemon.program.access_files",
    "ual_daemon.program.metrics",
    "ual_daemon.program.metrics.opening",
    "ual_daemon.server.access.watched_file",
    "ual_daemon.server.tls",
}
"""Modules that each daemon of a test imports anew: they are small."""


def imported_before_a_fork() -> set[str]:
    """The modules that the process has imported off which tests fork daemons."""
    program = "import sys; from tests import forkserver; forkserver._import_all(); print(*sys.modules)"
    return set(
        subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, text=True).stdout.split()
    )


def loaded(daemon: DaemonProcess) -> set[str]:
    """The modules that it has loaded."""
    return set(re.findall(r"^import time:.*\| +(\S+)$", daemon.stderr, re.MULTILINE))


def start(runtime_dir: Path, *flags: str) -> DaemonProcess:
    variables = {discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir), "PYTHONPROFILEIMPORTTIME": "1"}
    environment = {name: value for name, value in os.environ.items() if not name.startswith("UAL_")}
    return DaemonProcess(("--listen", "127.0.0.1:0", *flags), "uav_1", environment | variables)


def test_a_light_uav_flies_without_what_it_does_not_need(runtime_dir: Path) -> None:
    with closing(start(runtime_dir, "--auto-arm", "--set", "light.speed_factor=10")) as daemon:
        with Uav(address=daemon.address) as uav:
            daemon.wait_for("state", new="LANDED_ARMED")
            uav.take_off(2.0)
            assert uav.state() is State.FLYING_AUTO
        found = loaded(daemon)
    assert {"grpc.aio", "ual_daemon.flight.manoeuvres.manoeuvre"} <= found
    assert not found & (NEVER | {"ual_daemon.backends.mavlink.wire.dialect"})
    late = {each for each in found - imported_before_a_fork() if each.startswith("ual_daemon.")}
    assert late <= IMPORTED_AFTER_A_FORK


def test_a_mavlink_uav_waits_without_what_it_does_not_need(runtime_dir: Path) -> None:
    with closing(start(runtime_dir, "--backend", "mavlink", "--url", "udpout://127.0.0.1:9")) as daemon:
        with Uav(address=daemon.address) as uav:
            assert uav.state() is State.UNINITIALIZED
        found = loaded(daemon)
    assert {"ual_daemon.backends.mavlink.wire.dialect", "asyncio"} <= found
    assert not found & (NEVER | {"pymavlink", "yaml"})


def test_the_package_ual_has_no_more_than_values_and_errors() -> None:
    program = "import sys; before = set(sys.modules); import ual; print(*sorted(set(sys.modules) - before))"
    command = [sys.executable, "-S", "-c", program]
    environment = {"PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert "ual.types" in done.stdout.split()
    assert not {"ipaddress", "pathlib", "struct", "ual.shared.text"} & set(done.stdout.split())


def test_the_interface_of_a_uav_reads_no_files() -> None:
    program = "import sys, ual.interface, ual.missions.commands; print(*sorted(sys.modules))"
    command = [sys.executable, "-S", "-c", program]
    environment = {"PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    packages = ("fences", "logs", "missions", "parameters")
    readers = {f"ual.{each}.files" for each in packages} | {"ual.routes._files", "ual.routes._xml", "pyexpat"}
    assert not readers & set(done.stdout.split())
