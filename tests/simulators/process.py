"""A simulated autopilot in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[2]


@contextmanager
def autopilot_process(kind: str, *flags: str) -> Iterator[dict[str, int]]:
    """Runs ``python -m tests.simulators`` during the block. Provides its ports by name."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.simulators", kind, *flags],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield json.loads(process.stdout.readline())
    finally:
        process.kill()
        process.communicate()
