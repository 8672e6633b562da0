"""Both programs, interrupted before they have begun."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

# Ctrl-C comes while the program imports the rest of itself.
INTERRUPTED = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
"""


@pytest.mark.parametrize(
    ("entry", "imported", "status"),
    [("ual_tools.entry", "ual_tools.app", 130), ("ual_daemon.program.entry", "ual_daemon.settings", -signal.SIGINT)],
)
def test_ctrl_c_at_the_start_ends_it_without_a_word(entry: str, imported: str, status: int) -> None:
    command = [sys.executable, "-c", f"{INTERRUPTED}\nfrom {entry} import main; main()", imported]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", "")
