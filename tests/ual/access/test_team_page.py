"""docs/how-to/access.md, the team: each of its commands is run, with the addresses of this computer."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from tests.conftest import LIMIT_S, daemon_environment
from tests.ual_daemon.server.access.entrances import beyond_loopback
from tests.waiting import until

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "access.md"
MOST_LINES = 15
COPY = 'scp() { to="${@: -1}"; mkdir -p "${to%:}"; cp "${@:1:$#-1}" "${to%:}"; }\n'


def parts() -> list[str]:
    """The commands on the first laptop, on a UAV, and on each laptop."""
    block = re.search(r"^```bash\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert block is not None
    assert len(block[1].splitlines()) < MOST_LINES
    first, uav, laptop = (each for each in re.split(r"^#.*\n", block[1], flags=re.MULTILINE) if each)
    return [first, uav, laptop]


def test_the_commands_of_the_page_set_up_a_team(tmp_path: Path) -> None:
    host = beyond_loopback()
    first, uav, laptop = (each.replace("192.168.1.11", host) for each in parts())
    environment = daemon_environment(tmp_path / "run")
    environment["PATH"] = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))

    def bash(script: str, folder: Path) -> str:
        command = ["bash", "-euc", COPY + script]
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=LIMIT_S)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    bash(first, tmp_path)
    daemon = shlex.split(uav.replace("0.0.0.0:50051", f"{host}:0"))
    with subprocess.Popen(
        [*daemon, "--log-format", "json"], cwd=tmp_path / "uav-1", env=environment, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        try:
            listening = next(line for line in process.stderr if '"listening"' in line)
            address = re.search(rf"{re.escape(host)}:\d+", listening)
            assert address is not None
            (tmp_path / "authority.pem").write_bytes((tmp_path / "certificates" / "authority.pem").read_bytes())
            ask = laptop.replace(f"{host}:50051", address[0])
            until(lambda: "LANDED_DISARMED" in bash(ask, tmp_path))
        finally:
            process.kill()
