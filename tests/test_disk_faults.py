"""A fault of the disk lasts as long as it does on the disk, for each file that UAL writes: see `tests.disk_faults`."""

from __future__ import annotations

import ast
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.disk_faults import FAULTS
from tests.waiting import LIMIT_S

_ROOT = Path(__file__).parents[1]
_PRODUCT = ("clients/python", "ual_daemon")
_NOT_WHOLE = {
    "clients/python/ual/shared/whole_file.py": "is what the others use",
    "clients/python/ual/logs/files.py": "a download that goes on where it was cut off",
    "clients/python/ual_tools/launch/log_file.py": "lines are appended",
    "clients/python/ual_tools/plot.py": "matplotlib draws into what whole_file.writing has made",
    "clients/python/ual_tools/recording/page.py": "the same",
    "clients/python/ual_tools/recording/tables.py": "opens what whole_file.writing has made",
    "clients/python/ual_tools/ros2/interfaces.py": "a lock, and what a compiler says",
    "clients/python/ual_tools/streams.py": "the terminal",
    "ual_daemon/program/namespace.py": "a lock",
    "ual_daemon/program/recording/audit_file.py": "lines are appended",
    "ual_daemon/program/worker.py": "pipes to the supervisor",
}
"""The modules that write to a file by other means than `ual.shared.whole_file`, and why."""
_OPENING = ("open", "fdopen")
_WRITING = ("write_text", "write_bytes", "savefig", "ParquetWriter")
_OWN_MOUNTS = ("unshare", "--user", "--map-root-user", "--mount")


def _can_mount() -> bool:
    try_it = (*_OWN_MOUNTS, "mount", "-t", "tmpfs", "tmpfs", "/mnt")
    if shutil.which("unshare") is None:
        return False
    return subprocess.run(try_it, capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("fault", FAULTS)
def test_each_file_survives_a_fault_of_the_disk_and_is_written_once_it_is_back(fault: str) -> None:
    if not _can_mount():
        pytest.skip("this system lets a program mount no disk of its own")
    program = (*_OWN_MOUNTS, sys.executable, "-m", "tests.disk_faults", fault)
    done = subprocess.run(program, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {}, done.stderr


def test_a_file_is_written_whole_or_the_list_says_why_not() -> None:
    modules = [path for product in _PRODUCT for path in sorted((_ROOT / product).rglob("*.py"))]
    writing = {str(path.relative_to(_ROOT)) for path in modules if _writes(path.read_text())}
    assert writing == set(_NOT_WHOLE)


def _writes(source: str) -> bool:
    if not any(f"{name}(" in source for name in (*_OPENING, *_WRITING)):
        return False
    return any(_is_writing(node) for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call))


def _is_writing(call: ast.Call) -> bool:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    given = [*call.args, *(each.value for each in call.keywords)]
    if name in _OPENING:
        is_created = "O_CREAT" in ast.unparse(call) or any(ast.unparse(each) in ("_NEW", "_APPEND") for each in given)
        modes = [each.value for each in ast.walk(call) if isinstance(each, ast.Constant)]
        return is_created or any(mode in ("w", "a", "x", "wb", "ab", "xb", "r+b", "w+b") for mode in modes)
    return name in _WRITING
