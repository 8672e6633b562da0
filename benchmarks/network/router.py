"""A router as a process: ``ual router``."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

from benchmarks.children import UAL, Process


def start(file: Path, prefix: Sequence[str] = ()) -> Process:
    """Starts a router with its configuration. Returns it once it says that it routes. `prefix` begins the command."""
    process = Process([*prefix, UAL, "router", str(file)], stdout=subprocess.PIPE)
    assert process.popen.stdout is not None
    process.popen.stdout.readline()
    return process
