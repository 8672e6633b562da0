"""The contract of layers holds, and breaks where it must: `lint-imports` over copies of the package."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NAME = "Each room of the daemon imports only those below it"


def layers() -> list[list[str]]:
    """The rooms of each layer, the highest first."""
    text = (ROOT / "pyproject.toml").read_text()
    contract = text[text.index(f'name = "{NAME}"') :].partition("layers = [")[2].partition("]")[0]
    return [re.split(r"\s*\|\s*", layer) for layer in re.findall(r'"([^"]+)"', contract)]


ROOMS = [room for layer in layers() for room in layer]
UPWARD = [(room, above[0]) for above, layer in pairwise(layers()) for room in layer]
SIBLINGS = [(room, other) for layer in layers() for room, other in pairwise(layer)]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the daemon, the client and the tools."""
    for package in ("ual_daemon", "clients/python/ual", "clients/python/ual_tools"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / package, tmp_path / Path(package).name, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def lint(directory: Path) -> subprocess.CompletedProcess[str]:
    """Runs the linter over the packages of a directory."""
    tool = Path(sys.executable).with_name("lint-imports")
    return subprocess.run([str(tool), "--no-cache"], cwd=directory, capture_output=True, text=True)


def add(directory: Path, room: str, line: str) -> None:
    """Puts a line into a room."""
    package = directory / "ual_daemon" / room
    module = package / "extra.py" if package.is_dir() else package.with_suffix(".py")
    with module.open("a") as file:
        file.write(f"\n{line}\n")


def test_the_contract_holds(copy: Path) -> None:
    ran = lint(copy)
    assert ran.returncode == 0, ran.stdout
    assert f"{NAME} KEPT" in ran.stdout


@pytest.mark.parametrize(("room", "above"), [*UPWARD, *SIBLINGS], ids=str)
def test_an_import_upward_or_aside_is_refused(copy: Path, room: str, above: str) -> None:
    add(copy, room, f"import ual_daemon.{above}")
    ran = lint(copy)
    assert ran.returncode != 0
    assert f"{NAME} BROKEN" in ran.stdout
    assert re.search(rf"ual_daemon\.{room}\S* ?-> ?ual_daemon\.{above}\b", ran.stdout), ran.stdout


def test_a_room_that_no_layer_names_is_refused(copy: Path) -> None:
    (copy / "ual_daemon" / "attic.py").touch()
    ran = lint(copy)
    assert ran.returncode != 0
    assert "attic" in ran.stdout


def test_the_top_of_the_package_stays_small() -> None:
    found = {path.stem for path in (ROOT / "ual_daemon").glob("*.py")} | {
        path.parent.name for path in (ROOT / "ual_daemon").glob("*/__init__.py")
    }
    assert found - {"__init__"} == set(ROOMS)
    assert len([name for name in found if not name.startswith("_")]) <= 14
