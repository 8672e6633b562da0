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
FORBIDDEN = [*UPWARD, *SIBLINGS]
pytestmark = pytest.mark.xdist_group("layers")  # the linter runs once for all forbidden imports


def copy_to(directory: Path) -> Path:
    """Copies the packages whose imports are checked."""
    [names] = re.findall(r"root_packages = \[(.*)\]", (ROOT / "pyproject.toml").read_text())
    for name in re.findall(r'"(\w+)"', names):
        [package] = [path for path in (ROOT / name, ROOT / "clients/python" / name) if path.is_dir()]
        shutil.copytree(package, directory / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", directory)
    return directory


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


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> subprocess.CompletedProcess[str]:
    """Output of the linter about a copy in which each room imports one that it may not."""
    copy = copy_to(tmp_path_factory.mktemp("broken"))
    for room, other in FORBIDDEN:
        add(copy, room, f"import ual_daemon.{other}")
    return lint(copy)


def test_the_contract_holds(tmp_path: Path) -> None:
    ran = lint(copy_to(tmp_path))
    assert ran.returncode == 0, ran.stdout
    assert f"{NAME} KEPT" in ran.stdout


@pytest.mark.parametrize(("room", "other"), FORBIDDEN, ids=str)
def test_an_import_upward_or_aside_is_refused(broken: subprocess.CompletedProcess[str], room: str, other: str) -> None:
    assert broken.returncode != 0
    assert f"{NAME} BROKEN" in broken.stdout
    assert re.search(rf"ual_daemon\.{room}\S* ?-> ?ual_daemon\.{other}\b", broken.stdout), broken.stdout


def test_a_room_that_no_layer_names_is_refused(tmp_path: Path) -> None:
    copy = copy_to(tmp_path)
    (copy / "ual_daemon" / "attic.py").touch()
    ran = lint(copy)
    assert ran.returncode != 0
    assert "attic" in ran.stdout


def test_the_top_of_the_package_stays_small() -> None:
    found = {path.stem for path in (ROOT / "ual_daemon").glob("*.py")} | {
        path.parent.name for path in (ROOT / "ual_daemon").glob("*/__init__.py")
    }
    assert found - {"__init__"} == set(ROOMS)
    assert len([name for name in found if not name.startswith("_")]) <= 18
