"""The table of what the tests reach."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILES = {
    "ual_daemon/flight/policy/lease.py": ([1, 2, 3, 4], []),
    "ual_daemon/flight/flight.py": ([1, 2], [3, 5, 6, 7]),
    "ual_daemon/backends/light/world.py": ([1], [2, 3, 4]),
    "ual_daemon/backends/base.py": ([1], []),
    "ual_daemon/settings.py": ([1], []),
    "clients/python/ual/aio/_uav.py": ([], [9]),
}


def run(tmp_path: Path, *words: str) -> list[str]:
    report = {
        name: {
            "summary": {"num_statements": len(reached) + len(missing), "covered_lines": len(reached)},
            "missing_lines": missing,
        }
        for name, (reached, missing) in FILES.items()
    }
    file = tmp_path / "coverage.json"
    file.write_text(json.dumps({"files": report}))
    command = [sys.executable, str(ROOT / "tools" / "coverage_by_room.py"), str(file), *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def test_rooms_come_with_the_least_reached_first(tmp_path: Path) -> None:
    assert [line.split()[:2] + line.split()[3:4] for line in run(tmp_path)] == [
        ["clients/python/ual", "0.0", "1"],
        ["ual_daemon/backends/light", "25.0", "3"],
        ["ual_daemon/flight", "60.0", "4"],
        ["ual_daemon/backends", "100.0", "0"],
        ["ual_daemon", "100.0", "0"],
        ["all", "52.9", "8"],
    ]


def test_rows_that_are_not_reached_come_in_runs(tmp_path: Path) -> None:
    assert run(tmp_path, "--missing") == [
        "clients/python/ual/aio/_uav.py: 9",
        "ual_daemon/backends/light/world.py: 2-4",
        "ual_daemon/flight/flight.py: 3, 5-7",
    ]
