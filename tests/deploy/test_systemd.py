"""The units of deploy/systemd, as systemd itself judges them."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.conftest import LIMIT_S

UNITS = Path(__file__).parents[2] / "deploy" / "systemd"
PROGRAM = "/opt/ual/bin/ual-daemon"

needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None,
    reason="SYSTEMD IS MISSING, its units are NOT TESTED: apt-get install systemd",
)


@needs_systemd
def test_the_unit_of_a_daemon_is_one(tmp_path: Path) -> None:
    text = (UNITS / "ual-daemon@.service").read_text()
    assert PROGRAM in text
    true = shutil.which("true")
    assert true is not None
    (tmp_path / "ual-daemon@.service").write_text(text.replace(PROGRAM, true))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(tmp_path / "ual-daemon@uav_1.service")],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    ours = [line for line in done.stderr.splitlines() if "ual-daemon" in line]
    assert not ours, done.stderr
    assert done.returncode == 0, done.stderr


@needs_systemd
def test_a_daemon_may_do_little() -> None:
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", "--no-pager", str(UNITS / "ual-daemon@.service")],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    score = re.search(r"exposure level for .*: ([\d.]+) ", done.stdout)
    assert score is not None, done.stdout + done.stderr
    assert float(score[1]) < 3.0, done.stdout


@pytest.mark.skipif(
    shutil.which("systemd-tmpfiles") is None,
    reason="SYSTEMD IS MISSING, its directory is NOT TESTED: apt-get install systemd",
)
def test_the_directory_of_the_daemons_is_for_all(tmp_path: Path) -> None:
    done = subprocess.run(
        ["systemd-tmpfiles", "--create", f"--root={tmp_path}", str(UNITS / "ual.conf")],
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run" / "ual").stat().st_mode & 0o7777 == 0o1777
