"""Builds `ual_msgs` with the ROS 2 that is there, once, into the user's cache: what colcon does in a workspace.

So a program that imports `ual_msgs` needs no workspace. What ROS has already is not built.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from ual.errors import NotSupportedError, UalError
from ual_tools.ros2.found import RosInstallation

_HERE = Path(__file__).parent
_PACKAGED = _HERE / "packages"
SOURCES = _PACKAGED if _PACKAGED.is_dir() else _HERE.parents[2] / "ros2"
"""Folder of the ROS packages: within a wheel, or in the repository."""
_PACKAGES = {"tf2_msgs": _HERE / "tf2_msgs", "ual_msgs": SOURCES / "ual_msgs"}
_BUILT = (".action", ".msg", ".srv", ".txt", ".xml")
_TOOLS = ("cmake", "c++")
_NO_TOOLS = "ual_msgs has to be built once, and there is no {tools}: `sudo apt install build-essential cmake`"
_MOST_SHOWN_LINES = 15


def cache() -> Path:
    """Returns the directory of the user's cache in which interfaces are built.

    Raises:
        NotSupportedError: The user has no home directory.

    """
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ual" / "ros2"
    except RuntimeError:
        raise NotSupportedError("there is no home directory to build in: set HOME or XDG_CACHE_HOME") from None


def needed() -> dict[str, Path]:
    """Returns the packages that this Python does not import, by their names, and where their sources are."""
    return {name: source for name, source in _PACKAGES.items() if find_spec(name) is None}


def ready(
    ros: RosInstallation, directory: Path, tell: Callable[[str], None], *, for_python_alone: bool = False
) -> dict[str, str]:
    """Builds what is missing, and returns the variables of the environment in which it is found.

    Args:
        ros: With which ROS.
        directory: Into which directory; what is there already is not built.
        tell: Called with a human-readable line before something is built.
        for_python_alone: Whether to leave out what C++ needs, and so what records each topic (`ros2 bag record -a`).
            That takes half the time.

    Raises:
        NotSupportedError: There is no compiler.
        UalError: It cannot be built; the message has the end of what was said, and where all of it is.

    """
    packages = needed()
    if not packages:
        return {}
    prefix = directory / _key(ros, packages.values(), for_python_alone)
    if not prefix.is_dir():
        if missing := [tool for tool in _TOOLS if shutil.which(tool) is None]:
            raise NotSupportedError(_NO_TOOLS.format(tools=" and no ".join(missing)))
        prefix.parent.mkdir(parents=True, exist_ok=True)
        with _alone(prefix.with_suffix(".lock"), tell):
            if not prefix.is_dir():
                tell(_announced(packages, prefix, for_python_alone))
                _make(packages, prefix, ros, for_python_alone)
    return variables(prefix, ros, os.environ)


def variables(prefix: Path, ros: RosInstallation, before: Mapping[str, str]) -> dict[str, str]:
    """Returns the variables with which packages below `prefix` are found, before what the variables held."""
    found = sorted(str(path) for name in ("site-packages", "dist-packages") for path in prefix.glob(f"**/{name}"))
    ours = {
        "AMENT_PREFIX_PATH": [str(prefix), *map(str, ros.prefixes)],
        "LD_LIBRARY_PATH": [str(prefix / "lib"), before.get("LD_LIBRARY_PATH", "")],
        "PYTHONPATH": [*found, before.get("PYTHONPATH", "")],
    }
    return {name: os.pathsep.join(filter(None, paths)) for name, paths in ours.items()}


def _key(ros: RosInstallation, sources: Iterable[Path], for_python_alone: bool) -> str:
    """Returns a name that is another one wherever what is built would be another one."""
    digest = hashlib.sha256(repr((ros, ros.version_of("rclpy"), sys.version_info[:2], for_python_alone)).encode())
    for source in sources:
        for path in sorted(path for path in source.rglob("*") if path.suffix in _BUILT):
            digest.update(str(path.relative_to(source.parent)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@contextmanager
def _alone(lock: Path, tell: Callable[[str], None]) -> Iterator[None]:
    """Lets one process build, while the others wait: `ual ros2 &` and `ual ros2 --variables` begin at once."""
    import fcntl  # imported late: the other commands of `ual` run where the system has none

    with lock.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            tell("another program builds ual_msgs already: waiting for it")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _announced(packages: Iterable[str], prefix: Path, for_python_alone: bool) -> str:
    how_long = "about a minute" if for_python_alone else "some minutes"
    return f"building {' and '.join(packages)}, once, into {prefix}: {how_long}"


def _make(packages: Mapping[str, Path], prefix: Path, ros: RosInstallation, for_python_alone: bool) -> None:
    with tempfile.TemporaryDirectory(dir=prefix.parent) as scratch:
        for name, source in packages.items():
            _build(name, source, Path(scratch), prefix.parent / f"{prefix.name}.log", ros, for_python_alone)
        (Path(scratch) / "installed").rename(prefix)  # at once: another process finds all of it or nothing


def _build(name: str, source: Path, scratch: Path, log: Path, ros: RosInstallation, for_python_alone: bool) -> None:
    paths = os.pathsep.join(map(str, ros.prefixes))
    build = scratch / name
    settings = {
        f"CMAKE_PROJECT_{name}_INCLUDE": _HERE / "unite.cmake",
        "UAL_FOR_PYTHON_ALONE": "ON" if for_python_alone else "OFF",
        "BUILD_TESTING": "OFF",
        "CMAKE_INSTALL_PREFIX": scratch / "installed",
        "CMAKE_INSTALL_RPATH": "$ORIGIN",  # its libraries find each other wherever they are moved
        "Python3_EXECUTABLE": sys.executable,
    }
    steps = (
        ["cmake", "-S", str(source), "-B", str(build), *(f"-D{key}={value}" for key, value in settings.items())],
        ["cmake", "--build", str(build), "--parallel", str(os.cpu_count() or 1)],
        ["cmake", "--install", str(build)],
    )
    for step in steps:
        _run(step, os.environ | {"AMENT_PREFIX_PATH": paths, "CMAKE_PREFIX_PATH": paths}, log, name)


def _run(step: list[str], environment: Mapping[str, str], log: Path, name: str) -> None:
    done = subprocess.run(  # noqa: S603 (our own command)
        step, env=dict(environment), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    with log.open("a") as file:
        file.write(done.stdout)
    if done.returncode != 0:
        end = "\n".join(done.stdout.splitlines()[-_MOST_SHOWN_LINES:])
        raise UalError(
            f"{name} cannot be built: `{' '.join(step[:2])}` ended with {done.returncode}. All of it: {log}\n{end}"
        )
