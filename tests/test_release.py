"""Checks of `make release`, and the files that the beginning of a version writes."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from datetime import date
from pathlib import Path
from types import ModuleType

import pytest

import ual

ROOT = Path(__file__).parents[1]
CHANGELOG = "# Changelog\n\n## 1.2.0 - 2026-11-25\n\n### Added\n\n- A.\n\n## 1.1.0 - 2026-01-01\n\n- B.\n"


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("release", ROOT / "tools" / "release.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


release = load()


def git(root: Path, *words: str) -> None:
    name = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    subprocess.run(["git", *name, *words], cwd=root, check=True, capture_output=True)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A repository like ours, ready for the release of 1.2.0."""
    for folder in ("ual_daemon", "clients/python/ual", "clients/python/more"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "__init__.py").write_text('"""A package."""\n\n__version__ = "1.2.0"\n')
    (tmp_path / "pyproject.toml").write_text('dependencies = [\n    "ual-client==1.2.0",\n    "numpy>=1.2.0",\n]\n')
    ros = tmp_path / "clients" / "ros2" / "node"
    ros.mkdir(parents=True)
    (ros / "package.xml").write_text('<package format="3">\n  <version>1.2.0</version>\n</package>\n')
    (ros / "setup.py").write_text('setup(\n    name="node",\n    version="1.2.0",\n)\n')
    (tmp_path / "CHANGELOG.md").write_text(CHANGELOG)
    for name, text in (
        ("kubernetes/kustomization.yaml", "{name: ual, newTag: 1.2.0}"),
        ("container/README.md", "ual:1.2.0 --ns"),
    ):
        path = tmp_path / "deploy" / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    git(tmp_path, "init", "--quiet")
    commit(tmp_path)
    return tmp_path


def commit(root: Path) -> None:
    git(root, "add", "--all")
    git(root, "commit", "--quiet", "--message", "x")


def write(root: Path, name: str, old: str, new: str) -> None:
    path = root / name
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def test_what_is_ready_is_released(root: Path) -> None:
    assert release.check(root) == "1.2.0"
    git(root, "config", "user.name", "a")
    git(root, "config", "user.email", "a@b.c")
    assert release.tag(root) == release.tag(root) == "v1.2.0"
    told = subprocess.run(["git", "tag", "--list", "-n9"], cwd=root, capture_output=True, text=True).stdout
    assert re.sub(r"\s+", " ", told) == "v1.2.0 1.2.0 ### Added - A. "
    assert release.check(root) == "1.2.0"  # again, for the same commit
    assert release.notes_of(CHANGELOG, "1.2.0") == "### Added\n\n- A."


@pytest.mark.parametrize(
    ("name", "old", "new", "why"),
    [
        ("ual_daemon/__init__.py", "1.2.0", "1.2.1", "the versions differ"),
        ("pyproject.toml", "client==1.2.0", "client==1.1.0", "the versions differ"),
        ("clients/ros2/node/package.xml", "1.2.0", "1.1.0", "the versions differ"),
        ("clients/ros2/node/setup.py", "1.2.0", "1.1.0", "the versions differ"),
        ("CHANGELOG.md", "2026-11-25", "unreleased", "write the day of the release for 'unreleased' of 1.2.0"),
        ("CHANGELOG.md", "## 1.2.0 - 2026-11-25\n", "", "the first section of CHANGELOG.md is not that of 1.2.0"),
        ("CHANGELOG.md", "### Added\n\n- A.\n", "", "no notes of 1.2.0"),
    ],
)
def test_what_is_not_ready_is_refused(root: Path, name: str, old: str, new: str, why: str) -> None:
    write(root, name, old, new)
    commit(root)
    with pytest.raises(release.ReleaseError, match=re.escape(why)):
        release.check(root)


def test_what_is_not_committed_or_tagged_elsewhere_is_refused(root: Path) -> None:
    write(root, "CHANGELOG.md", "- A.", "- A, and more.")
    with pytest.raises(release.ReleaseError, match="not committed"):
        release.check(root)
    git(root, "tag", "v1.2.0")
    commit(root)
    with pytest.raises(release.ReleaseError, match=re.escape("v1.2.0 is the tag of another commit")):
        release.check(root)


def test_a_version_begins_everywhere(root: Path) -> None:
    release.begin(root, "1.3.0")
    assert release.version_of(root) == "1.3.0.dev0"  # which no release has
    assert "<version>1.3.0</version>" in (root / "clients/ros2/node/package.xml").read_text()  # ROS knows no others
    assert "ual:1.3.0.dev0 --ns" in (root / "deploy/container/README.md").read_text()
    assert "newTag: 1.3.0.dev0}" in (root / "deploy/kubernetes/kustomization.yaml").read_text()
    assert "## 1.3.0 - unreleased\n\n## 1.2.0 - 2026-11-25\n" in (root / "CHANGELOG.md").read_text()
    assert '"numpy>=1.2.0"' in (root / "pyproject.toml").read_text()
    with pytest.raises(release.ReleaseError, match="write the day of the release"):
        release.begin(root, "1.4.0")
    with pytest.raises(release.ReleaseError, match="is no version"):
        release.begin(root, "v2")
    commit(root)
    with pytest.raises(release.ReleaseError, match=re.escape("1.3.0.dev0 is no release")):
        release.check(root)


def test_a_version_that_was_begun_is_cut(root: Path) -> None:
    with pytest.raises(release.ReleaseError, match="begin the next version"):
        release.cut(root, date(2026, 12, 1))
    release.begin(root, "1.3.0")
    write(root, "CHANGELOG.md", "unreleased\n", "unreleased\n\n- C.\n")
    release.cut(root, date(2026, 12, 1))
    commit(root)
    assert release.check(root) == "1.3.0"
    assert (root / "CHANGELOG.md").read_text().startswith("# Changelog\n\n## 1.3.0 - 2026-12-01\n\n- C.\n")
    assert "ual:1.3.0 --ns" in (root / "deploy/container/README.md").read_text()


def test_all_versions_of_this_repository_are_one() -> None:
    assert release.version_of(ROOT) == ual.__version__


def test_the_program_says_why_not(root: Path) -> None:
    (root / "tools").mkdir()
    (root / "tools" / "release.py").write_text((ROOT / "tools" / "release.py").read_text())
    done = subprocess.run([sys.executable, "tools/release.py", "check"], cwd=root, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (1, "release: there are changes that are not committed\n")
