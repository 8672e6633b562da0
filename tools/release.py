"""Cuts, checks, tags and begins versions: ``python tools/release.py begin 0.3.0``. `make release` checks and tags.

All distributions of this repository have one version. The changelog has a section for each, the newest first. What is
not released yet is a development release of it (``0.3.0.dev0``), so that no two states of main and a release agree.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from datetime import date, datetime, timezone
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_PINNED = re.compile(r'(?<="ual-client==)[^"]+')
_VERSION = re.compile(r'(?<=^__version__ = ")[^"]+', re.MULTILINE)
_ROS_VERSIONS = {
    "package.xml": re.compile(r"(?<=<version>)[^<]+"),
    "setup.py": re.compile(r'(?<=^    version=")[^"]+', re.MULTILINE),
}
"""Files of the packages for ROS."""
_OTHERS = {
    "deploy/kubernetes/kustomization.yaml": re.compile(r"(?<=newTag: )[^}\s]+"),
    "deploy/container/README.md": re.compile(r"(?<=\bual:)\d[^ ]*"),
}
"""Files that name the image."""
_DEVELOPMENT = ".dev0"
_SECTION = re.compile(r"^## (?P<version>\S+) - (?P<when>\S+)$", re.MULTILINE)
_UNRELEASED = "unreleased"


class ReleaseError(Exception):
    """The repository is not ready."""


def version_files(root: Path) -> Iterator[tuple[Path, re.Pattern[str]]]:
    """Yields each place that states the version: a file and how it does."""
    packages = (root / "ual_daemon", *sorted((root / "clients/python").iterdir()))
    for path in (package / name for package in packages for name in ("__init__.py", "_version.py")):
        if path.is_file() and _VERSION.search(path.read_text(encoding="utf-8")):
            yield path, _VERSION
    for path in (root / "pyproject.toml", *sorted(root.glob("clients/python/**/pyproject.toml"))):
        if _PINNED.search(path.read_text(encoding="utf-8")):
            yield path, _PINNED
    for name, form in _ROS_VERSIONS.items():
        yield from ((path, form) for path in sorted(root.glob(f"clients/ros2/*/{name}")))
    yield from ((root / name, form) for name, form in _OTHERS.items() if (root / name).is_file())


def stated(path: Path, version: str) -> str:
    """Returns a version as a file states it: ROS knows no development releases."""
    return version.removesuffix(_DEVELOPMENT) if path.name in _ROS_VERSIONS else version


def version_of(root: Path) -> str:
    """Returns the version that all distributions have.

    Raises:
        ReleaseError: They differ.

    """
    found: dict[str, str] = {
        path.relative_to(root).as_posix(): version
        for path, form in version_files(root)
        for version in form.findall(path.read_text(encoding="utf-8"))
    }
    # The longest: 0.3.0.dev0 beside ROS' 0.3.0.
    version = max(found.values(), key=len)
    if any(each != stated(Path(name), version) for name, each in found.items()):
        raise ReleaseError(f"the versions differ: {found}")
    return version


def notes_of(changelog: str, version: str) -> str:
    """Returns the notes of a version.

    Raises:
        ReleaseError: It has no section, or is not dated, or is not the newest.

    """
    sections = list(_SECTION.finditer(changelog))
    if not sections or sections[0]["version"] != version:
        raise ReleaseError(f"the first section of CHANGELOG.md is not that of {version}")
    try:
        date.fromisoformat(sections[0]["when"])
    except ValueError:
        raise ReleaseError(f"write the day of the release for '{sections[0]['when']}' of {version}") from None
    end = sections[1].start() if len(sections) > 1 else len(changelog)
    return changelog[sections[0].end() : end].strip()


def check(root: Path) -> str:
    """Returns the version, if the commit that is checked out can become its release.

    Raises:
        ReleaseError: It cannot; says why.

    """
    version = version_of(root)
    if version.endswith(_DEVELOPMENT):
        raise ReleaseError(f"{version} is no release: `python tools/release.py cut` makes it one")
    if not notes_of((root / "CHANGELOG.md").read_text(encoding="utf-8"), version):
        raise ReleaseError(f"CHANGELOG.md has no notes of {version}")
    if _git(root, "status", "--porcelain"):
        raise ReleaseError("there are changes that are not committed")
    tagged = _git(root, "tag", "--list", f"v{version}")
    if tagged and _git(root, "rev-list", "-n", "1", f"v{version}") != _git(root, "rev-parse", "HEAD"):
        raise ReleaseError(f"v{version} is the tag of another commit: begin the next version")
    return version


def tag(root: Path) -> str:
    """Tags the commit with its version and notes, if that is not done yet. Returns the tag.

    Raises:
        ReleaseError: It cannot become a release.

    """
    version = check(root)
    if not _git(root, "tag", "--list", f"v{version}"):
        notes = notes_of((root / "CHANGELOG.md").read_text(encoding="utf-8"), version)
        _git(root, "tag", "--annotate", "--cleanup=verbatim", "--message", f"{version}\n\n{notes}", f"v{version}")
    return f"v{version}"


def cut(root: Path, day: date) -> None:
    """Makes a release of the version that was begun: writes it into all files that state it, and its day.

    Raises:
        ReleaseError: None was begun.

    """
    begun = version_of(root)
    version = begun.removesuffix(_DEVELOPMENT)
    path = root / "CHANGELOG.md"
    changelog = path.read_text(encoding="utf-8")
    head = f"## {version} - {_UNRELEASED}\n"
    if begun == version or head not in changelog:
        raise ReleaseError(f"{begun} was released, or has no section '{head.strip()}': begin the next version")
    path.write_text(changelog.replace(head, f"## {version} - {day.isoformat()}\n"), encoding="utf-8")
    _write(root, version)


def begin(root: Path, version: str) -> None:
    """Writes a new version into all files that state it, as a development release, and begins its section.

    Raises:
        ReleaseError: The version is none, or the one before is not released.

    """
    if not re.fullmatch(r"\d+\.\d+\.\d+", version):
        raise ReleaseError(f"{version!r} is no version: write 0.3.0")
    path = root / "CHANGELOG.md"
    changelog = path.read_text(encoding="utf-8")
    notes_of(changelog, version_of(root).removesuffix(_DEVELOPMENT))
    first = _SECTION.search(changelog)
    assert first is not None
    head = f"## {version} - {_UNRELEASED}\n\n"
    path.write_text(changelog[: first.start()] + head + changelog[first.start() :], encoding="utf-8")
    _write(root, version + _DEVELOPMENT)


def _write(root: Path, version: str) -> None:
    for file, form in list(version_files(root)):
        file.write_text(form.sub(stated(file, version), file.read_text(encoding="utf-8")), encoding="utf-8")


def _git(root: Path, *words: str) -> str:
    return subprocess.run(["git", *words], cwd=root, check=True, capture_output=True, text=True).stdout.strip()  # noqa: S603, S607


def main(words: Sequence[str]) -> None:
    """Runs the command of the words."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("check", help="Print the version, if the present commit can become its release.")
    commands.add_parser("tag", help="Tag that commit.")
    commands.add_parser("cut", help="Make a release of the version that was begun, today.")
    commands.add_parser("begin", help="Begin the next version.").add_argument("version")
    arguments = parser.parse_args(words)
    try:
        if arguments.command == "begin":
            begin(ROOT, arguments.version)
        elif arguments.command == "cut":
            cut(ROOT, datetime.now(timezone.utc).date())
        else:
            print({"check": check, "tag": tag}[arguments.command](ROOT))
    except ReleaseError as error:
        sys.exit(f"release: {error}")


if __name__ == "__main__":
    main(sys.argv[1:])
