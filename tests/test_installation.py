"""Installation by `make`: one set of versions for everything, and imported modules compiled."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.10", "3.11", "3.12", "3.13", "3.14")

# --- The versions -----------------------------------------------------------------------------------------------------


def pinned(python: str) -> dict[str, str]:
    """The version of each package in the lock, for a version of Python."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [Requirement(line) for line in lines if not line.startswith("#")]
    chosen = [pin for pin in pins if is_meant(pin, python)]
    assert len({canonicalize_name(pin.name) for pin in chosen}) == len(chosen)
    return {canonicalize_name(pin.name): str(pin.specifier).removeprefix("==") for pin in chosen}


def is_meant(requirement: Requirement, python: str) -> bool:
    versions = {"python_version": python, "python_full_version": f"{python}.0"}
    return requirement.marker is None or requirement.marker.evaluate(versions)


def requested() -> Iterator[Requirement]:
    """Yields the requirements of the distributions, with every extra, and those of the benchmarks."""
    for project in (".", "clients/python", "clients/python/ual_tools"):
        core = ProjectMetadata(str(ROOT / project), PluginManager()).core
        yield from map(Requirement, core.dependencies)
        yield from (Requirement(each) for extra in core.optional_dependencies.values() for each in extra)
    benchmarks = (ROOT / "benchmarks" / "requirements.txt").read_text(encoding="utf-8").splitlines()
    yield from (Requirement(line) for line in benchmarks if not line.startswith("#"))


@pytest.mark.parametrize("python", PYTHONS)
def test_the_lock_has_a_version_of_each_package_that_is_requested(python: str) -> None:
    versions = pinned(python)
    wanted = [each for each in requested() if not each.name.startswith("ual-") and is_meant(each, python)]
    assert {"grpcio", "protobuf", "viser", "sphinx", "mcap", "ruff"} <= {each.name for each in wanted}
    missing = [each for each in wanted if not each.specifier.contains(versions.get(canonicalize_name(each.name), "0"))]
    assert not missing, "run `make lock`"


def commands_of(*targets: str, venv: str = "build/nowhere") -> list[str]:
    """Returns the commands that `make` would run."""
    command = ["make", "--dry-run", "--always-make", f"VENV={venv}", *targets]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60.0)
    return done.stdout.splitlines()


def test_every_installation_is_by_the_lock() -> None:
    """So `make dev` after `make run` changes no version: both name the same one."""
    lines = commands_of("dev", "docs", "bench")
    installations = [line for line in lines if "pip install" in line and "--target" not in line]
    assert len(installations) == 4
    assert all("--constraint constraints.txt" in line for line in installations), installations


# --- What is compiled -------------------------------------------------------------------------------------------------

IMPORTING = """
import contextlib, importlib, importlib.util, json, struct, sys
from pathlib import Path
from ual_tools.main import main as _
from ual_daemon.program import daemon as _
from ual_daemon.program.main import main
for backend in ("light", "mavlink"):
    with contextlib.suppress(SystemExit):
        main(["--backend", backend, "--print-config"])

def is_compiled(file):
    cached = Path(importlib.util.cache_from_source(str(file)))
    _, _, mtime, size = struct.unpack("<4sLLL", cached.read_bytes()[:16]) if cached.exists() else (b"", 0, 0, -1)
    return (mtime, size) == (int(file.stat().st_mtime) & 0xFFFFFFFF, file.stat().st_size & 0xFFFFFFFF)

files = {name: Path(each.__file__) for name, each in sys.modules.items() if getattr(each, "__file__", None)}
sources = {name: file for name, file in files.items() if file.suffix == ".py" and file.is_relative_to(sys.prefix)}
print(json.dumps([sorted(sources), [name for name, file in sources.items() if not is_compiled(file)]]))
"""


def test_a_start_compiles_nothing_that_the_installation_could_have(tmp_path: Path) -> None:
    """A start used to compile pymavlink's dialect where Python may write no compiled modules: 0.5 s and 90 MiB."""
    [compile_used] = [line for line in commands_of("install", venv=sys.prefix) if "compile_used" in line]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("UAL_")}
    environment |= {"PYTHONPYCACHEPREFIX": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    for command in (["sh", "-c", compile_used], [sys.executable, "-c", IMPORTING]):
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=250.0)
        assert done.returncode == 0, done.stderr
    imported, not_compiled = json.loads(done.stdout.splitlines()[-1])
    assert {"google.protobuf", "grpc", "msgspec"} <= set(imported)
    assert not_compiled == []
