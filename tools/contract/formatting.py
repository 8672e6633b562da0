"""The style of generated Python, which is that of the repository."""

from __future__ import annotations

import json
import subprocess
import sys

from tools.contract.compiled import ROOT

_OURS = ["ual", "ual_daemon", "ual_ros2", "ual_tools"]
"""Said here, since a module that is not written yet would be taken for another's."""


def formatted(source: str, package: str = "") -> str:
    """Returns a module of the clients, or of an extension's package, in its style, with its imports sorted."""
    ours = f"lint.isort.known-first-party = {json.dumps([*_OURS, package])}"
    for command in (["check", "--quiet", "--fix", "--select", "I", "--config", ours], ["format", "--quiet"]):
        where = str(ROOT / "clients" / "python" / "ual" / "_derived.py")
        ruff = [sys.executable, "-m", "ruff", *command, "--stdin-filename", where, "-"]
        source = subprocess.run(ruff, input=source, capture_output=True, text=True, check=True, cwd=ROOT).stdout  # noqa: S603 (our own command)
    return source
