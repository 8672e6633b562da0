"""Workers that are forked off one collection are as those that collect themselves."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

_ROOT = Path(__file__).parents[1]
_CONFTEST = """
from tests import workers


def pytest_xdist_setupnodes(config, specs):
    workers.fork_workers(config, specs)


def pytest_collection_finish(session):
    print("collected", len(session.items), file=open("collections", "a"))
"""
_FAILING = """
import os, sys


def test_it(tmp_path, worker_id):
    print("printed by", worker_id, "in", tmp_path.parent.name)
    os.write(2, b"written by " + os.environ["PYTEST_XDIST_WORKER"].encode())
    assert "the rest of pytest" in sys.path
"""


def _run(directory: Path, *files: str) -> str:
    command = [sys.executable, "-m", "pytest", "-c", os.devnull, "--rootdir", ".", "-p", "no:cacheprovider", "-n2"]
    environment = {"PYTHONPATH": str(_ROOT), **os.environ}
    run = subprocess.run([*command, *files], cwd=directory, env=environment, capture_output=True, text=True)
    return run.stdout + run.stderr


def test_they_share_a_collection_and_have_what_else_is_a_workers_own(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(_CONFTEST)
    for name in ("test_one.py", "test_other.py"):
        (tmp_path / name).write_text(_FAILING)
    (tmp_path / "test_missing.py").write_text("import nothing_of_this_name")
    told = _run(tmp_path)
    for worker in ("gw0", "gw1"):
        assert f"printed by {worker} in popen-{worker}" in told
        assert f"written by {worker}" in told
    assert "ModuleNotFoundError: No module named 'nothing_of_this_name'" in told
    assert "2 failed, 1 error" in told
    assert "Warning" not in told
    assert (tmp_path / "collections").read_text() == "collected 2\n"


def test_a_file_that_is_not_there_is_reported_as_by_pytest(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(_CONFTEST)
    told = _run(tmp_path, "test_missing.py")
    assert "file or directory not found: test_missing.py" in told
    assert "INTERNALERROR" not in told
