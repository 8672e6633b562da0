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
            interrupt()
def interrupt():
    os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
"""


# Python drops what is raised here, and tells it as a traceback.
IN_A_CALLBACK = """
import weakref
real = interrupt
def interrupt():
    weakref.finalize(type("Lock", (), {})(), real)
    reference = weakref.ref(type("Lock", (), {})(), lambda _: real())
"""


@pytest.mark.parametrize(
    ("entry", "imported"),
    [("ual_tools.entry", "ual_tools.app"), ("ual_daemon.program.entry", "ual_daemon.settings")],
)
@pytest.mark.parametrize("where", ["in an import", "in a callback of an import"])
def test_ctrl_c_at_the_start_ends_it_without_a_word(entry: str, imported: str, where: str) -> None:
    program = INTERRUPTED if where == "in an import" else INTERRUPTED + IN_A_CALLBACK
    command = [sys.executable, "-c", f"{program}\nfrom {entry} import main; main()", imported]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")
