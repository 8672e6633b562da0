"""Packages of the examples, as installed: in a directory of their own, seen only by what runs here."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.conftest import LIMIT_S

EXAMPLES = Path(__file__).parents[2] / "examples"
THREADS_LEFT = """
import threading
for thread in threading.enumerate():
    if thread is not threading.main_thread():
        thread.join(30.0)
print([thread.name for thread in threading.enumerate()])
"""
"""The last lines of a program: the names of the threads that do not end, when those that are ending have ended."""


def install(package: str, folder: Path) -> Path:
    """Installs a package of the examples, built from a copy of its source, without the network. Returns where."""
    source, target = folder / "source", folder / "installed"
    shutil.copytree(EXAMPLES / package, source, ignore=shutil.ignore_patterns("__pycache__"))
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-index"]
    done = subprocess.run(
        [*command, "--no-deps", "--no-build-isolation", "--target", str(target), str(source)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return target


def search_path(installed: Path) -> str:
    """The PYTHONPATH with which a program finds the package, and what it would find without it."""
    return os.pathsep.join([str(installed), *filter(None, [os.environ.get("PYTHONPATH")])])


def run(code: str, installed: Path, *arguments: object, limit_s: float = LIMIT_S) -> list[str]:
    """The lines that a program prints, which finds the package."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": search_path(installed)},
        capture_output=True,
        text=True,
        timeout=limit_s,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
